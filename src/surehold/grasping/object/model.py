"""A rigid object: its mesh, mass and friction, and the box in whose axes it is grasped.

Facets of the box: right +x, left -x, front +y, back -y, top +z, bottom -z along the box's own axes, which for a shipped
object are those of its frame (shipped.py) and for a mesh file are found by mesh_files.py.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.object.solids import Solid

if TYPE_CHECKING:
    from surehold.grasping.object.distance_field import DistanceField

__all__ = ["GraspObject"]


@dataclass(frozen=True, eq=False)
class GraspObject:
    """A rigid object: a watertight mesh in the object's own frame, its mass and its friction."""

    name: str  #: short name, as the command line spells it
    vertices: NDArray[np.float64] = field(repr=False)  #: (v, 3) m
    faces: NDArray[np.int32] = field(repr=False)  #: (f, 3), counterclockwise seen from outside
    mass: float  #: kg
    center_of_mass: NDArray[np.float64]  #: (3,) m
    friction: float = 0.5  #: coefficient of friction at a contact with the hand
    solids: tuple[Solid, ...] = field(default=(), repr=False)  #: the exact solids; empty for a mesh read from a file
    axes: NDArray[np.float64] = field(default_factory=lambda: np.eye(3), repr=False)  #: (3, 3) columns: axes of its box
    distances: "DistanceField | None" = field(default=None, repr=False)  #: where they are known; else they are computed
    draws: "tuple[GraspObject, ...]" = field(default=(), repr=False)  #: equally likely shapes, if its own is unknown
    #: standard deviation of where the surface is, at each vertex (v,) [m]; None where that is known
    deviation: NDArray[np.float64] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.friction) and self.friction > 0.0):
            raise InputError(f"friction of '{self.name}' is {self.friction!r}; give a positive number such as 0.5.")
        if not (np.isfinite(self.mass) and self.mass > 0.0):
            raise InputError(f"mass of '{self.name}' is {self.mass!r}; give a positive number of kilograms.")
        points, faces = np.asarray(self.vertices), np.asarray(self.faces)
        if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.all(np.isfinite(points)):
            raise InputError(f"vertices of '{self.name}' are not finite numbers (v, 3), one or more; give meters.")
        if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces) or faces.min() < 0 or faces.max() >= len(points):
            raise InputError(f"faces of '{self.name}' are not (f, 3), one or more, of 0 to {len(points) - 1}.")
        if np.shape(self.center_of_mass) != (3,) or not np.all(np.isfinite(self.center_of_mass)):
            raise InputError(
                f"center_of_mass of '{self.name}' is {self.center_of_mass!r}; give three numbers in meters."
            )
        axes = np.asarray(self.axes)
        if axes.shape != (3, 3) or not np.allclose(axes.T @ axes, np.eye(3), atol=1e-6) or np.linalg.det(axes) < 0.0:
            raise InputError(
                f"axes of '{self.name}' are no rotation (3, 3); give the axes of its box as unit columns, right-handed."
            )

    @property
    def box_center(self) -> NDArray[np.float64]:
        """Center (3,) of the object's box in the object's frame [m]."""
        lower, upper = self._box
        return self.axes @ (0.5 * (lower + upper))

    @property
    def box_half_extents(self) -> NDArray[np.float64]:
        """Half edge lengths (3,) of the object's box, along its axes [m]."""
        lower, upper = self._box
        return 0.5 * (upper - lower)

    @property
    def torque_length(self) -> float:
        """Length by which torques are divided to compare with forces: half of the box's longest edge [m]."""
        return float(self.box_half_extents.max())

    @cached_property
    def _box(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        placed = self.vertices @ self.axes
        return placed.min(axis=0), placed.max(axis=0)

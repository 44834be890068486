"""The shipped objects, built from solids: the mug, the bottle, the glass and the drill.

Each object stands in its own frame: z up, x to the right, y to the front, the origin on its axis at the foot.
Facets of its box: right +x, left -x, front +y, back -y, top +z, bottom -z.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.solids import RevolvedProfile, RoundedBox, Solid, Tube, triangles

__all__ = ["OBJECTS", "GraspObject", "shipped_object"]


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

    def __post_init__(self) -> None:
        if not (np.isfinite(self.friction) and self.friction > 0.0):
            raise InputError(f"friction of '{self.name}' is {self.friction!r}; give a positive number such as 0.5.")
        if not (np.isfinite(self.mass) and self.mass > 0.0):
            raise InputError(f"mass of '{self.name}' is {self.mass!r}; give a positive number of kilograms.")

    @property
    def box_center(self) -> NDArray[np.float64]:
        """Center (3,) of the object's box, whose axes are those of the object's own frame [m]."""
        return 0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0))

    @property
    def box_half_extents(self) -> NDArray[np.float64]:
        """Half edge lengths (3,) of the object's box [m]."""
        return 0.5 * (self.vertices.max(axis=0) - self.vertices.min(axis=0))

    @property
    def torque_length(self) -> float:
        """Length by which torques are divided to compare with forces: half of the box's longest edge [m]."""
        return float(self.box_half_extents.max())


#: name -> (builder of the solids, density [kg/m^3])
_BUILDERS: dict[str, tuple[Callable[[], tuple[Solid, ...]], float]] = {}


def _mug() -> tuple[Solid, ...]:
    """Stoneware: 80 mm wide, 95 mm high, wall 4 mm, bottom 6 mm, a round bar of 11 mm as handle towards the back."""
    outer, inner, height, bottom = 0.040, 0.036, 0.095, 0.006
    cup = RevolvedProfile(((0.0, 0.0), (outer, 0.0), (outer, height), (inner, height), (inner, bottom), (0.0, bottom)))
    bar = 0.0055
    turn = np.linspace(0.0, np.pi, 21)
    reach = inner + bar + 0.030 * np.sin(turn) ** 0.8  # the ends are tangent to the inner wall, not beyond it
    handle = np.column_stack([np.zeros_like(turn), -reach, 0.0475 + 0.029 * np.cos(turn)])
    return cup, Tube(tuple(map(tuple, handle.tolist())), bar)


def _bottle() -> tuple[Solid, ...]:
    """A full half-liter-class water bottle: 52.5 mm wide, 160 mm high, shoulder from 105 mm, cap of 13 mm."""
    body, cap = 0.02625, 0.0065
    shoulder = [
        (cap + (body - cap) * 0.5 * (1.0 + np.cos(s * np.pi)), 0.105 + 0.030 * s) for s in np.linspace(0.0, 1.0, 13)
    ]
    corners = [(0.0, 0.0), (body - 0.002, 0.0), (body, 0.002), *shoulder, (cap, 0.160), (0.0, 0.160)]
    return (RevolvedProfile(tuple((float(r), float(z)) for r, z in corners)),)


def _glass() -> tuple[Solid, ...]:
    """A tall drinking glass: 71 mm wide at the rim, 57 mm at the foot, 159 mm high, wall 2 mm, bottom 8 mm."""
    foot, rim, height, wall, bottom = 0.0285, 0.0355, 0.159, 0.002, 0.008
    inner_foot = foot + (rim - foot) * bottom / height - wall
    corners = ((0.0, 0.0), (foot, 0.0), (rim, height), (rim - wall, height), (inner_foot, bottom), (0.0, bottom))
    return (RevolvedProfile(corners),)


def _drill() -> tuple[Solid, ...]:
    """A cordless drill of 190 x 60 x 180 mm: motor housing along x, chuck in front, tilted grip, battery below."""
    housing = RevolvedProfile(
        ((0.0, -0.075), (0.026, -0.075), (0.030, -0.070), (0.030, 0.030), (0.024, 0.050), (0.0, 0.050)),
        origin=(0.0, 0.0, 0.150),
        axis="x",
    )
    chuck = RevolvedProfile(
        ((0.0, 0.045), (0.019, 0.045), (0.019, 0.080), (0.010, 0.100), (0.006, 0.115), (0.0, 0.115)),
        origin=(0.0, 0.0, 0.150),
        axis="x",
    )
    grip = RoundedBox((-0.028, 0.0, 0.083), (0.021, 0.0165, 0.070), 0.012, tilt=0.20)
    battery = RoundedBox((-0.030, 0.0, 0.020), (0.045, 0.030, 0.020), 0.006)
    return housing, chuck, grip, battery


_BUILDERS.update(mug=(_mug, 2300.0), bottle=(_bottle, 1000.0), glass=(_glass, 2500.0), drill=(_drill, 1100.0))

#: Names of the shipped objects.
OBJECTS: Final[tuple[str, ...]] = tuple(_BUILDERS)


@cache
def shipped_object(name: str) -> GraspObject:
    """Return the shipped object of that name: mug, bottle, glass or drill.

    Raises
    ------
    InputError
        If no object of that name is shipped.
    """
    if name not in _BUILDERS:
        raise unknown_name("object", name, OBJECTS)
    build, density = _BUILDERS[name]
    solids = build()
    vertices, faces, volume, center = triangles(solids)
    return GraspObject(name, vertices, faces, density * volume, center, solids=solids)

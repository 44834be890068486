"""Poses of the hand: rigid transforms, the 24 named default poses, and offsets from them.

    p    position of the palm frame in the object's frame, m       q    its rotation, unit quaternion, w first
    c    center of the object's box; e its half extents, m         n    outward normal of the facet that the palm faces

Default pose of the mode "facet-thumb": the palm's z points at the facet (against n), its x points away from the facet
named second, so that the opposed thumb comes to press on that one; the hand's grasp center lies on the line through c
along n, its distance from c given by the standoff.
Offsets: dx, dy, dz along the palm's own default axes (dz towards the object), then the turns rx, ry, rz about the
grasp center, R = R_default Rx Ry Rz.
"""

from dataclasses import dataclass
from math import inf, isfinite, sqrt
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.model import Hand
from surehold.grasping.object.model import GraspObject

__all__ = ["FACETS", "FARTHEST", "MODES", "Pose", "check_pose", "check_rotations", "default_pose"]

Array = NDArray[np.float64]
_EYE: Final = np.eye(3)
_LEAST: Final = 1e-200  # squared length of a quaternion, below which rounding spoils its direction
FARTHEST: Final = 1e9  #: largest coordinate of a pose [m]: beyond, rounding is as large as what a touch is found to

_NORMALS: Final = {
    "right": (1.0, 0.0, 0.0),
    "front": (0.0, 1.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "back": (0.0, -1.0, 0.0),
    "top": (0.0, 0.0, 1.0),
    "bottom": (0.0, 0.0, -1.0),
}
FACETS: Final = tuple(_NORMALS)
#: The 24 named modes, "facet-thumb".
MODES: Final = tuple(f"{a}-{b}" for a, n in _NORMALS.items() for b, m in _NORMALS.items() if np.dot(n, m) == 0.0)


@dataclass(frozen=True)
class Pose:
    """A rigid motion x -> R x + p, such as from the palm frame to the object's frame."""

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: p [m]
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  #: unit quaternion of R, w first

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> "Pose":
        """Return the pose of a matrix (3, 4) or (4, 4) of rotation and position [m].

        Raises
        ------
        InputError
            If the matrix has another shape, is not finite, or its 3 x 3 part is no rotation.
        """
        m = np.asarray(matrix, dtype=np.float64)
        if m.shape not in ((3, 4), (4, 4)) or not np.all(np.isfinite(m)):
            raise InputError(f"pose matrix of shape {m.shape} is not (3, 4) or (4, 4) of finite numbers.")
        check_rotations(m[:3, :3])
        return _pose(m[:3, :3], m[:3, 3])

    @property
    def is_finite(self) -> bool:
        """Whether position and rotation are finite: a quaternion without length has no rotation."""
        return all(map(isfinite, self.position)) and _LEAST < self._squared < inf

    @property
    def rotation(self) -> Array:
        """R (3, 3)."""
        w, x, y, z = map(float, self.quaternion)
        if not _LEAST < self._squared < inf:
            return np.full((3, 3), np.nan)
        length = sqrt(self._squared)
        w, x, y, z = w / length, x / length, y / length, z / length
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def _squared(self) -> float:
        w, x, y, z = map(float, self.quaternion)
        return w * w + x * x + y * y + z * z

    @property
    def matrix(self) -> Array:
        """R and p side by side, (3, 4)."""
        return np.column_stack([self.rotation, np.asarray(self.position)])

    def __matmul__(self, other: "Pose") -> "Pose":
        """Return the pose that first applies `other`, then this one."""
        r = self.rotation
        return _pose(r @ other.rotation, r @ np.asarray(other.position) + np.asarray(self.position))

    def inverse(self) -> "Pose":
        """Return the pose that undoes this one."""
        r = self.rotation.T
        return _pose(r, -r @ np.asarray(self.position))

    def apply(self, points: ArrayLike) -> Array:
        """Return R x + p for points (..., 3) [m]."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + np.asarray(self.position)


def _pose(rotation: Array, position: Array) -> Pose:
    """Return the pose of a rotation (3, 3), which is one, and a position (3,)."""
    # Bar-Itzhack 2000: the quaternion is the eigenvector of the largest eigenvalue; exact for an exact rotation.
    r, (x, y, z) = rotation, position.tolist()
    k = np.empty((4, 4))
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    if not isfinite(trace):
        raise InputError("a pose's quaternion is zero or not finite; give one of length 1, such as (1, 0, 0, 0).")
    k[0, 0] = trace
    k[0, 1:] = k[1:, 0] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    k[1:, 1:] = r + r.T - trace * _EYE
    a, b, c, d = np.linalg.eigh(k / 3.0)[1][:, -1].tolist()
    first = next(v for v in (a, b, c, d) if abs(v) > 1e-12)
    q = (-a, -b, -c, -d) if first < 0.0 else (a, b, c, d)  # of the two signs, that with w > 0
    return Pose((x, y, z), q)


def _turn(axis: int, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    r = np.eye(3)
    r[i, i] = r[j, j] = c
    r[i, j], r[j, i] = -s, s
    return r


def facet_axes(mode: str) -> Array:
    """Return the palm's axes as columns (3, 3) in the frame of the object's box for a mode such as "right-front".

    Raises
    ------
    InputError
        If the facet is unknown or the thumb's facet is not one of its four neighbors.
    """
    facet, dash, thumb = str(mode).partition("-")
    if facet not in _NORMALS:
        raise unknown_name("facet", facet, FACETS)
    if not dash or mode not in MODES:
        neighbors = [m for m in MODES if m.startswith(f"{facet}-")]
        raise unknown_name("facet and thumb direction", mode, neighbors)
    z, x = -np.array(_NORMALS[facet]), -np.array(_NORMALS[thumb])
    return np.column_stack([x, np.cross(z, x), z])


def check_pose(pose: Pose, name: str = "pose") -> None:
    """Raise InputError unless compiled code can take a pose: what is not finite it would read and write anywhere."""
    if not pose.is_finite:
        raise InputError(
            f"{name} {pose} is not finite, or its quaternion has no length; give finite numbers and a quaternion of "
            "length 1, such as (1, 0, 0, 0)."
        )
    if max(map(abs, pose.position)) > FARTHEST:
        raise InputError(f"{name} {pose} is more than {FARTHEST:g} m away; give its position in meters.")


def check_rotations(matrices: Array) -> None:
    """Raise InputError unless all matrices (..., 3, 3) are rotations."""
    squared = matrices @ np.swapaxes(matrices, -1, -2)
    if not (np.allclose(squared, np.eye(3), atol=1e-6) and np.all(np.linalg.det(matrices) > 0.0)):
        raise InputError("the 3 x 3 part of the pose matrix is no rotation; its columns must be right-handed axes.")


def default_pose(
    hand: Hand, obj: GraspObject, mode: str, standoff: float, offsets: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
) -> Pose:
    """Return the pose of the palm in the object's frame for a mode, with offsets from its default.

    Parameters
    ----------
    hand, obj
        The hand and the object.
    mode
        One of the 24 `MODES`, such as "right-front".
    standoff
        Distance of the grasp center from the center of the object's box, along the facet's normal [m].
    offsets
        dx, dy, dz [m] and rx, ry, rz [rad].

    Raises
    ------
    InputError
        If the mode is unknown or a number is not finite.
    """
    axes = obj.axes @ facet_axes(mode)
    d = np.asarray(offsets, dtype=np.float64)
    if d.shape != (6,) or not np.all(np.isfinite(d)) or not np.isfinite(standoff):
        raise InputError(f"pose offsets are {offsets!r} at standoff {standoff!r}; give six finite numbers and one.")
    center = obj.box_center - standoff * axes[:, 2] + axes @ d[:3]
    rotation = axes @ _turn(0, d[3]) @ _turn(1, d[4]) @ _turn(2, d[5])
    return _pose(rotation, center - rotation @ hand.grasp_center)

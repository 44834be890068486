"""One grasp as the file formats know it, and the content of a file of grasps.

The gripper frame is the frame of the gripper that `position` and `orientation` place; a file may name it. Formats
without names mean the root frame: that of the gripper's model file.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from surehold.errors import InputError
from surehold.grasping.poses import Pose

__all__ = [
    "GraspFile",
    "StoredGrasp",
    "checked_file",
    "checked_grasp",
    "number",
    "numbers",
    "options_of",
    "unit_quaternion",
]


@dataclass(frozen=True)
class StoredGrasp:
    """One grasp of a file."""

    name: str
    """Unique in its file."""
    confidence: float
    """In [0, 1]; tools leave out grasps of confidence 0."""
    position: tuple[float, float, float]
    """Origin of the gripper frame in the object frame [m]."""
    orientation: tuple[float, float, float, float]
    """Unit quaternion (w, x, y, z) that turns the object frame into the gripper frame."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Joint positions of the closed hand by name [rad, or m for sliding joints]."""
    pregrasp_joints: Mapping[str, float] = field(default_factory=dict)
    """Joint positions of the open hand."""
    squeeze_joints: Mapping[str, float] = field(default_factory=dict)
    """Targets of the joints of the hand that squeezes; formats that do not know them leave them out."""
    posture: float | tuple[float, ...] = 0.0
    """The posture variable s1 with which surehold closed the hand [rad], or the amplitudes s1, s2, .. of a synergy."""
    quality: float | None = None
    """What surehold rated the grasp; None if it did not."""

    @property
    def pose(self) -> Pose:
        """From the gripper frame to the object frame."""
        return Pose(self.position, self.orientation)


@dataclass(frozen=True)
class GraspFile:
    """The content of a file of grasps."""

    object_frame: str
    """Name of the object's frame, for human readers."""
    gripper_frame: str
    """Name of the gripper's frame, for human readers; "" where the format means the root frame."""
    grasps: tuple[StoredGrasp, ...]
    """In the order of the file."""
    object_file: str = ""
    """The object's mesh: a path relative to the folder of the file of grasps."""
    object_scale: float = 1.0
    """By which the coordinates of the mesh are multiplied to get meters."""
    gripper_file: str = ""
    """The gripper's model."""
    finger_colliders: tuple[str, ...] = ()
    """Names of the bodies of the gripper that touch the object."""
    open_limit: str = ""
    """Which end of its range is the first closing joint's place in the open hand: "lower" or "upper"."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """What surehold closed the hand with, by the names of the options of a grasp; empty in files of others."""


def checked_file(file: GraspFile) -> GraspFile:
    """Return the content of a file with plain floats.

    Raises
    ------
    InputError
        If a grasp is not usable (name twice, not finite, quaternion not of length 1, confidence outside [0, 1]).
    """
    grasps = tuple(checked_grasp(grasp, f"grasp {grasp.name!r}") for grasp in file.grasps)
    names = set()
    for grasp in grasps:
        if grasp.name in names:
            raise InputError(f"grasp name {grasp.name!r} is given twice; names must be unique in a file.")
        names.add(grasp.name)
    scale = number(file.object_scale, "object_scale")
    if not scale > 0.0:
        raise InputError(f"object_scale is {scale}; give a positive number, such as 0.001 for a mesh in millimeters.")
    return replace(file, grasps=grasps, object_scale=scale)


def checked_grasp(grasp: StoredGrasp, place: str) -> StoredGrasp:
    """Return the grasp with plain floats, or raise InputError that names the `place`."""
    confidence = number(grasp.confidence, f"{place}: confidence")
    if not 0.0 <= confidence <= 1.0:
        raise InputError(f"{place}: confidence must be in [0, 1], not {confidence}.")
    x, y, z = numbers(grasp.position, 3, f"{place}: position")
    w, i, j, k = unit_quaternion(grasp.orientation, f"{place}: orientation")
    joints = []
    for values in (grasp.joints, grasp.pregrasp_joints, grasp.squeeze_joints):
        if not isinstance(values, Mapping):
            raise InputError(f"{place}: joint positions must map joint names to numbers, not be {_shown(values)}.")
        joints.append({str(k): number(v, f"{place}: joint {k!r}") for k, v in values.items()})
    return StoredGrasp(
        str(grasp.name),
        confidence,
        (x, y, z),
        (w, i, j, k),
        *joints,
        posture=_posture(grasp.posture, f"{place}: posture"),
        quality=None if grasp.quality is None else number(grasp.quality, f"{place}: quality"),
    )


def options_of(content: Mapping[str, Any], place: str) -> dict[str, Any]:
    """Return the options that a file's `surehold` holds, none where it has none; InputError that names the `place`."""
    settings = content.get("surehold") or {}
    if not isinstance(settings, dict):
        raise InputError(f"{place}: surehold must be a mapping of options, not {_shown(settings)}; leave it out.")
    return {str(name): value for name, value in settings.items()}


def _posture(value: Any, place: str) -> float | tuple[float, ...]:
    if isinstance(value, (list, tuple)) and 0 < len(value) <= 4:
        return numbers(value, len(value), place)
    return number(value, place)


def unit_quaternion(values: Any, place: str) -> tuple[float, ...]:
    """Return four floats, a quaternion of length 1, or raise InputError that names the `place`."""
    quaternion = numbers(values, 4, place)
    length = float(np.sqrt(sum(x * x for x in quaternion)))
    if abs(length - 1.0) > 1e-3:  # files round to five digits
        raise InputError(f"{place} must be a quaternion of length 1, not {length:.4g}.")
    return quaternion


def numbers(values: Any, n: int, place: str) -> tuple[float, ...]:
    """Return n finite floats or raise InputError that names the `place`."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, (list, tuple)) or len(values) != n:
        raise InputError(f"{place} must hold {n} numbers, not {_shown(values)}.")
    return tuple(number(value, place) for value in values)


def number(value: Any, place: str) -> float:
    """Return a finite float or raise InputError that names the `place`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{place} must be a number, not {_shown(value)}.")
    try:
        plain = float(value)
    except OverflowError:
        plain = np.inf
    if not np.isfinite(plain):
        raise InputError(f"{place} must be finite, not {_shown(value)}.")
    return plain


def _shown(value: Any) -> str:
    if isinstance(value, (list, tuple, dict, set)):
        return f"a {type(value).__name__} of {len(value)}"
    try:
        return repr(value)[:60]
    except ValueError:  # an integer of thousands of digits
        return f"so large a {type(value).__name__}"

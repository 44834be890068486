"""The grasp files of GraspGen (JSON): poses of a gripper's root frame, and whether the object is then in the gripper.

    {"object": {"file": mesh, "scale": number}, "grasps": {"transforms": [4 x 4, ..], "object_in_gripper": [bool, ..]}}

A transform is from the gripper's root frame to the object's frame [m]. GraspGen's gripper approaches along z and closes
along x; a root frame that differs is said in its configuration of the gripper. Joints are not stored. `names`,
`confidences` and `postures`, and `surehold` with the options that the hand was closed with, which its reader ignores,
are written beside them and read where they are there.
"""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.grasping.formats.stored import (
    GraspFile,
    StoredGrasp,
    checked_file,
    checked_grasp,
    number,
    numbers,
    options_of,
)
from surehold.grasping.plain_data import grasp_to_dict, regular_bytes
from surehold.grasping.poses import Pose

__all__ = ["graspgen_file", "read_graspgen_grasps", "write_graspgen_file"]

_ROUNDING: Final = 1e-3  #: of a transform, as of quaternions in files


def write_graspgen_file(path: str | Path, file: GraspFile) -> None:
    """Write grasps, whose gripper frame is the root frame, as a GraspGen file; confidence above 0 is success.

    Raises InputError if a grasp is not usable or the file cannot be written; then nothing is written.
    """
    from surehold.store.atomic import write_file

    checked = checked_file(file)
    content: dict[str, Any] = {
        "object": {"file": checked.object_file, "scale": checked.object_scale},
        "grasps": {
            "transforms": [np.vstack([g.pose.matrix, [0.0, 0.0, 0.0, 1.0]]).tolist() for g in checked.grasps],
            "object_in_gripper": [g.confidence > 0.0 for g in checked.grasps],
            "names": [g.name for g in checked.grasps],
            "confidences": [g.confidence for g in checked.grasps],
            "postures": [g.posture for g in checked.grasps],
        },
    }
    if checked.settings:
        content["surehold"] = grasp_to_dict(checked.settings)
    write_file(Path(path), json.dumps(content, allow_nan=False) + "\n")


def read_graspgen_grasps(path: str | Path) -> GraspFile:
    """Read a GraspGen file; InputError, naming the place, if it cannot be read or is none."""
    where = str(path)
    try:
        content = json.loads(regular_bytes(path).decode("utf-8"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{where!r} is not JSON: {' '.join(str(error).split())[:120]}.") from None
    return graspgen_file(where, content)


def graspgen_file(where: str, content: Any) -> GraspFile:
    """Return the grasps of a file's content; `where` is what errors call the file."""
    parts = [content.get(key) if isinstance(content, dict) else None for key in ("object", "grasps")]
    obj, grasps = (part if isinstance(part, dict) else {} for part in parts)
    transforms, success = grasps.get("transforms"), grasps.get("object_in_gripper")
    if not isinstance(transforms, list) or not isinstance(success, list) or len(success) != len(transforms):
        raise InputError(
            f"{where!r} is not a GraspGen file; it must hold grasps.transforms and as many grasps.object_in_gripper."
        )
    n = len(transforms)
    names = _beside(grasps, "names", n, where) or [f"grasp_{i}" for i in range(n)]
    confidences = _beside(grasps, "confidences", n, where)
    confidences = confidences or [_success(good, i, where) for i, good in enumerate(success)]
    postures = _beside(grasps, "postures", n, where) or [0.0] * n
    stored = []
    for name, confidence, transform, s1 in zip(names, confidences, transforms, postures, strict=True):
        place = f"{where!r}, grasp {str(name)[:60]!r}"
        pose = _pose(transform, place)
        one = StoredGrasp(str(name), confidence, pose.position, pose.quaternion, posture=s1)
        stored.append(checked_grasp(one, place))
    file, scale = obj.get("file") or "", obj.get("scale", 1.0)
    if not isinstance(file, str):
        raise InputError(f"{where!r}: object.file must be a text, not {type(file).__name__}.")
    return checked_file(
        GraspFile(
            Path(file).stem,
            "",
            tuple(stored),
            object_file=file,
            object_scale=number(1.0 if scale is None else scale, f"{where!r}: object.scale"),
            settings=options_of(content, repr(where)),
        )
    )


def _beside(grasps: dict[str, Any], key: str, n: int, where: str) -> list[Any]:
    """Return what stands beside the transforms, an empty list where nothing does."""
    found = grasps.get(key)
    if found is not None and (not isinstance(found, list) or len(found) != n):
        there = f"holds {len(found)}" if isinstance(found, list) else f"is {type(found).__name__}"
        raise InputError(
            f"{where!r}: grasps.{key} {there}; give a list of {n}, one for each transform, or leave it out."
        )
    return found or []


def _success(good: Any, number: int, where: str) -> float:
    if good is not True and good is not False and good not in (0, 1):
        raise InputError(f"{where!r}: object_in_gripper of grasp {number} is {str(good)[:40]!r}; give true or false.")
    return float(good)


def _pose(transform: Any, place: str) -> Pose:
    """Return the pose of a transform; files round it, so that its rotation is one to some digits only."""
    if not isinstance(transform, list) or len(transform) not in (3, 4):
        raise InputError(f"{place}: its transform must be a matrix of 4 x 4 numbers.")
    matrix = np.array([numbers(row, 4, f"{place}: a row of its transform") for row in transform])
    if np.any(np.abs(matrix[3:] - [0.0, 0.0, 0.0, 1.0]) > _ROUNDING):
        last = ", ".join(f"{value:g}" for value in matrix[3])
        raise InputError(
            f"{place}: the last row of its transform is {last}; it must be 0, 0, 0, 1, and the position stand in the "
            "last column: is the matrix transposed?"
        )
    left, stretch, right = np.linalg.svd(matrix[:3, :3])
    if np.any(np.abs(stretch - 1.0) > _ROUNDING) or np.linalg.det(matrix[:3, :3]) < 0.0:
        raise InputError(
            f"{place}: the 3 x 3 part of its transform is no rotation; its columns must be right-handed axes of "
            "length 1."
        )
    return Pose.from_matrix(np.column_stack([left @ right, matrix[:3, 3]]))

"""The Isaac grasp format (YAML, `isaac_grasp` version 1.0), with what GraspDataGen and surehold say beside it.

A mapping of `format`, `format_version`, `object_frame`, `gripper_frame` (names for human readers) and `grasps`: name ->
`confidence` in [0, 1], `position` of the gripper frame in the object frame [m], `orientation` `{w, xyz}`,
`cspace_position` (joint -> value [rad or m] of the closed hand) and `pregrasp_cspace_position` (open hand). The version
is written as a number: Isaac Sim calculates with it; GraspDataGen, which writes the text "1.0", does not read it.
GraspDataGen also reads `object_file`, `object_scale`, `gripper_file`, `finger_colliders` and `open_limit`. `surehold`
holds the options that the hand was closed with, and `quality` and `posture` of a grasp what it was rated and its s1.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import yaml

from surehold.errors import InputError
from surehold.grasping.formats.stored import GraspFile, StoredGrasp, checked_file, checked_grasp, number, options_of
from surehold.grasping.plain_data import grasp_to_dict, plain_yaml

__all__ = ["isaac_file", "read_isaac_grasps", "write_isaac_file", "write_isaac_grasps"]

FORMAT: Final = "isaac_grasp"
VERSION: Final = 1.0


def write_isaac_grasps(path: str | Path, grasps: Iterable[StoredGrasp], object_frame: str, gripper_frame: str) -> None:
    """Write grasps as an Isaac grasp file, numbers in full precision.

    Raises InputError if a grasp is not usable (name twice, not finite, quaternion not of length 1, confidence outside
    [0, 1]) or the file cannot be written; then nothing is written.
    """
    write_isaac_file(path, GraspFile(object_frame, gripper_frame, tuple(grasps)))


def write_isaac_file(path: str | Path, file: GraspFile) -> None:
    """Write a file of grasps with all that it says of object and gripper; errors as in `write_isaac_grasps`."""
    from surehold.store.atomic import write_file

    checked = checked_file(file)
    entries: dict[str, dict[str, Any]] = {}
    for grasp in checked.grasps:
        w, *xyz = grasp.orientation
        entries[grasp.name] = {
            "confidence": grasp.confidence,
            "position": list(grasp.position),
            "orientation": {"w": w, "xyz": xyz},
            "cspace_position": dict(grasp.joints),
            "pregrasp_cspace_position": dict(grasp.pregrasp_joints),
        }
        if grasp.quality is not None:
            entries[grasp.name] |= {"quality": grasp.quality, "posture": grasp_to_dict(grasp.posture)}
    content: dict[str, Any] = {
        "format": FORMAT,
        "format_version": VERSION,
        "object_frame": checked.object_frame,
        "gripper_frame": checked.gripper_frame,
    }
    if checked.object_file:
        content |= {"object_file": checked.object_file, "object_scale": checked.object_scale}
    if checked.gripper_file:
        content["gripper_file"] = checked.gripper_file
    if checked.finger_colliders:
        content["finger_colliders"] = list(checked.finger_colliders)
    if checked.open_limit:
        content["open_limit"] = checked.open_limit
    if checked.settings:
        content["surehold"] = grasp_to_dict(checked.settings)
    content["grasps"] = entries
    text = yaml.dump(content, Dumper=_Dumper, sort_keys=False, default_flow_style=None, allow_unicode=True, width=1000)
    write_file(Path(path), text)


class _Dumper(yaml.SafeDumper):
    """YAML without anchors, which readers of data only do not take."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def read_isaac_grasps(path: str | Path) -> GraspFile:
    """Read an Isaac grasp file. Joints may be missing; unknown extra keys are ignored.

    Raises InputError, naming the place, if the file cannot be read or is not an `isaac_grasp` of version 1.0.
    """
    return isaac_file(str(path), plain_yaml(path))


def isaac_file(where: str, content: Any) -> GraspFile:
    """Return the grasps of a file's content; `where` is what errors call the file."""
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{where!r} is not an Isaac grasp file; its first line must be 'format: {FORMAT}'.")
    version = content.get("format_version")
    if str(version)[:20] not in ("1", "1.0"):
        raise InputError(f"{where!r} has format_version {str(version)[:20]!r}; version 1.0 is supported.")
    entries = content.get("grasps")
    if not isinstance(entries, dict):
        raise InputError(f"{where!r}: 'grasps' must map names to grasps, not be {type(entries).__name__}.")
    grasps = [_grasp(str(name), entry, f"{where!r}, grasp {str(name)!r}") for name, entry in entries.items()]
    # Isaac Sim of 2025 writes the keys with _link
    frames = [
        str(content.get(f"{kind}_frame", content.get(f"{kind}_frame_link", ""))) for kind in ("object", "gripper")
    ]
    colliders = content.get("finger_colliders") or []
    if not isinstance(colliders, list):
        raise InputError(f"{where!r}: finger_colliders must be a list of names; leave it out.")
    scale = content.get("object_scale", 1.0)
    return checked_file(
        GraspFile(
            frames[0],
            frames[1],
            tuple(grasps),
            object_file=_text(content, "object_file", where),
            object_scale=number(1.0 if scale is None else scale, f"{where!r}: object_scale"),
            gripper_file=_text(content, "gripper_file", where),
            finger_colliders=tuple(str(name) for name in colliders),
            open_limit=_text(content, "open_limit", where),
            settings=options_of(content, repr(where)),
        )
    )


def _grasp(name: str, entry: Any, place: str) -> StoredGrasp:
    if not isinstance(entry, dict):
        raise InputError(f"{place} must be a mapping, not {type(entry).__name__}.")
    for key in ("position", "orientation"):
        if key not in entry:
            raise InputError(f"{place} has no {key!r}; a grasp needs position and orientation.")
    orientation = entry["orientation"]
    if not isinstance(orientation, dict) or not isinstance(orientation.get("xyz"), list) or "w" not in orientation:
        raise InputError(f"{place}: orientation must be {{w: number, xyz: [3 numbers]}}, not {str(orientation)[:60]}.")
    stored = StoredGrasp(
        name,
        entry.get("confidence", 1.0),  # a grasp without one counts as good where these files are read
        entry["position"],
        (orientation["w"], *orientation["xyz"]),  # type: ignore[arg-type]  # lengths are checked below
        entry.get("cspace_position") or {},
        entry.get("pregrasp_cspace_position") or {},
        posture=entry.get("posture", 0.0),
        quality=entry.get("quality"),
    )
    return checked_grasp(stored, place)


def _text(content: dict[str, Any], key: str, where: str) -> str:
    value = content.get(key)
    if value is not None and not isinstance(value, str):
        raise InputError(f"{where!r}: {key} must be a text, not {type(value).__name__}.")
    return value or ""

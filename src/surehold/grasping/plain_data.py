"""Grasps in files: the Isaac grasp format (YAML, `isaac_grasp` version 1.0), and plain dictionaries for JSON.

An Isaac grasp file is a mapping of `format`, `format_version`, `object_frame`, `gripper_frame` (names for human
readers) and `grasps`: name -> `confidence` in [0, 1], `position` of the gripper frame in the object frame [m],
`orientation` `{w, xyz}`, `cspace_position` (joint -> value [rad or m] of the closed hand) and
`pregrasp_cspace_position` (open hand). Files are data only: nothing in them is executed, fetched or expanded.
"""

import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from surehold.errors import InputError

__all__ = ["GraspFile", "StoredGrasp", "grasp_to_dict", "plain_yaml", "read_isaac_grasps", "write_isaac_grasps"]

FORMAT = "isaac_grasp"
VERSION = 1.0
MAX_BYTES = 64 * 2**20


@dataclass(frozen=True)
class StoredGrasp:
    """One grasp of an Isaac grasp file."""

    name: str
    """Unique in its file."""
    confidence: float
    """In [0, 1]."""
    position: tuple[float, float, float]
    """Origin of the gripper frame in the object frame [m]."""
    orientation: tuple[float, float, float, float]
    """Unit quaternion (w, x, y, z) that turns the object frame into the gripper frame."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Joint positions of the closed hand [rad, or m for sliding joints]."""
    pregrasp_joints: Mapping[str, float] = field(default_factory=dict)
    """Joint positions of the open hand."""


@dataclass(frozen=True)
class GraspFile:
    """The content of an Isaac grasp file."""

    object_frame: str
    """Name of the object's frame, for human readers."""
    gripper_frame: str
    """Name of the gripper's frame, for human readers."""
    grasps: tuple[StoredGrasp, ...]
    """In the order of the file."""


def write_isaac_grasps(path: str | Path, grasps: Iterable[StoredGrasp], object_frame: str, gripper_frame: str) -> None:
    """Write grasps as an Isaac grasp file, numbers in full precision.

    Raises InputError if a grasp is not usable (name twice, not finite, quaternion not of length 1, confidence outside
    [0, 1]) or the file cannot be written; then nothing is written.
    """
    entries: dict[str, dict[str, Any]] = {}
    for grasp in grasps:
        checked = _checked(grasp, f"grasp {grasp.name!r}")
        if checked.name in entries:
            raise InputError(f"grasp name {checked.name!r} is given twice; names must be unique in a file.")
        w, *xyz = checked.orientation
        entries[checked.name] = {
            "confidence": checked.confidence,
            "position": list(checked.position),
            "orientation": {"w": w, "xyz": xyz},
            "cspace_position": dict(checked.joints),
            "pregrasp_cspace_position": dict(checked.pregrasp_joints),
        }
    content = {
        "format": FORMAT,
        "format_version": VERSION,
        "object_frame": str(object_frame),
        "gripper_frame": str(gripper_frame),
        "grasps": entries,
    }
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, allow_unicode=True, width=1000)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {str(path)!r}: {error.strerror}; choose a folder you may write to.") from None


def read_isaac_grasps(path: str | Path) -> GraspFile:
    """Read an Isaac grasp file. Joints may be missing; unknown extra keys are ignored.

    Raises InputError, naming the place, if the file cannot be read or is not an `isaac_grasp` of version 1.0.
    """
    where = str(path)
    content = plain_yaml(path)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{where!r} is not an Isaac grasp file; its first line must be 'format: {FORMAT}'.")
    version = content.get("format_version")
    if str(version) not in ("1", "1.0"):
        raise InputError(f"{where!r} has format_version {version!r}; version 1.0 is supported.")
    entries = content.get("grasps")
    if not isinstance(entries, dict):
        raise InputError(f"{where!r}: 'grasps' must map names to grasps, not be {type(entries).__name__}.")
    grasps = []
    for name, entry in entries.items():
        place = f"{where!r}, grasp {str(name)!r}"
        if not isinstance(entry, dict):
            raise InputError(f"{place} must be a mapping, not {type(entry).__name__}.")
        for key in ("confidence", "position", "orientation"):
            if key not in entry:
                raise InputError(f"{place} has no {key!r}; a grasp needs confidence, position and orientation.")
        orientation = entry["orientation"]
        if not isinstance(orientation, dict) or not isinstance(orientation.get("xyz"), list) or "w" not in orientation:
            raise InputError(f"{place}: orientation must be {{w: number, xyz: [3 numbers]}}, not {orientation!r}.")
        stored = StoredGrasp(
            str(name),
            entry["confidence"],
            entry["position"],
            (orientation["w"], *orientation["xyz"]),  # type: ignore[arg-type]  # lengths are checked below
            entry.get("cspace_position") or {},
            entry.get("pregrasp_cspace_position") or {},
        )
        grasps.append(_checked(stored, place))
    # Isaac Sim writes the keys with _link, Isaac ROS without
    frames = [
        str(content.get(f"{kind}_frame", content.get(f"{kind}_frame_link", ""))) for kind in ("object", "gripper")
    ]
    return GraspFile(frames[0], frames[1], tuple(grasps))


def plain_yaml(path: str | Path) -> Any:
    """Return the content of a YAML file that holds data only: no tags, no aliases, no key twice, at most 64 MB.

    Raises InputError if the file cannot be read or is anything else.
    """
    where = str(path)
    try:
        status = Path(path).stat()
        if not stat.S_ISREG(status.st_mode):  # reading a pipe or a device might never end
            raise InputError(f"{where!r} is no regular file; give a YAML file on disk.")
        if status.st_size > MAX_BYTES:
            raise InputError(f"{where!r} is larger than {MAX_BYTES // 2**20} MB; split it into several files.")
        return yaml.load(Path(path).read_text(encoding="utf-8"), Loader=_PlainLoader)
    except OSError as error:
        raise InputError(f"cannot read {where!r}: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise InputError(f"{where!r} is not a text file in UTF-8; give a YAML file.") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{where!r} is not plain YAML: {' '.join(str(error).split())}") from None


def grasp_to_dict(value: object) -> Any:
    """Return a grasp, or anything made of dataclasses, named tuples, arrays, mappings and numbers, as plain JSON data.

    Arrays become nested lists, numbers that are not finite become None (JSON has no NaN). Dataclass fields whose
    metadata say `derived` are left out: they follow from the others. Raises InputError for a value that has no plain
    form.
    """
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.ndarray):
        return grasp_to_dict(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: grasp_to_dict(getattr(value, f.name)) for f in fields(value) if not f.metadata.get("derived")}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {k: grasp_to_dict(v) for k, v in value._asdict().items()}  # type: ignore[attr-defined]
    if isinstance(value, Mapping):
        return {str(k): grasp_to_dict(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [grasp_to_dict(v) for v in value]
    if isinstance(value, Path):
        return str(value)
    raise InputError(f"a {type(value).__name__} has no form in JSON; give numbers, arrays, mappings, records.")


class _PlainLoader(yaml.SafeLoader):
    """YAML without anchors and aliases, which can expand a small file without bound, and without keys given twice."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError(f"aliases (*name) are not supported{self.peek_event().start_mark}")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict:
        mapping = super().construct_mapping(node, deep=deep)
        if len(mapping) != len(node.value):
            names = [key.value for key, _ in node.value]
            twice = next((name for name in names if names.count(name) > 1), names[0])
            raise yaml.YAMLError(f"key {twice!r} is given twice{node.start_mark}")
        return mapping


def _checked(grasp: StoredGrasp, place: str) -> StoredGrasp:
    """Return the grasp with plain floats, or raise InputError."""
    confidence = _number(grasp.confidence, f"{place}: confidence")
    if not 0.0 <= confidence <= 1.0:
        raise InputError(f"{place}: confidence must be in [0, 1], not {confidence}.")
    position = _numbers(grasp.position, 3, f"{place}: position")
    orientation = _numbers(grasp.orientation, 4, f"{place}: orientation")
    length = float(np.sqrt(sum(x * x for x in orientation)))
    if abs(length - 1.0) > 1e-3:  # files round to five digits
        raise InputError(f"{place}: orientation must be a quaternion of length 1, not {length:.4g}.")
    joints = []
    for values in (grasp.joints, grasp.pregrasp_joints):
        if not isinstance(values, Mapping):
            raise InputError(f"{place}: joint positions must map joint names to numbers, not be {values!r}.")
        joints.append({str(k): _number(v, f"{place}: joint {k!r}") for k, v in values.items()})
    x, y, z = position
    w, i, j, k = orientation
    return StoredGrasp(str(grasp.name), confidence, (x, y, z), (w, i, j, k), joints[0], joints[1])


def _numbers(values: Any, n: int, place: str) -> tuple[float, ...]:
    """Return n finite floats or raise InputError."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, (list, tuple)) or len(values) != n:
        raise InputError(f"{place} must hold {n} numbers, not {values!r}.")
    return tuple(_number(value, place) for value in values)


def _number(value: Any, place: str) -> float:
    """Return a finite float or raise InputError."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{place} must be a number, not {value!r}.")
    if not np.isfinite(float(value)):
        raise InputError(f"{place} must be finite, not {value!r}.")
    return float(value)

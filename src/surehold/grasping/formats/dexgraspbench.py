"""The grasp files of DexGraspBench: one pickled NumPy dictionary a grasp, read without unpickling what it may not hold.

    obj_path            folder of the object: mesh/simplified.obj, urdf/meshes/convex_piece_*.obj, info/simplified.json
    obj_scale           by which its meshes are multiplied
    obj_pose            (7,) of the object: position [m] and unit quaternion, w first
    pregrasp_qpos       (7 + joints,): pose of the hand's root frame, and its joints in the order of its model
    grasp_qpos          the same, closed
    squeeze_qpos        the same, targets of the squeeze

What surehold writes has the object's frame as the world and holds `joint_names`, `confidence`, `quality` and `posture`
beside, and `surehold` with the options that the hand was closed with, which the benchmark ignores.

NumPy stores a dictionary as a pickle, and a pickle can run anything when it is loaded. Here only those are loaded that
consist of the few operations that numbers, texts, lists, dictionaries and arrays of numbers need, and the places of
NumPy's functions are taken by functions of this file, so that nothing else can be called.
"""

import io
import pickle
import pickletools
from collections.abc import Sequence
from itertools import chain, count
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
    unit_quaternion,
)
from surehold.grasping.plain_data import grasp_to_dict, regular_bytes
from surehold.grasping.poses import Pose

__all__ = ["read_dexgraspbench_grasps", "write_dexgraspbench_files"]

_MOST_BYTES: Final = 2**20
_MOST_FILES: Final = 100_000
_PARTS: Final = ("pregrasp_qpos", "grasp_qpos", "squeeze_qpos")


def write_dexgraspbench_files(folder: str | Path, file: GraspFile, joints: Sequence[str]) -> None:
    """Write grasps, whose gripper frame is the root frame, as NAME.npy into a folder; `joints` is the model's order.

    What a name of a file cannot hold becomes "_", and names that are then the same get numbers. Joints that a grasp
    does not name are written as 0. Raises InputError if a grasp is not usable or names a joint that is not in the
    order, or a file cannot be written.
    """
    from surehold.store.atomic import checked_folder, write_file

    checked, place = checked_file(file), checked_folder(folder)
    written = []
    for grasp in checked.grasps:
        row = {
            "obj_pose": np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
            "obj_scale": checked.object_scale,
            "obj_path": checked.object_file,
            "joint_names": list(joints),
            "confidence": grasp.confidence,
            "posture": list(grasp.posture) if isinstance(grasp.posture, tuple) else grasp.posture,
        }
        if grasp.quality is not None:
            row["quality"] = grasp.quality
        if checked.settings:
            row["surehold"] = grasp_to_dict(checked.settings)
        squeeze = grasp.squeeze_joints or grasp.joints
        for part, values in zip(_PARTS, (grasp.pregrasp_joints, grasp.joints, squeeze), strict=True):
            for name in values:
                if name not in joints:
                    raise InputError(f"grasp {grasp.name!r} has a joint {name!r} that is none of {', '.join(joints)}.")
            row[part] = np.array([*grasp.position, *grasp.orientation, *(values.get(name, 0.0) for name in joints)])
        content = io.BytesIO()
        np.save(content, np.array(row, dtype=object), allow_pickle=True)
        written.append(content.getvalue())
    for name, content in zip(_file_names([grasp.name for grasp in checked.grasps]), written, strict=True):
        write_file(place / f"{name}.npy", content)


def read_dexgraspbench_grasps(path: str | Path, joints: Sequence[str] = ()) -> GraspFile:
    """Read one .npy file, or all of a folder in the order of their names.

    `joints` are the names of the model's joints in its order, for files that do not hold `joint_names`; without them
    the joints are called by their numbers. Raises InputError, naming the place, if a file cannot be read or holds
    anything but what was said above.
    """
    place = Path(path)
    files = [place]
    if place.is_dir():
        files = sorted(place.glob("*.npy"), key=lambda file: (len(file.stem) if file.stem.isdigit() else 99, file.stem))
        if not files or len(files) > _MOST_FILES:
            inside = sorted(folder for folder in place.iterdir() if folder.is_dir() and any(folder.glob("*.npy")))
            such = f", such as {str(inside[0])!r}" if inside else ""
            raise InputError(
                f"{str(path)!r} holds {len(files):,} .npy files; give a folder of 1 to {_MOST_FILES:,}{such}."
            )
    rows = [(file, _row(file)) for file in files]
    paths = {(row.get("obj_path"), number(row.get("obj_scale", 1.0), f"{str(f)!r}: obj_scale")) for f, row in rows}
    if len(paths) > 1:
        raise InputError(f"{str(path)!r} holds grasps of {len(paths)} objects or sizes; give a folder of one.")
    settings = [options_of(row, repr(str(file))) for file, row in rows]
    if any(one != settings[0] for one in settings):
        raise InputError(f"{str(path)!r} holds grasps made with different options; give a folder of one run.")
    obj, scale = paths.pop()
    grasps = tuple(_grasp(file, row, joints) for file, row in rows)
    name = Path(obj or "").name
    return checked_file(GraspFile(name, "", grasps, object_file=obj or "", object_scale=scale, settings=settings[0]))


def _grasp(file: Path, row: dict[str, Any], joints: Sequence[str]) -> StoredGrasp:
    place = repr(str(file))
    world = numbers(row.get("obj_pose", (0, 0, 0, 1, 0, 0, 0)), 7, f"{place}: obj_pose")
    unit_quaternion(world[3:], f"{place}: the orientation of obj_pose")
    found: dict[str, tuple[Pose, dict[str, float]]] = {}
    for part in _PARTS:
        values = row.get(part)
        if part != "grasp_qpos" and values is None:
            continue
        if not isinstance(values, np.ndarray | list) or len(values) < 7:
            raise InputError(f"{place}: {part} must hold 7 numbers of the pose and those of the joints.")
        q = numbers(values, len(values), f"{place}: {part}")
        named = row.get("joint_names") or list(joints) or [str(i) for i in range(len(q) - 7)]
        if not isinstance(named, list) or len(named) != len(q) - 7 or len(set(map(str, named))) != len(named):
            count = len(named) if isinstance(named, list) else 0
            raise InputError(f"{place}: {part} holds {len(q) - 7} joints, {count} are named; give the file's hand.")
        unit_quaternion(q[3:7], f"{place}: the orientation of {part}")
        pose = Pose(world[:3], world[3:]).inverse() @ Pose(q[:3], q[3:7])  # type: ignore[arg-type]
        found[part] = pose, dict(zip(map(str, named), q[7:], strict=True))
    pose, closed = found["grasp_qpos"]
    stored = StoredGrasp(
        file.stem,
        row.get("confidence", 1.0),
        pose.position,
        pose.quaternion,
        closed,
        found.get("pregrasp_qpos", (pose, {}))[1],
        found.get("squeeze_qpos", (pose, {}))[1],
        row.get("posture", 0.0),
        row.get("quality"),
    )
    return checked_grasp(stored, place)


def _file_names(names: Sequence[str]) -> list[str]:
    """Return a file's name for each grasp, no two the same."""
    found: dict[str, None] = {}
    for name in names:
        plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)[:100] or "grasp"
        numbered = (f"{plain}_{n}" for n in count(2))
        found[next(free for free in chain([plain], numbered) if free not in found)] = None
    return list(found)


# -- dictionaries of a .npy file, without what a pickle may do ---------------------------------------------------------

_PLAIN: Final = """
    PROTO FRAME STOP MARK NONE NEWTRUE NEWFALSE BININT BININT1 BININT2 LONG1 BINFLOAT SHORT_BINBYTES BINBYTES
    SHORT_BINUNICODE BINUNICODE EMPTY_LIST APPEND APPENDS EMPTY_DICT SETITEM SETITEMS EMPTY_TUPLE TUPLE TUPLE1 TUPLE2
    TUPLE3 BINPUT BINGET LONG_BINGET MEMOIZE GLOBAL STACK_GLOBAL REDUCE BUILD
"""  # no LONG_BINPUT, which can ask for any amount of memory, no INST, OBJ, NEWOBJ, EXT or PERSID


def _row(file: Path) -> dict[str, Any]:
    """Return the dictionary of a .npy file, its arrays as NumPy arrays of numbers."""
    content = regular_bytes(file, _MOST_BYTES)
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"version {version[0]}.{version[1]} of the format is not supported")
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(stream)
        if shape != () or not dtype.hasobject:
            raise ValueError("it is an array, not a dictionary")
        data = stream.read()
        for operation, argument, _ in pickletools.genops(data):
            if operation.name not in _PLAIN.split():
                raise ValueError(f"it holds {operation.name}, which data does not need; it is not loaded")
            if operation.name == "FRAME" and isinstance(argument, int) and argument > len(data):
                raise ValueError("it is cut off")
        whole = _Reader(io.BytesIO(data)).load()
        row = _value(whole)
        row = row[0] if isinstance(row, list) and len(row) == 1 else row
        if not isinstance(row, dict) or "grasp_qpos" not in row:
            raise ValueError("it holds no grasp_qpos")
        row = {str(key): _value(value) for key, value in row.items()}
        if not isinstance(row.get("obj_path", ""), str):
            raise ValueError("its obj_path is no text")
        return row
    except InputError:
        raise
    except Exception as error:  # a damaged pickle can make the reader stumble anywhere
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(f"{str(file)!r} is no grasp of DexGraspBench: {reason}.") from None


class _Number:
    """Stands for `numpy.dtype`: kinds of plain numbers, and the objects of the outer array."""

    def __init__(self, code: str, align: bool = False, copy: bool = True):
        if code != "O8" and (code[:1] not in "fiub" or code[1:] not in "1248"):
            raise ValueError("it holds an array of a kind that is no number")
        self.code, self.order = code, "="

    def __setstate__(self, state: tuple) -> None:
        if state[1] not in ("<", ">", "|", "="):
            raise ValueError("it holds an array of an unknown byte order")
        self.order = state[1]

    @property
    def dtype(self) -> np.dtype:
        if self.code == "O8":
            raise ValueError("it holds an array of objects in a grasp")
        return np.dtype(self.code).newbyteorder(self.order if self.order != "|" else "=")  # type: ignore[arg-type]


class _Array:
    """Stands for `numpy.ndarray`."""

    value: Any = None

    def __setstate__(self, state: tuple) -> None:
        _, shape, kind, fortran, data = state
        if not isinstance(kind, _Number) or not all(isinstance(n, int) and n >= 0 for n in shape):
            raise ValueError("it holds a damaged array")
        if kind.code == "O8" and isinstance(data, list):
            self.value = data
        else:
            self.value = np.frombuffer(data, dtype=kind.dtype).reshape(shape, order="F" if fortran else "C")


def _reconstruct(kind: Any, shape: Any, code: Any) -> _Array:
    return _Array()


def _scalar(kind: Any, data: Any) -> Any:
    return np.frombuffer(data, dtype=kind.dtype)[0].item()


class _Reader(pickle.Unpickler):
    """Knows the four names that NumPy's arrays of numbers need, and hands out what stands for them."""

    def find_class(self, module: str, name: str) -> Any:
        known = {("numpy", "dtype"): _Number, ("numpy", "ndarray"): _Array}
        for core in ("numpy.core.multiarray", "numpy._core.multiarray"):
            known |= {(core, "_reconstruct"): _reconstruct, (core, "scalar"): _scalar}
        if (module, name) not in known:
            raise pickle.UnpicklingError(f"it names {module[:40]}.{name[:40]}, which is not loaded")
        return known[module, name]


def _value(value: Any) -> Any:
    return value.value if isinstance(value, _Array) else value

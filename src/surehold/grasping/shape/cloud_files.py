"""Point clouds from files: PLY, PCD, XYZ and NPZ, as they are, in the file's unit.

PLY   vertices x y z and, where they are there, nx ny nz (read by trimesh); faces are not looked at
PCD   ascii, binary or compressed, fields x y z and normal_x normal_y normal_z; the header's VIEWPOINT is the camera,
      unless it is the origin, which most writers leave there
XYZ   text, three or six columns: x y z and nx ny nz; # starts a comment
NPZ   arrays "points" (n, 3), and optionally "normals" (n, 3) and "camera" (3,)
"""

import io
import stat
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.shape.lzf import unpacked

__all__ = ["CLOUD_FORMATS", "RawCloud", "read_cloud"]

Array = NDArray[np.float64]

CLOUD_FORMATS: Final = ("ply", "pcd", "xyz", "npz")
_MOST_BYTES: Final = 2**30


class RawCloud(NamedTuple):
    """Points as a file holds them."""

    points: Array  #: (n, 3) in the file's unit; may hold NaN
    normals: Array | None  #: (n, 3) of any length
    camera: Array | None  #: (3,) in the file's unit


def read_cloud(path: str | Path) -> RawCloud:
    """Read a point cloud.

    Raises
    ------
    InputError
        If the file is of another kind, cannot be read, is larger than 1 GiB, or holds no points.
    """
    file = Path(path)
    kind = file.suffix.lower().lstrip(".")
    if kind not in CLOUD_FORMATS:
        known = ", ".join(f".{name}" for name in CLOUD_FORMATS)
        raise InputError(f"{str(path)!r} is no point cloud; give one of {known}.")
    try:
        status = file.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{str(path)!r} is no regular file; give a point cloud.")
        if status.st_size > _MOST_BYTES:
            raise InputError(f"{file.name!r} has {status.st_size / 2**30:.1f} GiB; thin it to 1 GiB or less.")
        content = file.read_bytes()
    except OSError as error:
        raise InputError(f"{str(path)!r} cannot be read: {error.strerror}; check the path.") from None
    try:
        cloud = {"ply": _ply, "pcd": _pcd, "xyz": _xyz, "npz": _npz}[kind](content)
    except InputError as error:
        raise InputError(f"{file.name!r}: {error}") from None
    except Exception as error:  # a damaged file can make a reader stumble anywhere
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{file.name!r} cannot be read as {kind.upper()}: {reason}; export it again.") from None
    if cloud.points.ndim != 2 or cloud.points.shape[1] != 3:
        raise InputError(f"{file.name!r} holds points of shape {cloud.points.shape}; give (n, 3): x, y, z.")
    if not len(cloud.points):
        raise InputError(f"{file.name!r} holds no points; give a cloud of the object's surface.")
    if cloud.normals is not None and cloud.normals.shape != cloud.points.shape:
        raise InputError(f"{file.name!r} holds {len(cloud.points)} points and {len(cloud.normals)} normals; mend it.")
    return cloud


def _ply(content: bytes) -> RawCloud:
    from trimesh.exchange.ply import load_ply

    found = load_ply(io.BytesIO(content))
    points = found.get("vertices")
    if points is None:
        raise InputError("it holds no vertices; give a cloud of the object's surface.")
    normals = found.get("vertex_normals")
    return RawCloud(
        np.asarray(points, dtype=np.float64),
        None if normals is None else np.asarray(normals, dtype=np.float64),
        None,
    )


def _xyz(content: bytes) -> RawCloud:
    if not content.strip():
        return RawCloud(np.empty((0, 3)), None, None)
    text = content.decode("utf-8-sig").replace(",", " ").replace(";", " ")
    rows = np.loadtxt(io.StringIO(text), comments=("#", "//"), ndmin=2)
    if rows.shape[1] not in (3, 6):
        raise InputError(f"its lines have {rows.shape[1]} numbers; give three (x y z) or six (with nx ny nz).")
    return RawCloud(rows[:, :3].copy(), rows[:, 3:].copy() if rows.shape[1] == 6 else None, None)


def _npz(content: bytes) -> RawCloud:
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        if "points" not in arrays:
            raise InputError(f"it holds {', '.join(arrays.files) or 'nothing'}; name the array (n, 3) 'points'.")
        found = {k: np.asarray(arrays[k], dtype=np.float64) for k in ("points", "normals", "camera") if k in arrays}
    camera = found.get("camera")
    if camera is not None and (camera.shape != (3,) or not np.all(np.isfinite(camera))):
        raise InputError(f"its camera is {camera.tolist()}; give three finite numbers.")
    return RawCloud(found["points"], found.get("normals"), camera)


def _by_point(packed: bytes, record: np.dtype[Any], length: int) -> bytes:
    """Return compressed data, which hold field after field, point after point."""
    if len(packed) < 8:
        raise InputError(f"it ends before its {length} points; copy it again.")
    inside, size = (int(number) for number in np.frombuffer(packed, dtype="<u4", count=2))
    if len(packed) - 8 < inside or size != length * record.itemsize:
        raise InputError(f"it ends before its {length} points; copy it again.")
    data = unpacked(packed[8 : 8 + inside], size)
    table = np.empty(length, dtype=record)
    start = 0
    for name in record.names or ():
        kind = record[name]
        table[name] = np.frombuffer(data, dtype=kind.base, count=length * kind.shape[0], offset=start).reshape(
            length, -1
        )
        start += length * kind.itemsize
    return table.tobytes()


def _pcd(content: bytes) -> RawCloud:
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = content.find(b"\n", start)
        if end < 0:
            raise InputError("its header has no DATA line; export it again as PCD 0.7.")
        words = content[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
    names, form = header["FIELDS"], header["DATA"][0].lower()
    sizes = [int(word) for word in header["SIZE"]]
    counts = [int(word) for word in header.get("COUNT", ["1"] * len(names))]
    length = int(header["POINTS"][0])
    if form not in ("ascii", "binary", "binary_compressed"):
        raise InputError(f"its data are {form}; give ascii, binary or binary_compressed.")
    if not {"x", "y", "z"} <= set(names):
        raise InputError(f"its fields are {' '.join(names)}; x, y and z are needed.")
    if form == "ascii":
        rows = np.loadtxt(io.BytesIO(content[start:]), ndmin=2) if length else np.empty((0, sum(counts)))
        first = dict(zip(names, np.cumsum([0, *counts[:-1]]).tolist(), strict=True))
        columns = {name: rows[:, first[name]] for name in names}
    else:
        letters = {"F": "f", "I": "i", "U": "u"}
        kinds = [letters[word.upper()] for word in header["TYPE"]]
        # Fields of padding share the name "_"; a name of a record is unique.
        fields = [
            (f"{name}{i}" if name == "_" else name, f"<{k}{size}", (count,))
            for i, (name, k, size, count) in enumerate(zip(names, kinds, sizes, counts, strict=True))
        ]
        record = np.dtype(fields)
        if form == "binary_compressed":
            content, start = _by_point(content[start:], record, length), 0
        if len(content) - start < length * record.itemsize:
            raise InputError(f"it ends before its {length} points; copy it again.")
        table = np.frombuffer(content, dtype=record, count=length, offset=start)
        columns = {name: table[name][:, 0] for name in names if name != "_"}

    def three(*wanted: str) -> Array:
        return np.column_stack([columns[name] for name in wanted]).astype(np.float64)

    normal = ("normal_x", "normal_y", "normal_z")
    camera = np.array([float(word) for word in header.get("VIEWPOINT", ["0"] * 7)[:3]])
    return RawCloud(
        three("x", "y", "z"),
        three(*normal) if set(normal) <= set(columns) else None,
        camera if np.any(camera != 0.0) else None,
    )

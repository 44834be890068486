"""Point clouds from files: PLY, PCD, XYZ and NPZ, as they are, in the file's unit.

PLY   vertices x y z and, where they are there, nx ny nz (object/ply_files.py); faces are not looked at
PCD   ascii, binary or compressed, fields x y z and normal_x normal_y normal_z; the header's VIEWPOINT is the camera,
      unless it is the origin, which most writers leave there
XYZ   text, three or six columns: x y z and nx ny nz, or a color: numbers from 0 to 255 that are no unit vectors; #
      starts a comment; numbers with decimal commas are apart by spaces or semicolons
NPZ   arrays "points" (n, 3), and optionally "normals" (n, 3) and "camera" (3,)
"""

import io
import math
import re
import stat
import warnings
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.object.ply_files import read_ply
from surehold.grasping.shape.lzf import unpacked

__all__ = ["CLOUD_FORMATS", "RawCloud", "read_cloud"]

Array = NDArray[np.float64]

CLOUD_FORMATS: Final = ("ply", "pcd", "xyz", "npz")
_MOST_BYTES: Final = 2**30
_COMMENTS: Final = ("#", "//")
_ROUNDED: Final = 0.02  # of the length of a normal in text
_DECIMAL_COMMA: Final = r"[-+]?(\d+|\d+,\d+)([eE][-+]?\d+)?"
_LETTERS: Final = {"F": "f", "I": "i", "U": "u"}
_KINDS: Final = ("f4", "f8", *(f"{letter}{size}" for letter in "iu" for size in (1, 2, 4, 8)))


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
    found = read_ply(content)
    return RawCloud(found.vertices, found.normals, None)


def _xyz(content: bytes) -> RawCloud:
    text = content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig").replace(";", " ")
    text = text.replace(",", "." if _has_decimal_commas(text) else " ")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a file without numbers
            rows = np.loadtxt(io.StringIO(text), comments=_COMMENTS, ndmin=2)
    except ValueError:
        raise InputError(f"it cannot be read as XYZ: {_unreadable(text)}") from None
    if not rows.size:
        return RawCloud(np.empty((0, 3)), None, None)
    if rows.shape[1] not in (3, 6):
        raise InputError(f"its lines have {rows.shape[1]} numbers; give three (x y z) or six (with nx ny nz).")
    points, more = rows[:, :3].copy(), rows[:, 3:].copy()
    length = np.linalg.norm(more, axis=1)
    colored = np.all((more >= 0.0) & (more <= 255.0)) and np.any((length > 0.0) & (np.abs(length - 1.0) > _ROUNDED))
    return RawCloud(points, more if more.size and not colored else None, None)


def _has_decimal_commas(text: str) -> bool:
    """Whether commas stand within numbers, not between them: each word has one at most, and none has a point."""
    if "," not in text:
        return False
    words = " ".join(line.partition("#")[0].partition("//")[0] for line in text.splitlines()).split()
    return any("," in word for word in words) and all(re.fullmatch(_DECIMAL_COMMA, word) for word in words)


def _unreadable(text: str) -> str:
    """Return what is wrong with the first line that is no point."""
    usual = 0
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].partition("//")[0].split()
        try:
            count = len([float(word) for word in words])
        except ValueError:
            return f"line {number} is {line[:60]!r}; give numbers alone, x y z, and begin other lines with #."
        if count and usual and count != usual:
            return f"line {number} has {count} numbers, those before have {usual}; give x y z, or x y z nx ny nz."
        usual = usual or count
    return "its numbers cannot be read; give x y z in each line."


def _npz(content: bytes) -> RawCloud:
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        if "points" not in arrays:
            raise InputError(f"it holds {', '.join(arrays.files) or 'nothing'}; name the array (n, 3) 'points'.")
        if any(arrays[k].dtype.kind not in "fiu" for k in ("points", "normals", "camera") if k in arrays):
            raise InputError("its arrays are no real numbers; store points, normals and camera as float64.")
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
    header, start = _pcd_header(content)
    names, form, length = header.names, header.form, header.length
    if form == "ascii":
        width = sum(header.counts)
        rows = np.loadtxt(io.BytesIO(content[start:]), ndmin=2) if content[start:].strip() else np.empty((0, width))
        if rows.shape != (length, width):
            raise InputError(
                f"it has {len(rows):,} rows of {rows.shape[1]} numbers, its header says {length:,} of {width}; copy it "
                "again, or mend POINTS, FIELDS and COUNT."
            )
        first = dict(zip(names, np.cumsum([0, *header.counts[:-1]]).tolist(), strict=True))
        columns = {name: rows[:, first[name]] for name in names}
    else:
        # Fields of padding share the name "_"; a name of a record is unique.
        fields = [
            (f"{name}{i}" if name == "_" else name, f"<{kind}", (count,))
            for i, (name, kind, count) in enumerate(zip(names, header.kinds, header.counts, strict=True))
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
    return RawCloud(three("x", "y", "z"), three(*normal) if set(normal) <= set(columns) else None, header.camera)


class _PcdHeader(NamedTuple):
    names: list[str]
    kinds: list[str]  #: such as "f4"
    counts: list[int]
    length: int  #: points
    form: str  #: "ascii", "binary" or "binary_compressed"
    camera: Array | None


def _pcd_header(content: bytes) -> tuple[_PcdHeader, int]:
    """Return what the header says, and where the points begin."""
    lines: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in lines:
        end = content.find(b"\n", start)
        if end < 0:
            raise InputError("its header has no DATA line; export it again as PCD 0.7.")
        words = content[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            lines[words[0].upper()] = words[1:]
    lines.setdefault("FIELDS", lines.get("COLUMNS", []))  # as files of version 0.5 call them
    names = lines["FIELDS"]
    if not {"x", "y", "z"} <= set(names):
        raise InputError(f"its fields are {' '.join(names) or 'not named'}; x, y and z are needed.")
    form = " ".join(lines["DATA"]).lower()
    if form not in ("ascii", "binary", "binary_compressed"):
        raise InputError(f"its data are {form}; give ascii, binary or binary_compressed.")
    for word, usual in {"SIZE": ["4"], "TYPE": ["F"], "COUNT": ["1"]}.items():
        if word not in lines and (word == "COUNT" or form == "ascii"):
            lines[word] = usual * len(names)
        if len(lines.get(word, [])) != len(names):
            raise InputError(
                f"its header has {len(lines.get(word, []))} of {word} for the {len(names)} fields {' '.join(names)}; "
                "give one a field."
            )
    extent = lines.get("POINTS") or [str(math.prod(_whole(lines.get(word, []), word) for word in ("WIDTH", "HEIGHT")))]
    kinds = [_LETTERS.get(kind.upper(), "") + size for kind, size in zip(lines["TYPE"], lines["SIZE"], strict=True)]
    for kind in kinds:
        if kind not in _KINDS:
            raise InputError(f"its TYPE and SIZE make {kind!r}; types are F, I and U, of 1, 2, 4 or 8 bytes.")
    counts = [_whole([count], "COUNT") for count in lines["COUNT"]]
    return _PcdHeader(names, kinds, counts, _whole(extent, "POINTS"), form, _viewpoint(lines.get("VIEWPOINT"))), start


def _whole(words: list[str], name: str) -> int:
    if len(words) != 1 or not words[0].isascii() or not words[0].isdigit():
        raise InputError(f"its header has {name} {' '.join(words) or 'nowhere'}; give a whole number.")
    return int(words[0])


def _viewpoint(words: list[str] | None) -> Array | None:
    """Return the camera, None at the origin."""
    if words is None:
        return None
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) != 7 or not np.all(np.isfinite(numbers)):
        raise InputError(f"its VIEWPOINT is {' '.join(words)[:60]!r}; give seven finite numbers, or 0 0 0 1 0 0 0.")
    return numbers[:3] if np.any(numbers[:3] != 0.0) else None

"""Vertices and faces of a PLY file: text, or binary of either byte order.

    ply                                                  first line
    format binary_little_endian 1.0                      or ascii, binary_big_endian
    element vertex 8                                     so many rows of the properties that follow
    property float x                                     ..
    element face 6
    property list uchar int vertex_indices               or vertex_index; faces have any number of corners, of any size
    end_header

Elements and properties of other names are passed over, in whatever order they stand. Whole numbers of 8 bytes, which
trimesh writes and the format does not have, are read as well.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError

__all__ = ["PlyFile", "read_ply"]

Array = NDArray[np.float64]

_NAMES: Final = (
    "char uchar short ushort int uint float double int8 uint8 int16 uint16 int32 uint32 float32 float64 int64 uint64"
)
_KINDS: Final = "i1 u1 i2 u2 i4 u4 f4 f8 i1 u1 i2 u2 i4 u4 f4 f8 i8 u8"
_TYPES: Final[dict[str, str]] = dict(zip(_NAMES.split(), _KINDS.split(), strict=True))
_WHOLE: Final = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}
_LETTERS: Final = {**_WHOLE, "f4": "f", "f8": "d"}
_ORDERS: Final = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS: Final = ("vertex_indices", "vertex_index")


class PlyFile(NamedTuple):
    """What is looked at of a PLY file."""

    vertices: Array  #: (v, 3) in the file's unit
    normals: Array | None  #: (v, 3) of the vertices
    corners: NDArray[np.int64]  #: (c,) of the faces, one after the other
    counts: NDArray[np.int64]  #: (p,) corners of each face


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)  # name, kind, kind of a list's length or ""


def read_ply(content: bytes) -> PlyFile:
    """Return vertices and faces.

    Raises
    ------
    InputError
        If the content has no vertices x y z, or ends before what its header counts.
    ValueError
        If it is no PLY at all.
    """
    order, elements, start = _header(content)
    lines = content[start:].splitlines() if not order else []
    rows = [line for line in lines if line.strip()]
    found: dict[str, Mapping[str, Any]] = {}
    for element in elements:
        if order:
            values, start = _binary(content, start, element, order)
        else:
            values, rows = _text(rows[: element.count], element), rows[element.count :]
        found.setdefault(element.name, values)
    vertex, face = found.get("vertex", {}), found.get("face", {})
    if not {"x", "y", "z"} <= set(vertex):
        given = " ".join(vertex) or "none"
        raise InputError(f"the properties of its vertices are {given}; x, y and z are needed.")
    normal = ("nx", "ny", "nz")
    normals = np.column_stack([vertex[name] for name in normal]) if set(normal) <= set(vertex) else None
    none = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    corners, counts = next((face[name] for name in _CORNERS if name in face), none)
    return PlyFile(np.column_stack([vertex[name] for name in "xyz"]), normals, corners.astype(np.int64), counts)


def _header(content: bytes) -> tuple[str, list[_Element], int]:
    """Return the byte order, "" for text, the elements, and where their rows begin."""
    end = content.find(b"end_header")
    if content[:3] != b"ply" or end < 0:
        raise ValueError("it does not begin with 'ply' and a header")
    start = end + len(b"end_header")
    start += 2 if content[start : start + 2] == b"\r\n" else 1
    order, elements = "", []
    for number, line in enumerate(content[:end].decode("utf-8", "replace").splitlines(), 1):
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = _ORDERS[words[1]]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2])))
                if elements[-1].count < 0:
                    raise ValueError
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append((words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append((words[2], _TYPES[words[1]], ""))
        except (KeyError, IndexError, ValueError):
            raise InputError(f"line {number} of its header is {line[:60]!r}, which PLY does not know.") from None
    return order, [element for element in elements if element.properties], start  # others have no rows


def _text(lines: list[bytes], element: _Element) -> Mapping[str, Any]:
    """Return the columns of an element by name; of a list its values, one after the other, and its lengths."""
    if len(lines) < element.count:
        raise InputError(f"it ends before its {element.count:,} rows of {element.name}; copy it again.")
    rows = [line.split() for line in lines]
    if not any(length for _, _, length in element.properties):
        return dict(zip([name for name, _, _ in element.properties], _columns(rows, element).T, strict=True))
    values: dict[str, list[float]] = {name: [] for name, _, _ in element.properties}
    lengths: dict[str, list[int]] = {name: [] for name, _, length in element.properties if length}
    for k, row in enumerate(rows):
        place = 0
        try:
            for name, _, length in element.properties:
                n = int(row[place]) if length else 1
                part = row[place + bool(length) : place + bool(length) + n]
                if len(part) < n:
                    raise ValueError
                values[name].extend(map(float, part))
                if length:
                    lengths[name].append(n)
                place += n + bool(length)
        except (ValueError, IndexError):
            raise _unreadable(element, k, lines[k]) from None
    return {
        name: (np.array(values[name]), np.array(lengths[name], dtype=np.int64)) if length else np.array(values[name])
        for name, _, length in element.properties
    }


def _columns(rows: list[list[bytes]], element: _Element) -> Array:
    width = len(element.properties)
    try:
        if any(len(row) < width for row in rows):
            raise ValueError
        return np.array([row[:width] for row in rows], dtype=np.bytes_).astype(np.float64).reshape(-1, width)
    except ValueError:
        for k, row in enumerate(rows):
            try:
                short = len([float(word) for word in row]) < width
            except ValueError:
                short = True
            if short:
                raise _unreadable(element, k, b" ".join(row)) from None
        raise


def _unreadable(element: _Element, k: int, line: bytes) -> InputError:
    text = line.decode("utf-8", "replace")[:60]
    names = " ".join(name for name, _, _ in element.properties)
    return InputError(f"row {k + 1} of {element.name} is {text!r}; its header says numbers for {names}.")


def _binary(content: bytes, start: int, element: _Element, order: str) -> tuple[Mapping[str, Any], int]:
    """Return the columns of an element as `_text` does, and where the next one begins."""
    lists = [(name, order + length) for name, _, length in element.properties if length]
    try:
        first = _row(content, start, element, order)[0] if lists and element.count else {}
        kinds: list[Any] = []
        for name, kind, length in element.properties:
            kinds += [(f"{name} length", order + length)] if length else []
            kinds.append((name, order + kind, (len(first.get(name, ())),)) if length else (name, order + kind))
        record = np.dtype(kinds)
        table = np.frombuffer(content, dtype=record, count=element.count, offset=start)
        # Most files have faces of one size.
        if all(np.all(table[f"{name} length"] == len(first.get(name, ()))) for name, _ in lists):
            columns: dict[str, Any] = {name: table[name] for name, _, length in element.properties if not length}
            columns = {name: column.astype(np.float64) for name, column in columns.items()}
            for name, _ in lists:
                columns[name] = table[name].ravel(), table[f"{name} length"].astype(np.int64)
            return columns, start + element.count * record.itemsize
    except (ValueError, struct.error):
        pass  # faces of several sizes may take less room than the first one does; what is short is found below
    return _by_row(content, start, element, order)


def _by_row(content: bytes, start: int, element: _Element, order: str) -> tuple[Mapping[str, Any], int]:
    """Return what `_binary` does, of rows of different length."""
    values: dict[str, list[Any]] = {name: [] for name, _, _ in element.properties}
    lengths: dict[str, list[int]] = {name: [] for name, _, length in element.properties if length}
    try:
        for _ in range(element.count):
            row, start = _row(content, start, element, order)
            for name, part in row.items():
                values[name].extend(part)
                if name in lengths:
                    lengths[name].append(len(part))
    except struct.error:
        raise InputError(f"it ends before its {element.count:,} rows of {element.name}; copy it again.") from None
    return {
        name: (np.array(values[name]), np.array(lengths[name], dtype=np.int64))
        if length
        else np.array(values[name], dtype=np.float64)
        for name, _, length in element.properties
    }, start


def _row(content: bytes, start: int, element: _Element, order: str) -> tuple[dict[str, tuple[Any, ...]], int]:
    """Return one row of a binary element, and where the next one begins; struct.error if it is not all there."""
    row: dict[str, tuple[Any, ...]] = {}
    for name, kind, length in element.properties:
        n = 1
        if length:
            n = int(struct.unpack_from(order + _LETTERS[length], content, start)[0])
            start += int(length[1])
            if not 0 <= n <= len(content):
                raise struct.error
        row[name] = struct.unpack_from(f"{order}{n}{_LETTERS[kind]}", content, start)
        start += n * int(kind[1])
    return row, start

"""Triangles of an STL file, text or binary; normals and names in it are not looked at.

    solid NAME                          binary: a header of 80 bytes, the number of facets (4 bytes), and for each facet
    facet normal x y z                  12 numbers of 4 bytes, its normal and corners, and 2 bytes
    outer loop
    vertex x y z                        three times
    endloop
    endfacet
    endsolid NAME                       further solids may follow

A text is read to its end, whatever ends its solids: half of a file is no other object.
"""

import re
import struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError

__all__ = ["binary_stl", "read_binary_stl", "read_text_stl"]

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

_HEAD: Final = 84
_FACET: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_TITLE: Final = re.compile(rb"(?m)^[ \t]*(?:end)?solid\b(?:(?!\bfacet[ \t]+normal\b)[^\n])*")  # names are any words
_WORD: Final = re.compile(rb"\bfacet\b|\bvertex\b")
_VERTEX: Final = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


def binary_stl(content: bytes, notes: list[str]) -> bytes | None:
    """Return the facets of a binary STL, None for a text; what its header counts otherwise is noted.

    Raises
    ------
    InputError
        If it ends before the facets that its header counts.
    """
    behind = len(content) - _HEAD
    count = struct.unpack("<I", content[80:_HEAD])[0] if behind >= 0 else 0
    if behind == _FACET.itemsize * count and behind > 0:
        return content[_HEAD:]
    start = content[:4000].replace(b"\0", b"").lstrip(b"\xef\xbb\xbf\xff\xfe \t\r\n")  # a text may be UTF-16
    if start[:5].lower() == b"solid" and (b"facet" in start.lower() or b"endsolid" in start.lower()):
        return None
    if behind < 0:
        raise InputError("it is neither a text that begins with 'solid' nor as long as the header of a binary STL")
    if count == 0 and behind > 0 and behind % _FACET.itemsize == 0:
        notes.append(f"its header counts no triangles, {behind // _FACET.itemsize:,} follow and are read")
        return content[_HEAD:]
    if behind < _FACET.itemsize * count:
        there = behind // _FACET.itemsize
        raise InputError(f"its header counts {count:,} triangles, and {there:,} are there; copy or export it again")
    if count:
        notes.append(f"{behind - _FACET.itemsize * count:,} bytes behind the last triangle are ignored")
    return content[_HEAD : _HEAD + _FACET.itemsize * count]


def read_binary_stl(facets: bytes) -> tuple[Array, Faces]:
    """Return vertices (3 f, 3) and triangles (f, 3) of what `binary_stl` returns."""
    return _apart(np.frombuffer(facets, dtype=_FACET)["corners"].astype(np.float64))


def read_text_stl(content: bytes, notes: list[str]) -> tuple[Array, Faces]:
    """Return vertices (3 f, 3) and triangles (f, 3).

    Raises
    ------
    InputError
        If a facet is not of three vertices, or a number cannot be read; the message names the line.
    """
    text = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n").lower()
    bare = _TITLE.sub(b"", text)  # with as many lines
    words = b"".join(word[:1] for word in _WORD.findall(bare))
    count = words.count(b"f")
    if words != count * b"fvvv":
        raise _no_triangle(bare)
    rows = _VERTEX.findall(bare)
    try:
        corners = np.array(rows, dtype=np.bytes_).astype(np.float64).reshape(-1, 3, 3)
    except ValueError:
        for row in _VERTEX.finditer(bare):
            try:
                [float(number) for number in row.groups()]
            except ValueError:
                shown = b" ".join(row.groups()).decode("utf-8", "replace")[:60]
                raise InputError(
                    f"line {_line(bare, row.start())} has a vertex without three coordinates, {shown!r}; give numbers "
                    "with decimal points"
                ) from None
        raise
    if len(corners) < count or len(re.findall(rb"\bendfacet\b", bare)) < count:
        raise InputError(f"one of its {count:,} facets has no end; copy or export it again")
    if count and not re.search(rb"\bendsolid\b", text[text.rfind(b"endfacet") :]):
        notes.append("it ends without endsolid: was it cut off?")
    return _apart(corners)


def _no_triangle(text: bytes) -> InputError:
    """Return what is to be said of a text of which a facet has not three vertices."""
    places = [(word[0][:1], word.start()) for word in _WORD.finditer(text)]
    starts = [k for k, (letter, _) in enumerate(places) if letter == b"f"]
    ends = [*starts[1:], len(places)]
    if not starts or starts[0] > 0:
        return InputError(f"line {_line(text, places[0][1])} has a vertex that is of no facet")
    k = next(k for k, (start, end) in enumerate(zip(starts, ends, strict=True)) if end - start != 4)
    there, line = ends[k] - starts[k] - 1, _line(text, places[starts[k]][1])
    if k + 1 == len(starts) and there < 3:
        return InputError(f"it ends within the facet of line {line}; copy or export it again")
    return InputError(f"line {line}: its facet has {there} vertices; give triangles")


def _line(text: bytes, place: int) -> int:
    return text.count(b"\n", 0, place) + 1


def _apart(corners: Array) -> tuple[Array, Faces]:
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int64).reshape(-1, 3)

"""Vertices and triangles of a Wavefront OBJ file; everything else in it is passed over.

    v x y z ..       a vertex; what follows (a weight, a color) is not looked at
    f a b c ..       a face of three corners or more, each a number of a vertex, or such a number and /texture/normal

Vertices are counted from 1, or backwards from the face's line: -1 is the vertex that came last before it.
"""

import re
import warnings
from itertools import islice
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.object.polygons import triangles_of

__all__ = ["read_obj"]

_VERTEX: Final = re.compile(rb"(?m)^[ \t]*v[ \t]+([^#\n]*)")
_FACE: Final = re.compile(rb"(?m)^[ \t]*f[ \t]+([^#\n]*)")
# A path or a comment that ends in a backslash does not go on: the vertex behind it would be lost.
_GOES_ON: Final = re.compile(rb"(?m)^[ \t]*[vf][ \t][^#\\\n]*(?:\\[ \t]*\n[^#\\\n]*)+")


def read_obj(content: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (v, 3) and triangles (f, 3), none of which has a corner that is not there.

    Raises
    ------
    InputError
        If a line cannot be read; the message names it.
    """
    text = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\\" in text:  # a line that goes on counts as one
        text = _GOES_ON.sub(lambda line: re.sub(rb"\\[ \t]*\n", b" ", line[0]), text)
    vertices = _vertices(text)
    faces = [re.sub(rb"/[^\s]*", b"", face) for face in _FACE.findall(text)]
    counts = np.array([len(face.split()) for face in faces], dtype=np.int64)
    try:
        named = _numbers(faces, np.int64, int(counts.sum()))
    except ValueError:
        k = next(k for k, face in enumerate(faces) if not re.fullmatch(rb"\s*([+-]?\d+\s*)+", face))
        line, found = _line(text, _FACE, k)
        raise InputError(f"line {line}: its face is {found!r}; corners are whole numbers of vertices") from None
    corners, owner = named - 1, np.repeat(np.arange(len(faces)), counts)
    if np.any(named < 0):
        places = np.array([match.start() for match in _VERTEX.finditer(text)])
        before = np.searchsorted(places, [match.start() for match in _FACE.finditer(text)])
        corners = np.where(named < 0, before[owner] + named, corners)
    wrong = np.flatnonzero((named == 0) | (corners < 0) | (corners >= len(vertices)))
    if len(wrong):
        line, _ = _line(text, _FACE, int(owner[wrong[0]]))
        raise InputError(f"line {line}: its face has vertex {named[wrong[0]]} of {len(vertices):,}")
    return vertices, triangles_of(vertices, corners, counts)


def _vertices(text: bytes) -> NDArray[np.float64]:
    rows = [found.split(None, 3)[:3] for found in _VERTEX.findall(text)]
    try:
        if any(len(row) != 3 for row in rows):
            raise ValueError
        return _numbers([word for row in rows for word in row], np.float64, 3 * len(rows)).reshape(-1, 3)
    except ValueError:
        line, found = _line(text, _VERTEX, next(k for k, row in enumerate(rows) if not _are_numbers(row)))
        raise InputError(
            f"line {line} has a vertex without three coordinates, {found!r}; give numbers with decimal points"
        ) from None


def _line(text: bytes, kind: "re.Pattern[bytes]", k: int) -> tuple[int, str]:
    """Return the number of the line of the k-th vertex or face, and what it says."""
    match = next(islice(kind.finditer(text), k, None))
    return text.count(b"\n", 0, match.start(1)) + 1, match[1].decode("utf-8", "replace").strip()[:60]


def _numbers(texts: list[bytes], kind: type, count: int) -> NDArray[Any]:
    """Return so many numbers; ValueError if a text holds anything else."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numbers end where a text is none: NumPy warns
        try:
            found = np.fromstring(b" ".join(texts), dtype=kind, sep=" ")
        except DeprecationWarning as warning:
            raise ValueError from warning
    if len(found) != count:
        raise ValueError
    return found


def _are_numbers(row: list[bytes]) -> bool:
    try:
        return len([float(word) for word in row]) == 3
    except ValueError:
        return False

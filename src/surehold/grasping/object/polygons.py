"""Triangles of polygons: files hold faces of any number of corners, and not all of them are convex.

A fan about the first corner fills a convex face. Of one with a notch its triangles would reach over the notch, where
there is no surface: such a face is projected along its normal and cut into triangles that stay within it (manifold3d).
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["triangles_of"]

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

_STRAIGHT: Final = -1e-6  #: sine of an inward turn up to which a corner counts as straight: coordinates are rounded


def triangles_of(vertices: Array, corners: Faces, counts: Faces) -> Faces:
    """Return triangles (f, 3) of polygons whose corners (c,) follow one another, `counts` (p,) of them each.

    Polygons of less than three corners are left out. Of corners that are not there no vertex (v, 3) is looked at: they
    are the reader's to refuse.
    """
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]]) if len(counts) else np.empty(0, dtype=np.int64)
    parts, order = [np.empty((0, 3), dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    valid = len(corners) > 0 and corners.min() >= 0 and corners.max() < len(vertices)
    for n in np.unique(counts[counts >= 3]):
        mine = np.flatnonzero(counts == n)
        faces = corners[starts[mine][:, None] + np.arange(n)]
        fans = np.stack([np.broadcast_to(faces[:, :1], (len(faces), n - 2)), faces[:, 1:-1], faces[:, 2:]], axis=2)
        if n > 3 and valid:
            fans = fans.copy()
            for k, cut in _notched(vertices, faces):
                fans[k] = cut
        parts.append(fans.reshape(-1, 3))
        order.append(np.repeat(mine, n - 2))
    return np.vstack(parts)[np.argsort(np.concatenate(order), kind="stable")]


def _notched(vertices: Array, faces: Faces) -> Iterator[tuple[int, Faces]]:
    """Yield the number of each face (m, n) that is not convex, and its triangles (n - 2, 3)."""
    import manifold3d

    places = vertices[faces] - vertices[faces[:, :1]]
    following = np.roll(places, -1, axis=1)
    normal = np.cross(places, following).sum(axis=1)  # Newell's: twice the area, also of a face that is not plane
    edges = following - places
    turns = np.einsum("fni,fi->fn", np.cross(edges, np.roll(edges, -1, axis=1)), normal)
    length = np.linalg.norm(edges, axis=2)
    flat = length * np.roll(length, -1, axis=1) * np.linalg.norm(normal, axis=1)[:, None]
    for k in np.flatnonzero(np.any(turns < _STRAIGHT * flat, axis=1)):
        drop = int(np.argmax(np.abs(normal[k])))
        seen = places[k][:, [(drop + 1) % 3, (drop + 2) % 3]]
        turned = normal[k, drop] < 0.0  # seen from behind: counterclockwise is what manifold3d takes
        outline = seen[::-1] if turned else seen
        cut = np.asarray(manifold3d.triangulate([np.ascontiguousarray(outline)]), dtype=np.int64)
        if len(cut) == faces.shape[1] - 2:  # one that crosses itself has no such triangles
            yield int(k), faces[k][faces.shape[1] - 1 - cut[:, ::-1] if turned else cut]

"""A body as convex pieces, for simulators that collide convex shapes only.

    V, V_h   volume of a piece and of its convex hull, m^3       A   area of the largest face of its box, m^2

A piece is convex enough if its hull stands out by (V_h - V) / A < tolerance; otherwise it is cut in two across the
longest edge of its box. Thin walls and handles keep their shape, and a cylinder stays one piece.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError

__all__ = ["convex_pieces"]

TOLERANCE: Final = 1.5e-4  #: by how much a hull may stand out of its piece on average [m]
SMALLEST: Final = 0.003  #: pieces with a longest edge below this are not cut any more [m]


def convex_pieces(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    tolerance: float = TOLERANCE,
    smallest: float = SMALLEST,
) -> list[NDArray[np.float64]]:
    """Return the corners (k, 3) [m] of convex pieces that together fill a watertight mesh, in a fixed order.

    Raises
    ------
    InputError
        If the mesh is not watertight.
    """
    import manifold3d

    mesh = manifold3d.Mesh64(
        vert_properties=np.ascontiguousarray(vertices, dtype=np.float64),
        tri_verts=np.ascontiguousarray(faces, dtype=np.uint64),
    )
    body = manifold3d.Manifold(mesh)
    if body.status() != manifold3d.Error.NoError or body.volume() <= 0.0:
        raise InputError(f"the mesh encloses no volume ({body.status().name}); convex pieces need a watertight mesh.")
    waiting, pieces = [body], []
    while waiting:
        piece = waiting.pop()
        box = np.asarray(piece.bounding_box()).reshape(2, 3)
        edges = np.sort(box[1] - box[0])
        hull = piece.hull()
        if edges[2] < smallest or hull.volume() - piece.volume() < tolerance * edges[2] * edges[1]:
            corners = np.asarray(hull.to_mesh64().vert_properties)[:, :3]
            if hull.volume() > 1e-14:
                pieces.append(corners)
            continue
        axis = int(np.argmax(box[1] - box[0]))
        halves = piece.split_by_plane(tuple(np.eye(3)[axis].tolist()), float(box[:, axis].mean()))
        waiting += [half for half in halves if not half.is_empty()]
    return pieces

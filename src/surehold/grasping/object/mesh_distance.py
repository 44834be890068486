"""Signed distance of a triangle mesh at the nodes of a grid, by libigl.

    x   a node, (3,), m        c(x)   the closest point of the surface, d = +-|x - c|, gradient (x - c) / d

Inside and outside are told apart by the fast winding number (Barill et al. 2018), to which small holes do no harm.
Closest points are exact for nodes up to `FAR_OUTSIDE` outside and `FAR_INSIDE` inside, where contacts happen. For nodes
beyond, whose closest points take long to find because many are about equally close, the best of the closest points of
exact nodes nearby is taken: a point of the surface, at a distance that is too large by up to a quarter of a cell. At a
node that lies on the surface, as the nodes of a whole face do where its place is a multiple of the cell, x - c is
rounding; the gradient there is the surface's own normal.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.extras import require
from surehold.grasping.object.model import GraspObject

__all__ = ["mesh_distance"]

FAR_OUTSIDE: Final = 0.013  #: a finger's radius and the depth of a soft touch, and slack [m]
FAR_INSIDE: Final = 0.004  #: skin and soft touch, and slack [m]
_CHUNK = 20_000
_ON_SURFACE: Final = 1e-9  # [m] below it the direction from the closest point is lost to rounding
_ROUNDS = 3  # of offers between neighbors


def mesh_distance(
    obj: GraspObject,
    points: NDArray[np.float64],
    shape: NDArray[np.int_],
    cell: float,
    progress: Callable[[float], None],
) -> NDArray[np.float32]:
    """Return signed distance and gradient (n, 4) at the nodes (n, 3) of a grid of that shape and cell [m].

    Raises
    ------
    InputError
        If libigl is not installed.
    """
    require("mesh", f"the distance field of the mesh '{obj.name}'")
    import igl
    from scipy.ndimage import distance_transform_edt

    faces = obj.faces.astype(np.int64)
    inside = np.asarray(igl.fast_winding_number(obj.vertices, faces, points)) > 0.5
    tree = igl.AABB()
    tree.init(obj.vertices, faces)

    # Nodes near the surface: first roughly, by the distance to cells that hold a sample of it.
    rough = np.asarray(distance_transform_edt(~_sampled(obj, points[0], shape, cell))).ravel() * cell
    exact = np.flatnonzero(rough <= np.where(inside, FAR_INSIDE, FAR_OUTSIDE) + 2.0 * cell)
    closest = np.empty_like(points)
    for start in range(0, len(exact), _CHUNK):
        part = exact[start : start + _CHUNK]
        closest[part] = tree.squared_distance(obj.vertices, faces, np.ascontiguousarray(points[part]))[2]
        progress((start + len(part)) / len(exact))
    unknown = np.ones(len(points), dtype=bool)
    unknown[exact] = False
    if np.any(unknown):
        indices = np.asarray(
            distance_transform_edt(unknown.reshape(shape), return_distances=False, return_indices=True)
        )
        nearest = np.ravel_multi_index(tuple(indices.reshape(3, -1)), tuple(shape.tolist()))
        closest[unknown] = closest[nearest[unknown]]
        _improve(closest, points, np.flatnonzero(unknown), shape)
    away = points - closest
    length = np.linalg.norm(away, axis=1)
    sign = np.where(inside, -1.0, 1.0)
    nodes = np.empty((len(points), 4), dtype=np.float32)
    nodes[:, 0] = sign * length
    nodes[:, 1:] = away * (sign / np.where(length > 0.0, length, 1.0))[:, None]
    touching = np.flatnonzero(length < _ON_SURFACE)
    if len(touching):
        pseudonormal = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        normals = igl.signed_distance(points[touching], obj.vertices, faces, pseudonormal)[3]
        nodes[touching, 1:] = np.nan_to_num(normals)  # where faces of both directions lie on each other there is none
    return nodes


def _improve(
    closest: NDArray[np.float64], points: NDArray[np.float64], unknown: NDArray[np.int_], shape: NDArray[np.int_]
) -> None:
    """Let nodes `unknown` take over the closest point of a neighbor, where that is closer."""
    place = np.stack(np.unravel_index(unknown, tuple(shape.tolist())))
    squared = np.sum((points[unknown] - closest[unknown]) ** 2, axis=1)
    strides = (int(shape[1] * shape[2]), int(shape[2]), 1)
    for _ in range(_ROUNDS):
        for axis in range(3):
            for step in (-1, 1):
                valid = np.flatnonzero((place[axis] + step >= 0) & (place[axis] + step < shape[axis]))
                offered = closest[unknown[valid] + step * strides[axis]]
                found = np.sum((points[unknown[valid]] - offered) ** 2, axis=1)
                better = found < squared[valid]
                squared[valid[better]] = found[better]
                closest[unknown[valid[better]]] = offered[better]


def _sampled(obj: GraspObject, first: NDArray[np.float64], shape: NDArray[np.int_], cell: float) -> NDArray[np.bool_]:
    """Return which nodes (nx, ny, nz) are the nearest ones to a sample of the surface, sampled finer than a cell."""
    hit = np.zeros(tuple(shape.tolist()), dtype=bool)

    def mark(samples: NDArray[np.float64]) -> None:
        index = np.clip(np.rint((samples - first) / cell).astype(np.int64), 0, shape - 1)
        hit[index[:, 0], index[:, 1], index[:, 2]] = True

    corners = obj.vertices[obj.faces]  # (f, 3, 3)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    pieces = np.maximum(np.ceil(longest / cell).astype(int), 1)  # an edge is cut into this many pieces
    for n in np.unique(pieces):
        mine = corners[pieces == n]
        i, j = (a.ravel() for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
        keep = i + j <= n
        u, v = i[keep] / n, j[keep] / n
        weights = np.column_stack([1.0 - u - v, u, v])
        step = max(1, 2_000_000 // len(weights))
        for start in range(0, len(mine), step):
            mark(np.einsum("sk,fki->fsi", weights, mine[start : start + step]).reshape(-1, 3))
    return hit

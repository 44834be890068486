"""Signed distance of an object on a grid, with its gradient, for compiled look-up.

    x      a point in the object's frame, (3,), m        x_i, d_i, g_i   node of the grid, its distance and gradient
    d(x)   signed distance, m, negative inside           w_i             trilinear weights of the cell's eight nodes

    d(x) = sum_i w_i (d_i + g_i . (x - x_i) / 2),   g(x) = sum_i w_i g_i

Linear interpolation of the values overrates a curved field by h^2 f''/8, the linear continuations of the nodes
underrate it by as much; their mean, used here, leaves an error of third order in the cell size h. The gradient is
continuous. Where the field has a ridge (equally near to two surfaces) it is underrated by at most about h/4.
Beyond the grid the distance to the object's box is returned: a lower bound, and never below the margin. A field that
the object brings along and that reaches less far is continued: outside of its grid the distance is taken to the closest
of the surface's points that belong to nodes on the grid's border, too large by a fraction of a cell at most.
"""

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.solids import signed_distance
from surehold.store.atomic import replacing
from surehold.store.kernels import njit

__all__ = [
    "DistanceField",
    "cache_folder",
    "content_hash",
    "distance_field_of",
    "field_distance",
    "field_distance_gradient",
]

CELL: Final = 0.001  #: edge of a grid cell [m]
MARGIN: Final = 0.016  #: how far the grid reaches beyond the object at least: a finger's radius and the soft touch [m]
_FORMAT = 4  #: part of the content hash: a change of the layout must not find an old file
_CHUNK = 200_000


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Signed distance and gradient on a regular grid."""

    nodes: NDArray[np.float32] = field(repr=False)  #: (nx, ny, nz, 4): distance [m] and its gradient
    frame: NDArray[np.float64]  #: (10,): first node (3), cell edge, lower (3) and upper (3) corner of the object [m]

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed distance (n,) at points (n, 3) [m]."""
        return np.array([field_distance(self.nodes, self.frame, p[0], p[1], p[2]) for p in np.atleast_2d(points)])

    def gradient(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the gradient (n, 3) at points (n, 3) [m], not normalized."""
        rows = [field_distance_gradient(self.nodes, self.frame, p[0], p[1], p[2])[1:] for p in np.atleast_2d(points)]
        return np.array(rows)


def cache_folder() -> Path:
    """Return the folder for computed data: $SUREHOLD_CACHE, or surehold in $XDG_CACHE_HOME or ~/.cache."""
    own = os.environ.get("SUREHOLD_CACHE")
    if own:
        return Path(own).expanduser()
    shared = os.environ.get("XDG_CACHE_HOME")
    return (Path(shared).expanduser() if shared else Path.home() / ".cache") / "surehold"


def distance_field_of(
    obj: GraspObject,
    cell: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
    margin: float = MARGIN,
) -> DistanceField:
    """Return the distance field of an object: its own, one from the cache folder, or computed and stored there.

    A cache folder that cannot be written costs time at the next start and nothing else. The cell is `CELL` for the
    shipped objects, and for a mesh the larger of that and what keeps the grid to 2 million nodes (1 million from
    300,000 triangles on). `progress` is called with the share that is done while a field is computed. The grid reaches
    `margin` [m] beyond the object, `MARGIN` or more: thick fingers need more. A field of its own is continued to there.

    Raises
    ------
    InputError
        If the cell is not a positive number, or the object is so large that the grid would not fit into memory.
    """
    if obj.distances is not None:
        return _continued(obj.distances, margin)
    lower, upper = obj.vertices.min(axis=0), obj.vertices.max(axis=0)
    if cell is None:
        cell = CELL if obj.solids else _mesh_cell(upper - lower + 2.0 * margin, len(obj.faces))
    if not (np.isfinite(cell) and cell > 0.0):
        raise InputError(f"grid cell is {cell!r}; give a positive length in meters, such as {CELL}.")
    shape = np.ceil((upper - lower + 2.0 * margin) / cell).astype(int) + 1
    if np.prod(shape.astype(float)) > 5e7:
        raise InputError(
            f"object '{obj.name}' of {' x '.join(f'{s * 1e3:.0f}' for s in upper - lower)} mm needs a grid of "
            f"{' x '.join(map(str, shape))} nodes; give a larger cell than {cell * 1e3:g} mm."
        )
    frame = np.concatenate([lower - margin, [cell], lower, upper])
    name = content_hash(f"{_FORMAT} {bool(obj.solids)}", np.round(obj.vertices, 9), obj.faces, frame)
    path = cache_folder() / "fields" / f"{name}.npy"
    nodes = _load(path, (*shape.tolist(), 4))
    if nodes is None:
        nodes = _compute(obj, frame, shape, progress)
        _store(path, nodes)
    return DistanceField(nodes, frame)


def _continued(field: DistanceField, margin: float) -> DistanceField:
    """Return a field whose grid reaches `margin` [m] beyond the object, or the same one if it does."""
    from scipy.spatial import KDTree

    nodes, first, cell = field.nodes, field.frame[:3], field.frame[3]
    last = first + cell * (np.array(nodes.shape[:3]) - 1)
    missing = margin - np.array([field.frame[4:7] - first, last - field.frame[7:]])
    more = np.maximum(np.ceil(missing / cell - 1e-6), 0.0).astype(int)  # nodes before the first and behind the last
    if not more.any():
        return field
    inner = tuple(slice(before, before + n) for before, n in zip(more[0], nodes.shape[:3], strict=True))
    wide = np.zeros((*(more.sum(axis=0) + nodes.shape[:3]), 4), dtype=np.float32)
    wide[inner] = nodes
    known = np.zeros(wide.shape[:3], dtype=bool)
    known[inner] = True
    border = known.copy()
    border[tuple(slice(cut.start + 1, cut.stop - 1) for cut in inner)] = False
    origin = first - cell * more[0]
    steepness = np.linalg.norm(wide[border][:, 1:], axis=1)
    sound = steepness > 0.5  # between two surfaces there is no closest one
    values = wide[border][sound].astype(np.float64)
    closest = origin + cell * np.argwhere(border)[sound] - values[:, :1] * values[:, 1:] / steepness[sound, None]
    places = origin + cell * np.argwhere(~known)
    away = places - closest[KDTree(closest).query(places)[1]]
    length = np.linalg.norm(away, axis=1)
    wide[~known] = np.column_stack([length, away / np.where(length > 0.0, length, 1.0)[:, None]])
    return DistanceField(wide, np.concatenate([origin, field.frame[3:]]))


def _compute(
    obj: GraspObject, frame: NDArray[np.float64], shape: NDArray[np.int_], progress: Callable[[float], None]
) -> NDArray[np.float32]:
    axes = [frame[k] + frame[3] * np.arange(shape[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    if not obj.solids:
        from surehold.grasping.object.mesh_distance import mesh_distance

        return mesh_distance(obj, points, shape, frame[3], progress).reshape(*shape.tolist(), 4)
    nodes = np.empty((len(points), 4), dtype=np.float32)
    for start in range(0, len(points), _CHUNK):
        part = slice(start, start + _CHUNK)
        nodes[part, 0], nodes[part, 1:] = signed_distance(obj.solids, points[part])
        progress(min(1.0, (start + _CHUNK) / len(points)))
    return nodes.reshape(*shape.tolist(), 4)


def _mesh_cell(size: NDArray[np.float64], triangles: int) -> float:
    most = 1e6 if triangles >= 300_000 else 2e6
    needed = float(np.cbrt(np.prod(size) / most))
    return max(CELL, np.ceil(needed * 1e4) * 1e-4)


def content_hash(text: str, *arrays: NDArray[np.generic]) -> str:
    """Return a name for the cached results that follow from a text and some arrays."""
    content = hashlib.sha256(text.encode())
    for array in arrays:
        content.update(str(array.shape).encode())
        content.update(np.ascontiguousarray(array).tobytes())
    return content.hexdigest()[:32]


def _load(path: Path, shape: tuple[int, ...]) -> NDArray[np.float32] | None:
    try:
        nodes = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None  # missing or damaged: it is computed anew
    sound = nodes.shape == shape and nodes.dtype == np.float32 and np.isfinite(nodes).all()
    return nodes if sound else None


def _store(path: Path, nodes: NDArray[np.float32]) -> None:
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            np.save(file, nodes)


@njit(cache=True)
def field_distance(nodes, frame, x, y, z):
    """Return the signed distance at one point [m]."""
    h = frame[3]
    u, v, w = (x - frame[0]) / h, (y - frame[1]) / h, (z - frame[2]) / h
    if not (u >= 0.0 and v >= 0.0 and w >= 0.0):
        return _box_distance(frame, x, y, z)
    i, j, k = int(u), int(v), int(w)
    if i >= nodes.shape[0] - 1 or j >= nodes.shape[1] - 1 or k >= nodes.shape[2] - 1:
        return _box_distance(frame, x, y, z)
    u -= i
    v -= j
    w -= k
    total = 0.0
    for a in range(2):
        wa = u if a else 1.0 - u
        for b in range(2):
            wab = wa * (v if b else 1.0 - v)
            for c in range(2):
                wabc = wab * (w if c else 1.0 - w)
                node = nodes[i + a, j + b, k + c]
                slope = node[1] * (u - a) + node[2] * (v - b) + node[3] * (w - c)
                total += wabc * (node[0] + 0.5 * h * slope)
    return total


@njit(cache=True)
def field_distance_gradient(nodes, frame, x, y, z):
    """Return the signed distance [m] and its gradient (not normalized) at one point, as four numbers."""
    h = frame[3]
    u, v, w = (x - frame[0]) / h, (y - frame[1]) / h, (z - frame[2]) / h
    i, j, k = int(max(u, 0.0)), int(max(v, 0.0)), int(max(w, 0.0))
    beyond = i >= nodes.shape[0] - 1 or j >= nodes.shape[1] - 1 or k >= nodes.shape[2] - 1
    if beyond or not (u >= 0.0 and v >= 0.0 and w >= 0.0):
        px = x - min(max(x, frame[4]), frame[7])
        py = y - min(max(y, frame[5]), frame[8])
        pz = z - min(max(z, frame[6]), frame[9])
        d = np.sqrt(px * px + py * py + pz * pz)
        return d, px / d, py / d, pz / d
    u -= i
    v -= j
    w -= k
    total, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for a in range(2):
        wa = u if a else 1.0 - u
        for b in range(2):
            wab = wa * (v if b else 1.0 - v)
            for c in range(2):
                wabc = wab * (w if c else 1.0 - w)
                node = nodes[i + a, j + b, k + c]
                slope = node[1] * (u - a) + node[2] * (v - b) + node[3] * (w - c)
                total += wabc * (node[0] + 0.5 * h * slope)
                gx += wabc * node[1]
                gy += wabc * node[2]
                gz += wabc * node[3]
    return total, gx, gy, gz


@njit(cache=True)
def _box_distance(frame, x, y, z):
    px = x - min(max(x, frame[4]), frame[7])
    py = y - min(max(y, frame[5]), frame[8])
    pz = z - min(max(z, frame[6]), frame[9])
    return np.sqrt(px * px + py * py + pz * pz)

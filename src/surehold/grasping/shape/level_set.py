"""From values of f on a grid to the signed distance of its surface f = 0, which the closing needs, and to a mesh.

    F      values of f at the nodes (nx, ny, nz), negative inside      h   edge of a cell, m
    s, u   where an edge of the grid crosses the surface, and the unit normal there (linear along the edge)
    c(x)   the point of the surface nearest to the node x: in the plane of the nearest crossing, x - u u'(x - s),
           if that is close to s, else s itself

f is only near a distance where it was measured; the closing needs one everywhere, or it steps through walls. Nearest
crossings spread from node to node in eight sweeps (fast sweeping of closest points: Zhao 2005; Tsai 2002), so that
the cost is that of the grid. Of the inside the largest connected part is kept, and what was measured to be of the
object: what else a draw of f makes negative is no part of one rigid object.
"""

from dataclasses import dataclass
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from surehold.errors import SureholdError
from surehold.extras import require
from surehold.grasping.object.distance_field import DistanceField
from surehold.store.kernels import njit

__all__ = ["MOST_NODES", "Grid", "distances_of", "grid_around", "level_set_mesh", "one_piece"]

Array = NDArray[np.float64]

MOST_NODES: Final = 1_500_000  #: of a grid
_MEASURED: Final = 0.02  # of the measured points, of a part that is no mistake


@dataclass(frozen=True, eq=False)
class Grid:
    """A regular grid."""

    first: Array  #: (3,) first node [m]
    cell: float  #: edge of a cell [m]
    shape: tuple[int, int, int]  #: numbers of nodes

    def nearest(self, points: Array) -> NDArray[np.intp]:
        """Return the numbers (n, 3) of the nodes nearest to points (n, 3)."""
        return np.clip(np.rint((points - self.first) / self.cell), 0, np.array(self.shape) - 1).astype(np.intp)

    def gap(self, points: Array) -> Array:
        """Return how far points (n, 3) are from the grid's box [m], 0 inside."""
        last = self.first + self.cell * (np.array(self.shape) - 1)
        return np.linalg.norm(np.maximum(np.maximum(self.first - points, points - last), 0.0), axis=1)

    @property
    def nodes(self) -> Array:
        """All nodes (nx ny nz, 3) [m], the last coordinate fastest."""
        axes = [self.first[k] + self.cell * np.arange(self.shape[k]) for k in range(3)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def grid_around(lower: Array, upper: Array, cell: float, margin: float, most: int = MOST_NODES) -> Grid:
    """Return the grid of that cell that reaches `margin` beyond a box; a coarser one if it had more than `most` nodes.

    Its numbers of nodes are odd, so that every second node is a grid of its own.
    """
    size = upper - lower + 2.0 * margin
    cell = max(cell, float(np.cbrt(np.prod(size) / most)))
    while np.prod(shape := 2 * np.ceil(0.5 * size / cell).astype(int) + 1) > most:
        cell *= 1.01
    return Grid(lower - margin, cell, (int(shape[0]), int(shape[1]), int(shape[2])))


def one_piece(values: Array, measured: NDArray[np.intp] | None = None) -> Array:
    """Return values (nx, ny, nz) whose inside is its largest connected part; other parts become outside.

    A part stays as well if a share `_MEASURED` of the nodes `measured` (n, 3), of the surface, are its own or next to
    it: a thin neck between two parts that were seen is easily lost.

    Raises
    ------
    SureholdError
        If nothing is inside.
    """
    from scipy.ndimage import label, maximum_filter

    inside = values < 0.0
    parts, count = cast("tuple[NDArray[np.int32], int]", label(inside))
    if count == 0:
        raise SureholdError("the surface encloses nothing on its grid; its observations leave no room for an object.")
    if count == 1:
        return values
    kept = np.zeros(count + 1, dtype=bool)
    kept[1 + np.argmax(np.bincount(parts.ravel())[1:])] = True
    if measured is not None and len(measured):
        beside = maximum_filter(parts, 3)[tuple(measured.T)]
        kept |= np.bincount(beside, minlength=count + 1) >= _MEASURED * len(measured)
    return np.where(inside & ~kept[parts], -values, values)


def distances_of(values: Array, grid: Grid) -> DistanceField:
    """Return the signed distance of the surface of values (nx, ny, nz) on a grid, see above."""
    nodes, lower, upper = _distances(np.ascontiguousarray(values), grid.first, grid.cell)
    return DistanceField(nodes, np.concatenate([grid.first, [grid.cell], lower, upper]))


def level_set_mesh(values: Array, grid: Grid, level: float = 0.0) -> tuple[Array, NDArray[np.int32]]:
    """Return vertices (v, 3) [m] and faces (f, 3) of the surface f = level, counterclockwise seen from outside.

    Raises MissingExtra if the extra "mesh" is not installed.
    """
    require("mesh", "the mesh of a believed shape")
    import igl

    padded = np.pad(values, 1, constant_values=float(np.abs(values).max()))  # closed where it leaves the grid
    x, y, z = (grid.first[k] + grid.cell * np.arange(-1, grid.shape[k] + 1) for k in range(3))
    corners = np.stack(np.meshgrid(z, y, x, indexing="ij"), axis=-1).reshape(-1, 3)[:, ::-1]  # x is the fastest
    nx, ny, nz = padded.shape
    ordered = np.ascontiguousarray(padded.transpose(2, 1, 0).ravel())
    made = igl.marching_cubes(ordered, np.ascontiguousarray(corners), nx, ny, nz, level)
    vertices, faces = np.asarray(made[0], dtype=np.float64), np.asarray(made[1], dtype=np.int32)
    corner = vertices[faces]
    volume = np.einsum("fi,fi->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2]))
    return vertices, np.ascontiguousarray(faces[:, ::-1] if volume < 0.0 else faces)


@njit(cache=True)
def _slope(values, i, j, k, axis, h):
    """Return the derivative of the values along an axis at a node, one-sided at the border."""
    low = (i - (axis == 0), j - (axis == 1), k - (axis == 2))
    high = (i + (axis == 0), j + (axis == 1), k + (axis == 2))
    steps = 2.0
    if low[axis] < 0:
        low, steps = (i, j, k), 1.0
    if high[axis] >= values.shape[axis]:
        high, steps = (i, j, k), 1.0
    return (values[high] - values[low]) / (steps * h)


@njit(cache=True)
def _crossings(values, first, h):
    """Return the crossings (s, 6): place, unit normal, and for each node the number of its nearest one so far or -1."""
    nx, ny, nz = values.shape
    nearest = np.full((nx, ny, nz), -1, dtype=np.int64)
    best = np.full((nx, ny, nz), np.inf)
    rows = np.empty((1024, 6))
    n = 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                here = values[i, j, k]
                for axis in range(3):
                    a, b, c = i + (axis == 0), j + (axis == 1), k + (axis == 2)
                    if a >= nx or b >= ny or c >= nz or (here < 0.0) == (values[a, b, c] < 0.0):
                        continue
                    share = here / (here - values[a, b, c])
                    if n == len(rows):
                        rows = np.concatenate((rows, np.empty((n, 6))))
                    size = 0.0
                    for m in range(3):
                        start = (i, j, k)[m]
                        rows[n, m] = first[m] + h * (start + (share if m == axis else 0.0))
                        slope = (1.0 - share) * _slope(values, i, j, k, m, h) + share * _slope(values, a, b, c, m, h)
                        rows[n, 3 + m] = slope
                        size += slope * slope
                    size = np.sqrt(size)
                    for m in range(3):
                        rows[n, 3 + m] = rows[n, 3 + m] / size if size > 0.0 else (1.0 if m == axis else 0.0)
                    for end in range(2):
                        u, v, w = (a, b, c) if end else (i, j, k)
                        gap = (1.0 - share if end else share) * h
                        if gap < best[u, v, w]:
                            best[u, v, w], nearest[u, v, w] = gap, n
                    n += 1
    return rows[:n], nearest


@njit(cache=True)
def _sweep(rows, nearest, first, h):
    """Let every node take over the crossing of a neighbor, where that is nearer, in eight orders of the nodes."""
    nx, ny, nz = nearest.shape
    squared = np.full((nx, ny, nz), np.inf)
    for order in range(9):  # the first round only measures
        si, sj, sk = (1 if order & 1 else -1), (1 if order & 2 else -1), (1 if order & 4 else -1)
        for ii in range(nx):
            i = ii if si > 0 else nx - 1 - ii
            x = first[0] + h * i
            for jj in range(ny):
                j = jj if sj > 0 else ny - 1 - jj
                y = first[1] + h * j
                for kk in range(nz):
                    k = kk if sk > 0 else nz - 1 - kk
                    z = first[2] + h * k
                    if order == 0:
                        s = nearest[i, j, k]
                        if s >= 0:
                            dx, dy, dz = x - rows[s, 0], y - rows[s, 1], z - rows[s, 2]
                            squared[i, j, k] = dx * dx + dy * dy + dz * dz
                        continue
                    for corner in range(1, 8):  # the neighbors behind, across corners as well
                        a = i - si * (corner & 1)
                        b = j - sj * (corner >> 1 & 1)
                        c = k - sk * (corner >> 2 & 1)
                        if a < 0 or b < 0 or c < 0 or a >= nx or b >= ny or c >= nz:
                            continue
                        s = nearest[a, b, c]
                        if s < 0 or s == nearest[i, j, k]:
                            continue
                        dx, dy, dz = x - rows[s, 0], y - rows[s, 1], z - rows[s, 2]
                        d = dx * dx + dy * dy + dz * dz
                        if d < squared[i, j, k]:
                            squared[i, j, k], nearest[i, j, k] = d, s


@njit(cache=True)
def _distances(values, first, h):
    """Return nodes (nx, ny, nz, 4) of a `DistanceField`, and the corners of the box around the crossings."""
    rows, nearest = _crossings(values, first, h)
    _sweep(rows, nearest, first, h)
    nx, ny, nz = values.shape
    nodes = np.empty((nx, ny, nz, 4), dtype=np.float32)
    x, c = np.empty(3), np.empty(3)
    for i in range(nx):
        x[0] = first[0] + h * i
        for j in range(ny):
            x[1] = first[1] + h * j
            for k in range(nz):
                x[2] = first[2] + h * k
                row = rows[nearest[i, j, k]]
                along, square = 0.0, 0.0
                for m in range(3):
                    along += (x[m] - row[m]) * row[3 + m]
                    square += (x[m] - row[m]) ** 2
                aside = square - along * along  # of the crossing, in the plane
                sign = -1.0 if values[i, j, k] < 0.0 else 1.0
                in_plane = aside < 2.0 * h * h and sign * along > 0.0
                size = 0.0
                for m in range(3):
                    c[m] = (along * row[3 + m]) if in_plane else (x[m] - row[m])
                    size += c[m] * c[m]
                size = np.sqrt(size)
                nodes[i, j, k, 0] = sign * size
                for m in range(3):
                    nodes[i, j, k, 1 + m] = sign * c[m] / size if size > 1e-3 * h else row[3 + m]
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for s in range(len(rows)):
        for m in range(3):
            lower[m], upper[m] = min(lower[m], rows[s, m]), max(upper[m], rows[s, m])
    return nodes, lower, upper

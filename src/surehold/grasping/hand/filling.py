"""Boxes that fill a mesh but not its openings, for palms that are frames, shells or forks.

The mesh becomes cells: those that its surface passes, and those that it encloses, are full. The box around all full
cells is cut in two, each part again, and so on: where the two parts, each drawn tight, leave out most empty cells, or
else, because a frame lets go of its opening after several cuts only, where the number of full cells changes most from
slice to slice. Of this tree of boxes the leaves are kept for which

    volume of all boxes + worth x number of boxes

is least (the pruning of Breiman et al. 1984, Classification and Regression Trees). A box that ends at the surface ends
there exactly, not at the border of a cell.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["filling_boxes"]

Array = NDArray[np.float64]
Block = tuple[tuple[int, ...], tuple[int, ...]]  # first cell (3,) and the one behind the last

CELLS: Final = 32  #: along the longest edge of the mesh
SMALLEST_CELL: Final = 0.001  #: [m]
WORTH: Final = 0.03  #: what one box more must save, of the full volume
MOST: Final = 12  #: boxes of one mesh
_GROWN: Final = 48  # leaves before pruning


def filling_boxes(vertices: Array, faces: NDArray[np.integer]) -> list[tuple[Array, Array]]:
    """Return centers (3,) and half extents (3,) [m] of boxes along the axes that fill a mesh (v, 3), (f, 3)."""
    from scipy.ndimage import binary_fill_holes

    pitch = max(float(np.ptp(vertices, axis=0).max()) / CELLS, SMALLEST_CELL)
    points = _surface_points(vertices[faces], 0.5 * pitch)
    lowest = points.min(axis=0)
    count = np.maximum(np.ceil(np.ptp(points, axis=0) / pitch - 1e-6).astype(int), 1)
    cells = np.minimum(((points - lowest) / pitch).astype(int), count - 1)
    full = np.zeros(count, dtype=bool)
    full[tuple(cells.T)] = True
    full = np.asarray(binary_fill_holes(full))
    parts = _grown(full)
    worth, blocks = WORTH * full.sum(), list[Block]()
    while not blocks or len(blocks) > MOST:
        blocks = _pruned(((0, 0, 0), full.shape), parts, worth)[1]
        worth *= 1.5
    return [_box(block, points, cells, lowest, pitch) for block in blocks]


def _surface_points(corners: Array, spacing: float) -> Array:
    """Return points (p, 3) on triangles (f, 3, 3) that are no farther apart than `spacing`."""
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    counts = np.maximum(np.ceil(edges / spacing).astype(int), 1)
    points = []
    for n in np.unique(counts):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inside = i + j <= n
        weights = np.column_stack([(n - i - j)[inside], i[inside], j[inside]]) / n
        points.append(np.einsum("sk,fki->fsi", weights, corners[counts == n]).reshape(-1, 3))
    return np.vstack(points)


def _grown(full: NDArray[np.bool_]) -> dict[Block, tuple[Block, Block]]:
    """Return the two parts of each block of the tree that is cut; the block with most empty cells is cut first."""
    parts: dict[Block, tuple[Block, Block]] = {}
    leaves: dict[Block, int] = {((0, 0, 0), full.shape): int(full.size - full.sum())}
    while len(leaves) < _GROWN:
        block = max(leaves, key=lambda leaf: leaves[leaf])
        if leaves[block] <= 0:
            break
        parts[block] = _cut(full, block)
        del leaves[block]
        for part in parts[block]:
            inside = full[_slices(part)]
            leaves[part] = int(inside.size - inside.sum())
    return parts


def _pruned(block: Block, parts: dict[Block, tuple[Block, Block]], worth: float) -> tuple[float, list[Block]]:
    """Return the least cost of a block, in cells, and the leaves that have it."""
    whole = float(np.prod(np.subtract(block[1], block[0]))) + worth, [block]
    if block not in parts:
        return whole
    (first, some), (second, others) = (_pruned(part, parts, worth) for part in parts[block])
    return (first + second, some + others) if first + second < whole[0] else whole


def _cut(full: NDArray[np.bool_], block: Block) -> tuple[Block, Block]:
    """Return the full cells before and behind the best cut of a block, each part drawn tight."""
    inside = full[_slices(block)]
    best = (-1.0, 0, 0)
    for axis in range(3):
        slices = np.moveaxis(inside, axis, 0)
        count = slices.sum(axis=(1, 2))
        some = np.flatnonzero(count)
        ends = []  # of the full cells of each slice, along the two other axes: (lowest, one behind the highest)
        for other in (2, 1):
            seen = np.asarray(slices.any(axis=other))
            ends.append((seen.argmax(axis=1), seen.shape[1] - seen[:, ::-1].argmax(axis=1)))
        for k in range(1, len(slices)):
            saved = inside.size
            for part in (some[some < k], some[some >= k]):
                spans = [part[-1] - part[0] + 1, *(high[part].max() - low[part].min() for low, high in ends)]
                saved -= int(np.prod(spans))
            # What saves nothing yet counts less than any cut that does: a jump between slices is below one cell.
            score = saved + abs(int(count[k]) - int(count[k - 1])) / (inside[0].size * inside.size)
            best = max(best, (float(score), axis, -k))
    _, axis, k = best
    start, middle = np.array(block[0]), -k + block[0][axis]
    halves = []
    for low, high in ((start[axis], middle), (middle, block[1][axis])):
        lower, upper = start.copy(), np.array(block[1])
        lower[axis], upper[axis] = low, high
        found = np.argwhere(full[tuple(slice(a, b) for a, b in zip(lower, upper, strict=True))]) + lower
        halves.append(tuple(tuple(int(n) for n in end) for end in (found.min(axis=0), found.max(axis=0) + 1)))
    return halves[0], halves[1]


def _slices(block: Block) -> tuple[slice, ...]:
    return tuple(slice(a, b) for a, b in zip(*block, strict=True))


def _box(block: Block, points: Array, cells: NDArray[np.int_], lowest: Array, pitch: float) -> tuple[Array, Array]:
    """Return center and half extents of a block of cells, drawn to the surface points in its outermost cells."""
    ends = np.array(block).T  # (3, 2)
    mine = points[np.all((cells >= ends[:, 0]) & (cells < ends[:, 1]), axis=1)]
    borders = lowest[:, None] + pitch * ends
    if len(mine):
        low, high = mine.min(axis=0), mine.max(axis=0)
        borders[:, 0] = np.where(low < borders[:, 0] + pitch, low, borders[:, 0])
        borders[:, 1] = np.where(high > borders[:, 1] - pitch, high, borders[:, 1])
    return borders.mean(axis=1), 0.5 * np.ptp(borders, axis=1)

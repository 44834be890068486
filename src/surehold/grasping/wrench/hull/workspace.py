"""Memory of an expansion, to be used again by the next one: to ask for it anew takes as long as a third of the work."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.store.kernels import njit

__all__ = ["Workspace", "next_step", "workspace"]

_LATEST = 1 << 30


class Workspace(NamedTuple):
    """Arrays for up to `max_facets` facets. One expansion may use them at a time."""

    vertices: NDArray[np.int32]  #: (max_facets, 6) corners, ascending
    neighbors: NDArray[np.int32]  #: (max_facets, 6) [f, k] lies across the ridge without vertices[f, k]
    planes: NDArray[np.float64]  #: (max_facets, 7) n, d
    height: NDArray[np.float64]  #: (max_facets,) n.s - d
    mark: NDArray[np.int32]  #: (max_facets,) step that last looked at the facet; -1: removed
    keys: NDArray[np.float64]  #: (max_facets,) heap of d
    ids: NDArray[np.int32]  #: (max_facets,) and of facets
    seen: NDArray[np.int32]  #: (max_facets,)
    horizon: NDArray[np.int32]  #: (6 max_facets,) 8 * facet seen + slot of the ridge
    table: NDArray[np.uint64]  #: (cells,) open ridges of new facets: four vertices
    owner: NDArray[np.int32]  #: (cells,) 8 * facet + slot, or -1 if both facets are found
    stamp: NDArray[np.int32]  #: (cells,) step that last wrote to the cell
    clock: NDArray[np.int32]  #: (1,) steps so far


@njit(cache=True)
def workspace(max_facets):
    """Return memory for max_facets facets."""
    cells = 64
    while cells < max_facets:
        cells *= 2
    return Workspace(
        np.empty((max_facets, 6), np.int32),
        np.empty((max_facets, 6), np.int32),
        np.empty((max_facets, 7)),
        np.empty(max_facets),
        np.empty(max_facets, np.int32),
        np.empty(max_facets),
        np.empty(max_facets, np.int32),
        np.empty(max_facets, np.int32),
        np.empty(6 * max_facets, np.int32),
        np.empty(cells, np.uint64),
        np.empty(cells, np.int32),
        np.zeros(cells, np.int32),
        np.zeros(1, np.int32),
    )


@njit(cache=True)
def next_step(work):
    """Return the number of the next step, which no mark and no stamp has."""
    if work.clock[0] >= _LATEST:
        work.clock[0] = 0
        work.stamp[:] = 0
        work.mark[work.mark > 0] = 0
    work.clock[0] += 1
    return work.clock[0]

"""The largest hole among trials: where nothing has been tried yet."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import HOLE_BEYOND, HOLE_CANDIDATES

__all__ = ["largest_holes"]


class _Admits(Protocol):
    def possible(self, U: NDArray[np.float64]) -> NDArray[np.bool_]: ...

    def log_probability(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...


def largest_holes(
    points: NDArray[np.float64], rng: np.random.Generator, admission: _Admits | None = None
) -> NDArray[np.float64]:
    """Return points (c, d) of a Sobol sequence, the center of the largest empty ball first.

    Empty of `points` (n, d), and reaching beyond the cube by no more than half its radius: the corners are farthest
    from everything, and seldom where the answer is. With an `admission` only centers that can be tried are returned,
    and a hole counts as far as what is required there is likely to hold.
    """
    from scipy.spatial import KDTree
    from scipy.stats import qmc

    centers = qmc.Sobol(points.shape[1], rng=rng).random(HOLE_CANDIDATES)
    border = np.minimum(centers, 1.0 - centers).min(axis=1)
    radius = np.minimum(KDTree(points).query(centers)[0], border / HOLE_BEYOND)
    if admission is not None:
        possible = admission.possible(centers)
        centers, radius = centers[possible], radius[possible]
        radius = radius * np.exp(admission.log_probability(centers)[0])
    return centers[np.argsort(-radius, kind="stable")]

"""The largest hole among trials: where nothing has been tried yet."""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import HOLE_BEYOND, HOLE_CANDIDATES

__all__ = ["largest_holes"]


def largest_holes(points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return points (c, d) of a Sobol sequence, the center of the largest empty ball first.

    Empty of `points` (n, d), and reaching beyond the cube by no more than half its radius: the corners are farthest
    from everything, and seldom where the answer is.
    """
    from scipy.spatial import KDTree
    from scipy.stats import qmc

    centers = qmc.Sobol(points.shape[1], rng=rng).random(HOLE_CANDIDATES)
    border = np.minimum(centers, 1.0 - centers).min(axis=1)
    radius = np.minimum(KDTree(points).query(centers)[0], border / HOLE_BEYOND)
    return centers[np.argsort(-radius, kind="stable")]

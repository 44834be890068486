"""Gradients by central differences, of functions without a derivative of their own."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import DIFFERENCE_STEP

__all__ = ["by_differences"]


def by_differences(
    objective: Callable[[NDArray[np.float64]], NDArray[np.float64]], U: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return values (q,) and gradients (q, d) of an objective at U (q, d), in one call of the objective."""
    q, d = U.shape
    steps = DIFFERENCE_STEP * np.eye(d)
    around = (U[:, None, :] + np.concatenate([steps, -steps])).reshape(-1, d)
    values = objective(np.concatenate([U, around]))
    sides = values[q:].reshape(q, 2, d)
    return values[:q], (sides[:, 0] - sides[:, 1]) / (2.0 * DIFFERENCE_STEP)

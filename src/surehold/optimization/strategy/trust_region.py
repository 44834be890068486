"""A box around the best trial in which the next one is sought: for many variables, where a model of all is too vague.

Eriksson et al. 2019 (TuRBO). The box grows after trials that improved on the best value and shrinks after trials that
did not; here its side is worked out anew from the history of values, so that no state has to be stored. A box that has
become too small starts again at its first size, around the best trial so far.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.surrogates.protocol import Regions

__all__ = ["box_around", "side_after"]

_FIRST: Final = 0.8
_LARGEST: Final = 1.6
_SMALLEST: Final = 0.5**7
_SUCCESSES: Final = 3  # in a row, after which the box grows
_FAILURES: Final = 4  # in a row, or as many as there are variables if these are more, after which it shrinks
_IMPROVEMENT: Final = 1e-3  # of the best value's size, below which a trial does not count as better


def side_after(values: NDArray[np.float64], n_initial: int, d: int) -> float:
    """Return the side of the box, in box widths of the search space, after trials with values (n,) in d variables.

    The first `n_initial` trials count as the design.
    """
    side, successes, failures = _FIRST, 0, 0
    patience = max(_FAILURES, d)
    best = -np.inf
    for i, value in enumerate(values):
        better = value > best + (_IMPROVEMENT * abs(best) if np.isfinite(best) else 0.0)
        best = max(best, value)
        if i < n_initial:
            continue
        successes, failures = (successes + 1, 0) if better else (0, failures + 1)
        if successes == _SUCCESSES:
            side, successes = min(2.0 * side, _LARGEST), 0
        elif failures == patience:
            side, failures = 0.5 * side, 0
            if side < _SMALLEST:
                side = _FIRST
    return side


def box_around(center: NDArray[np.float64], side: float) -> Regions:
    """Return the part of the unit cube in a box with this center (d,) and side."""
    lower, upper = np.clip(center - 0.5 * side, 0.0, 1.0), np.clip(center + 0.5 * side, 0.0, 1.0)
    return Regions(lower[None, :], upper[None, :])

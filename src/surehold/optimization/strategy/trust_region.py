"""A box around the best trial in which the next one is sought: for many variables, where a model of all is too vague.

Eriksson et al. 2019 (TuRBO). The box grows after trials that improved on the best value and shrinks after trials that
did not; here its side is worked out anew from the history of values, so that no state has to be stored. A box that has
become too small starts again at its first size, around the best trial so far.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    TRUST_FAILURES,
    TRUST_FIRST,
    TRUST_IMPROVEMENT,
    TRUST_LARGEST,
    TRUST_SMALLEST,
    TRUST_SUCCESSES,
)
from surehold.optimization.surrogates.protocol import Regions

__all__ = ["TrustRegion", "box_around", "side_after"]


@dataclass(frozen=True)
class TrustRegion:
    """The box in which the next trial is sought; `n_initial` trials belong to the initial design."""

    n_initial: int

    def within(self, regions: Regions, center: NDArray[np.float64], values: NDArray[np.float64]) -> Regions:
        """Return the parts of regions inside the box around a center (d,), after trials with values (n,)."""
        return regions.within(box_around(center, side_after(values, self.n_initial, len(center))))


def side_after(values: NDArray[np.float64], n_initial: int, d: int) -> float:
    """Return the side of the box, in box widths of the search space, after trials with values (n,) in d variables.

    The first `n_initial` trials count as the design.
    """
    side, successes, failures = TRUST_FIRST, 0, 0
    patience = max(TRUST_FAILURES, d)
    best = -np.inf
    for i, value in enumerate(values):
        better = value > best + (TRUST_IMPROVEMENT * abs(best) if np.isfinite(best) else 0.0)
        best = max(best, value)
        if i < n_initial:
            continue
        successes, failures = (successes + 1, 0) if better else (0, failures + 1)
        if successes == TRUST_SUCCESSES:
            side, successes = min(2.0 * side, TRUST_LARGEST), 0
        elif failures == patience:
            side, failures = 0.5 * side, 0
            if side < TRUST_SMALLEST:
                side = TRUST_FIRST
    return side


def box_around(center: NDArray[np.float64], side: float) -> Regions:
    """Return the part of the unit cube in a box with this center (d,) and side."""
    lower, upper = np.clip(center - 0.5 * side, 0.0, 1.0), np.clip(center + 0.5 * side, 0.0, 1.0)
    return Regions(lower[None, :], upper[None, :])

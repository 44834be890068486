"""Deep values, compressed for the search where the trials speak for it.

Legend
    y       values of trials (t,)
    b, m    best value and median of those that judge
    S       b - m
    z       y above m; m - S log(1 + (m - y) / S) below: increasing, with a slope of 1 at m

Whoever looks for the highest place need not know how deep a valley is, but a Gaussian process that must explain a fall
of a thousand is unsure of a tenth at the top. As trials gather about the best place, S shrinks with them. A response
of one size everywhere is better left as it is: z is taken only where a Gaussian process makes it likelier,

    log p(z | X) + sum_i log dz_i/dy_i > log p(y | X),

as transforms are chosen by Box and Cox (1964) and, for Gaussian processes, by Snelson, Rasmussen and Ghahramani (2003).
"""

from math import log
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import LOW_TAIL_FROM, MANY_LEARNT
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess, learnt_from

__all__ = ["LowTail", "low_tail_of"]

_JUDGE: Final = GaussianProcess()


class LowTail(NamedTuple):
    """The map from y to z."""

    middle: float
    """m"""
    size: float
    """S, positive"""

    def apply(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return z (t,)."""
        return np.where(y < self.middle, self.middle - self.size * np.log1p(self._depth(y)), y)

    def log_slopes(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return log dz/dy (t,)."""
        return -np.log1p(self._depth(y))

    def _depth(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.maximum(self.middle - y, 0.0) / self.size


def low_tail_of(X: NDArray[np.float64], y: NDArray[np.float64]) -> LowTail | None:
    """Return how the values y (t,) at X (t, d) of the unit cube are compressed; None where they stay as they are.

    It rests on the trials from which hyperparameters are learnt, so that it seldom changes.
    """
    k = learnt_from(len(y))
    some = slice(0, k, -(-k // MANY_LEARNT))
    X, y = X[some], y[some]
    if len(y) < LOW_TAIL_FROM:
        return None
    middle = float(np.median(y))
    tail = LowTail(middle, float(y.max()) - middle)
    with np.errstate(all="ignore"):
        z = tail.apply(y)
    if tail.size <= 0.0 or not np.all(np.isfinite(z)):
        return None
    gain = _log_evidence(X, z) + float(tail.log_slopes(y).sum()) - _log_evidence(X, y)
    return tail if gain > 0.0 else None


def _log_evidence(X: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    outputs = _JUDGE.standardization(y)
    return _JUDGE.log_evidence(X, y, outputs) - len(y) * log(outputs.scale)

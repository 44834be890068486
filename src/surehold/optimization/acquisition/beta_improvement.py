"""Expected improvement of a probability that is Beta distributed, as the smoothed beta process has it.

Legend
    m, v      mean and variance of the probability P, or of its average over the input noise
    N         m (1 - m) / v - 1;  alpha = m N, beta = (1 - m) N: the Beta distribution of these moments
    p+        the largest expected probability at inputs that were tried
    S(a, b)   P(P > p+) of Beta(a, b)
    EI        E max(P - p+, 0) = m S(alpha + 1, beta) - p+ S(alpha, beta)
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincc

from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.numerics.differences import by_differences
from surehold.optimization.surrogates.protocol import Posterior, mixture

__all__ = ["BetaImprovement", "beta_improvement"]

_SMALLEST: Final = 1e-16  # below, EI is a difference of rounding errors
_STEP: Final = 1e-4  # of differences, as a share of v, m and 1 - m


def beta_improvement(m: NDArray[np.float64], v: NDArray[np.float64], best: float) -> NDArray[np.float64]:
    """Return EI, of the shape of m, for 0 < m < 1 and 0 < v < m (1 - m)."""
    total = m * (1.0 - m) / v - 1.0
    alpha, beta = m * total, (1.0 - m) * total
    return m * betaincc(alpha + 1.0, beta, best) - best * betaincc(alpha, beta, best)


class BetaImprovement:
    """The logarithm of EI; of the average over the input noise, the Beta distribution of its mean and variance."""

    nature: Final = "logarithm"

    def __init__(self, posterior: Posterior, perturbations: Perturbations, best: float):
        self._posterior = posterior
        self._perturbations = perturbations
        self._best = min(max(best, 0.0), 1.0)

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (q,) at U (q, d)."""
        return np.log(np.maximum(beta_improvement(*self._within(U), self._best), _SMALLEST))

    def with_gradient(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the values (q,) and their gradients (q, d) at U (q, d)."""
        if self._perturbations.unknown_slopes:
            return by_differences(self, U)
        moments = self._perturbations.outcome(self._posterior, U, gradient=True)
        if moments.mean_gradient is None or moments.variance_gradient is None:
            raise ValueError("moments came without gradients")
        m, v = self._within(U)
        value = np.maximum(beta_improvement(m, v, self._best), _SMALLEST)
        # the incomplete beta function has no derivative in closed form by its parameters
        wide, long = _STEP * np.minimum(m, 1.0 - m), _STEP * v
        by_m = (beta_improvement(m + wide, v, self._best) - beta_improvement(m - wide, v, self._best)) / (2.0 * wide)
        by_v = (beta_improvement(m, v + long, self._best) - beta_improvement(m, v - long, self._best)) / (2.0 * long)
        slope = by_m[:, None] * moments.mean_gradient.mean(axis=0)
        slope += by_v[:, None] * moments.variance_gradient.mean(axis=0)
        return np.log(value), np.where(value[:, None] > _SMALLEST, slope / value[:, None], 0.0)

    def _within(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return m and v (q,), kept inside of what a Beta distribution can have."""
        m, v = mixture(self._perturbations.outcome(self._posterior, U))
        m = np.clip(m, 1e-9, 1.0 - 1e-9)
        return m, np.clip(v, 1e-12, 0.999 * m * (1.0 - m))

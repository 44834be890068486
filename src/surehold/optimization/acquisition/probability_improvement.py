"""Expected improvement of a probability of success: not of the latent function behind it (Tesch et al. 2013).

Legend
    mu, v   mean and variance of the latent f under one particle, sd = sqrt(v)
    p+      the largest expected probability at inputs that were tried
    EI      E max(Phi(f) - p+, 0) = int_{p+}^1 P(Phi(f) > p) dp = int_{p+}^1 Phi((mu - Phi^-1(p)) / sd) dp
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from surehold.optimization.surrogates.success.posterior import SuccessPosterior

__all__ = ["ProbabilityImprovement", "improvement"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
_SMALLEST: Final = 1e-300


def improvement(
    mu: NDArray[np.float64], sd: NDArray[np.float64], best: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return EI and its derivatives by mu and sd, of the shape of mu."""
    p = best + 0.5 * (1.0 - best) * (_NODES + 1.0)
    weights = 0.5 * (1.0 - best) * _WEIGHTS
    narrow = np.maximum(sd, 1e-9)[..., None]
    z = (mu[..., None] - ndtri(p)) / narrow
    density = np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi) / narrow
    return ndtr(z) @ weights, density @ weights, (-z * density) @ weights


class ProbabilityImprovement:
    """The logarithm of EI, averaged over particles, where inputs are reached exactly."""

    nature: Final = "logarithm"

    def __init__(self, posterior: SuccessPosterior, best: float):
        self._latent = posterior.latent
        self._best = min(max(best, 0.0), 1.0 - 1e-9)

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (q,) at U (q, d)."""
        moments = self._latent.moments(U)
        value = improvement(moments.mean, np.sqrt(moments.variance), self._best)[0]
        return np.log(np.maximum(value.mean(axis=0), _SMALLEST))

    def with_gradient(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the values (q,) and their gradients (q, d) at U (q, d)."""
        moments = self._latent.moments(U, gradient=True)
        if moments.mean_gradient is None or moments.variance_gradient is None:
            raise ValueError("moments came without gradients")
        sd = np.sqrt(np.maximum(moments.variance, 1e-18))
        value, by_mu, by_sd = improvement(moments.mean, sd, self._best)
        total = np.maximum(value.mean(axis=0), _SMALLEST)
        slopes = by_mu[..., None] * moments.mean_gradient + (by_sd / (2.0 * sd))[..., None] * moments.variance_gradient
        return np.log(total), slopes.mean(axis=0) / total[:, None]

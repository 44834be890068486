"""The probability that further outputs of a trial are within their limits.

Legend
    c(x)     an output, such as a torque; a posterior describes it, particle by particle (j)
    l, u     its lower and upper limit
    m, v     mean and variance, under a particle, of c averaged over the input noise (of c itself without noise)
    s        standard deviation of the particle's mean of c over the input noise: how far executions differ
    k        standard deviations of executions that are to stay within, Phi^-1(level)
    a, b     (l - m + k s) / sqrt(v) and (u - m - k s) / sqrt(v)

Without input noise the probability that c is within its limits is the mean over particles of Phi(b) - Phi(a)
(Schonlau, Welch and Jones 1998; Gelbart, Snoek and Adams 2014). With input noise an input is feasible if the share
`level` of its executions is; the probability of that is the same expression with k > 0, exact where c is linear over
the noise and the noise is Gaussian.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp, ndtr

from surehold.optimization.limits import Limit
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.numerics.differences import by_differences
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["Within", "execution_probability", "interval", "log_interval"]

_LOG_SQRT_2PI: Final = 0.5 * np.log(2.0 * np.pi)
_FARTHEST: Final = 1e8  # a distance of more standard deviations is treated as this: squares stay finite
_NARROWEST: Final = 1e-6  # an interval of fewer standard deviations, or turned over by the noise, counts as this


class Within:
    """The requirement that an output is within its limits, in the share of executions that `spreads` stands for."""

    def __init__(self, posterior: Posterior, limit: Limit, perturbations: Perturbations, spreads: float):
        self._posterior: Final = posterior
        self._limit: Final = limit
        self._perturbations: Final = perturbations
        self._spreads: Final = spreads if len(perturbations.quadrature.weights) > 1 else 0.0

    def log_probability(
        self, U: NDArray[np.float64], gradient: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the logarithm of the probability (q,) at U (q, d), and its gradients (q, d) where asked for."""
        if gradient and self._perturbations.unknown_slopes:
            return by_differences(lambda V: self.log_probability(V)[0], U)
        q, d = U.shape
        moments = self._perturbations.outcome(self._posterior, U, gradient)
        mean, variance = moments.mean, np.maximum(moments.variance, 1e-290)
        spread, spread_slope = self._spread(U, gradient)
        sigma = np.maximum(np.sqrt(variance), np.abs(mean) / _FARTHEST**1.5)
        a = np.minimum((self._limit.lower - mean + spread) / sigma, _FARTHEST)
        b = np.maximum((self._limit.upper - mean - spread) / sigma, -_FARTHEST)
        logs, by_a, by_b = log_interval(a, b)
        total = logsumexp(logs, axis=0) - np.log(len(logs))
        if not gradient:
            return total, np.zeros((0, d))
        share = np.exp(logs - np.asarray(logsumexp(logs, axis=0)))[..., None]  # (m, q, 1)
        mean_slope, variance_slope = moments.mean_gradient, moments.variance_gradient
        if mean_slope is None or variance_slope is None:
            raise ValueError("moments were asked for without gradients")
        half = 0.5 * variance_slope / variance[..., None]
        slope = np.zeros((len(mean), q, d))
        for end, by_end, sign in ((a, by_a, 1.0), (b, by_b, -1.0)):
            finite = np.where(np.isfinite(end), end, 0.0)[..., None]
            slope += by_end[..., None] * ((sign * spread_slope - mean_slope) / sigma[..., None] - finite * half)
        return total, (share * slope).sum(axis=0)

    def _spread(self, U: NDArray[np.float64], gradient: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return k s (m, q) and its gradients (m, q, d), zeros (1, 1, 1) where not asked for."""
        level = np.zeros((1, 1, 1))
        if self._spreads == 0.0:
            return level[0], level
        weights = self._perturbations.quadrature.weights
        moments, slopes = self._perturbations.spread(self._posterior, U, gradient)
        m, q, d = len(moments.mean), *U.shape
        mu = moments.mean.reshape(m, q, -1)
        apart = mu - (mu @ weights)[..., None]
        s = np.sqrt(np.maximum(np.square(apart) @ weights, 1e-290))
        if not gradient or moments.mean_gradient is None:
            return self._spreads * s, level
        slope = moments.mean_gradient.reshape(m, q, len(weights), d)
        if slopes is not None:
            slope = slope * slopes
        return self._spreads * s, self._spreads * np.einsum("mqs,mqsd->mqd", apart * weights, slope) / s[..., None]


def execution_probability(
    outputs: Sequence[tuple[Posterior, Limit]],
    perturbations: Perturbations,
    U: NDArray[np.float64],
    *,
    cautious: bool = False,
) -> NDArray[np.float64]:
    """Return the probability (q,) that one execution at U (q, d) keeps every output within its limits.

    Over the input noise and what the models do not know, without the noise of observations; given where the execution
    is, outputs count as independent.
    `cautious`: by the particle of each model that sees least chance, in place of their mean.
    """
    together = np.ones((len(U), len(perturbations.quadrature.weights)))
    for posterior, limit in outputs:
        moments, _ = perturbations.spread(posterior, U)  # (m, q s)
        sigma = np.sqrt(np.maximum(moments.variance, 1e-290))
        a, b = (limit.lower - moments.mean) / sigma, (limit.upper - moments.mean) / sigma
        kept = interval(a, b)  # (m, q s)
        together *= (kept.min(axis=0) if cautious else kept.mean(axis=0)).reshape(together.shape)
    return together @ perturbations.quadrature.weights


def interval(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Phi(b) - Phi(a) for a <= b, without cancellation in the upper tail."""
    flipped = a > 0.0
    return np.where(flipped, ndtr(-a) - ndtr(-b), ndtr(b) - ndtr(a))


def log_interval(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return log (Phi(b) - Phi(a)) and its derivatives by a and b; finite wherever a < inf and b > -inf.

    An interval that is turned over or narrower than 1e-6 counts as one of that width around its middle.
    """
    with np.errstate(invalid="ignore"):
        narrow = b - a < _NARROWEST
        middle = 0.5 * (np.where(narrow, a, 0.0) + np.where(narrow, b, 0.0))
    a = np.where(narrow, middle - 0.5 * _NARROWEST, a)
    b = np.where(narrow, middle + 0.5 * _NARROWEST, b)
    flipped = a > 0.0
    low, high = np.where(flipped, -b, a), np.where(flipped, -a, b)  # low <= 0 unless both ends are far below
    upper, lower = log_ndtr(high), log_ndtr(low)
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = np.where(np.isneginf(lower), 0.0, np.log1p(-np.exp(np.minimum(lower - upper, 0.0))))
        # in the tail the two logarithms agree in all digits: there the density times the width
        density = -0.5 * high * high - _LOG_SQRT_2PI + np.log(np.where(np.isfinite(low), high - low, 1.0))
    value = np.where(np.isfinite(difference), upper + difference, density)
    with np.errstate(over="ignore"):
        by_a = -np.exp(np.minimum(-0.5 * a * a - _LOG_SQRT_2PI - value, 700.0))
        by_b = np.exp(np.minimum(-0.5 * b * b - _LOG_SQRT_2PI - value, 700.0))
    by_either = -0.5 * middle  # of a width that stays as it is
    return value, np.where(narrow, by_either, by_a), np.where(narrow, by_either, by_b)

"""The quantity that is maximized to choose the next trial: a criterion, averaged over particles and input noise.

Three scales, for a criterion c and the sigma points xi_i, w_i of the input noise:
    exact       mean_j c(f_j(x))                     the input is reached exactly
    unscented   sum_i w_i mean_j c(f_j(x + xi_i))    the criterion is averaged, thesis (3.20)
    robust      mean_j c(g_j(x))                     the outcome is averaged: g = sum_i w_i f(x + xi_i)
where f_j is the posterior under particle j and c stands for its value at a mean and a standard deviation.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from surehold.errors import unknown_name
from surehold.optimization.acquisition.criteria import (
    Value,
    expected_improvement,
    log_expected_improvement,
    probability_of_improvement,
    upper_confidence_bound,
)
from surehold.optimization.maximizer.ascent import by_differences
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.surrogates.protocol import Moments, Posterior

__all__ = ["CRITERIA", "Acquisition", "CriterionName", "criterion_name", "where_to_look"]

_BASES: Final = ("ei", "log_ei", "pi", "ucb")
CRITERIA: Final = (
    *_BASES,
    *(f"u{base}" for base in _BASES),
    *(f"robust_{base}" for base in _BASES),
    "thompson",
    "robust_thompson",
)

# A trial at the very place may become the answer, one beside it seldom does; and in several dimensions there is always
# some sigma point that tells a little more. With 1, needles in 3 and 5 dimensions take twice the trials.
_AT_THE_PLACE: Final = 3.0

Scale = Literal["exact", "unscented", "robust"]


@dataclass(frozen=True)
class CriterionName:
    """A criterion's public name, taken apart."""

    base: str
    """"ei", "log_ei", "pi", "ucb" or "thompson" """
    scale: Scale


def criterion_name(name: str) -> CriterionName:
    """Take a public name ("uei", "robust_log_ei", ...) apart; raises InputError for an unknown one."""
    if name not in CRITERIA:
        raise unknown_name("criterion", name, CRITERIA)
    if name.startswith("robust_"):
        return CriterionName(name.removeprefix("robust_"), "robust")
    if name in _BASES or name == "thompson":
        return CriterionName(name, "exact")
    return CriterionName(name[1:], "unscented")


class Acquisition:
    """A criterion on a posterior; larger is better. "log_ei" gives the logarithm of the averaged improvement.

    Parameters
    ----------
    posterior
        The surrogate, conditioned on the trials.
    name
        Criterion and scale.
    perturbations
        Quadrature of the input noise; a single zero offset where the scale is "exact".
    best
        Value of the incumbent on the scale of the criterion: a number, or (m, 1) for one a particle.
    margin
        Improvement that does not count, in the outputs' units.
    kappa
        Standard deviations added by "ucb".
    """

    def __init__(
        self,
        posterior: Posterior,
        name: CriterionName,
        perturbations: Perturbations,
        best: float | NDArray[np.float64],
        *,
        margin: float = 0.0,
        kappa: float = 2.0,
    ):
        self._posterior = posterior
        self._name = name
        self._perturbations = perturbations
        self._best = best
        self._margin = margin
        self._kappa = kappa

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (q,) at points U (q, d) of the unit cube."""
        return self._evaluate(U, False)[0]

    def with_gradient(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the values (q,) and their gradients (q, d) at points U (q, d)."""
        if self._perturbations.root is not None:  # of noise that varies, by a user's function without a derivative
            return by_differences(self, U)
        return self._evaluate(U, True)

    def _evaluate(self, U: NDArray[np.float64], gradient: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        q, d = U.shape
        slopes = None
        if self._name.scale == "unscented":
            moments, slopes = self._perturbations.spread(self._posterior, U, gradient)  # (m, q s)
            weights = self._perturbations.quadrature.weights
        else:
            moments = self._perturbations.outcome(self._posterior, U, gradient)  # (m, q)
            weights = np.ones(1)
        std = np.sqrt(moments.variance)
        c = self._criterion(moments.mean, std)
        m, s = len(std), len(weights)
        share = np.broadcast_to(weights / m, (m, q, s))
        values = c.value.reshape(m, q, s)
        if self._name.base == "log_ei":
            value, factor = _log_of_sum(values, share)
        else:
            value, factor = (share * values).sum(axis=(0, 2)), share
        if not gradient:
            return value, np.empty((0, d))
        slope = _slope(moments, std, c).reshape(m, q, s, d)
        if slopes is not None:
            slope = slope * slopes
        return value, np.einsum("mqs,mqsd->qd", factor, slope)

    def _criterion(self, mean: NDArray[np.float64], std: NDArray[np.float64]) -> Value:
        if self._name.base == "log_ei":
            return log_expected_improvement(mean, std, self._best, self._margin)
        if self._name.base == "ei":
            return expected_improvement(mean, std, self._best, self._margin)
        if self._name.base == "pi":
            return probability_of_improvement(mean, std, self._best, self._margin)
        return upper_confidence_bound(mean, std, self._kappa)


def _slope(moments: Moments, std: NDArray[np.float64], c: Value) -> NDArray[np.float64]:
    """Return dc/dx (m, q, d) by the chain rule; the standard deviation's kink at 0 counts as level."""
    mean_gradient, variance_gradient = moments.mean_gradient, moments.variance_gradient
    if mean_gradient is None or variance_gradient is None:
        raise ValueError("moments were asked for without gradients")
    by_variance = np.divide(c.by_std, 2.0 * std, out=np.zeros_like(std), where=std > 0.0)
    return c.by_mean[:, :, None] * mean_gradient + by_variance[:, :, None] * variance_gradient


def _log_of_sum(
    logs: NDArray[np.float64], share: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return log sum share exp(logs) over particles and points (q,), and its derivative by each log (m, q, s).

    A negative center weight can make the sum negative: the logarithm is then -inf and the derivative 0.
    """
    top = logs.max(axis=(0, 2))
    terms = share * np.exp(logs - top[:, None])
    total = terms.sum(axis=(0, 2))
    positive = total > 0.0
    safe = np.where(positive, total, 1.0)
    value = np.where(positive, top + np.log(safe), -np.inf)
    return value, np.where(positive[:, None], terms / safe[:, None], 0.0)


def where_to_look(
    posterior: Posterior,
    u: NDArray[np.float64],
    perturbations: Perturbations,
    steps: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return points (c, d) of the cube around u (d,), the one that tells most about g(u) first.

    Trying u itself does not remove the uncertainty about its outcome under input noise. Among u, u + step and
    u + step / 2 for the given steps (s, d), the trial z reduces the variance of g(u) by
    cov(g(u), f(z))^2 / (var f(z) + noise). The covariance comes from var(g + f) = var g + var f + 2 cov(g, f).
    What u itself tells counts threefold.
    """
    steps = steps[np.any(steps != 0.0, axis=1)]
    points = np.clip(u + np.concatenate([np.zeros((1, len(u))), steps, 0.5 * steps]), 0.0, 1.0)
    offsets = perturbations.around(u[None, :])[0] - u  # (s, d)
    weights = np.append(perturbations.quadrature.weights, 1.0)
    variance_g = posterior.average(u[None, :], offsets, weights[:-1]).variance  # (m, 1)
    variance_f = posterior.moments(points).variance  # (m, c)
    together = np.concatenate(
        [np.tile(offsets, (len(points), 1, 1)), (points - u)[:, None, :]], axis=1
    )  # (c, s + 1, d)
    both = posterior.average(np.tile(u, (len(points), 1)), together, weights).variance
    covariance = 0.5 * (both - variance_g - variance_f)  # (m, c)
    total = variance_f + posterior.noise_variance(points)
    share = np.divide(covariance, np.sqrt(total), out=np.zeros_like(total), where=total > 0.0)
    gain = np.mean(share**2, axis=0)
    gain[0] *= _AT_THE_PLACE
    return points[np.argsort(-gain, kind="stable")]

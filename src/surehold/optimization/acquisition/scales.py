"""The acquisition function: a criterion, averaged over particles and input noise.

Three scales, for a criterion c and the points xi_i, with weights w_i, of a quadrature of the input noise:
    exact       mean_j c(f_j(x))                     the input is reached exactly
    unscented   sum_i w_i mean_j c(f_j(x + xi_i))    the criterion is averaged, thesis (3.20)
    robust      mean_j c(g_j(x))                     the outcome is averaged: g = sum_i w_i f(x + xi_i)
where f_j is the posterior under particle j and c its value at a mean and a standard deviation.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import KAPPA
from surehold.errors import unknown_name
from surehold.optimization.acquisition.criteria import (
    Value,
    expected_improvement,
    log_expected_improvement,
    probability_of_improvement,
    upper_confidence_bound,
)
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.numerics.differences import by_differences
from surehold.optimization.surrogates.protocol import Moments, Posterior

__all__ = ["CRITERIA", "Acquisition", "CriterionName", "criterion_name"]

_BASES: Final = ("ei", "log_ei", "pi", "ucb")  # those that have a formula
_UNSCENTED: Final = {"uei": "ei", "ulog_ei": "log_ei"}
CRITERIA: Final = (*_BASES, *_UNSCENTED, *(f"robust_{base}" for base in _BASES), "thompson", "robust_thompson")

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
    if name in _UNSCENTED:
        return CriterionName(_UNSCENTED[name], "unscented")
    return CriterionName(name, "exact")


class Acquisition:
    """A criterion on a posterior; larger is better. "log_ei" is the logarithm of the averaged improvement.

    Parameters
    ----------
    posterior
        The surrogate, conditioned on the trials.
    name
        Criterion and scale. Thompson sampling has no acquisition function.
    perturbations
        Quadrature of the input noise; a single zero offset where the scale is "exact".
    best
        Value of the incumbent on the scale of the criterion: a number, or (m, 1) for one per particle.
    margin
        Improvement that does not count, in the outputs' units.
    kappa
        Standard deviations added by "ucb".

    Raises
    ------
    InputError
        If the criterion has no acquisition function.
    """

    def __init__(
        self,
        posterior: Posterior,
        name: CriterionName,
        perturbations: Perturbations,
        best: float | NDArray[np.float64],
        *,
        margin: float = 0.0,
        kappa: float = KAPPA,
    ):
        if name.base not in _BASES:
            raise unknown_name("acquisition function", name.base, _BASES)
        self._posterior = posterior
        self._name = name
        self._perturbations = perturbations
        self._best = best
        self._margin = margin
        self._kappa = kappa

    @property
    def nature(self) -> str:
        """What the values are: the "logarithm" of an improvement, an "improvement" (0 for none), or a "bound"."""
        return {"log_ei": "logarithm", "ucb": "bound"}.get(self._name.base, "improvement")

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (q,) at points U (q, d) of the unit cube."""
        return self._evaluate(U, False)[0]

    def with_gradient(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the values (q,) and their gradients (q, d) at points U (q, d)."""
        if self._perturbations.unknown_slopes:
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

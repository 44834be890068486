"""The answer: an input, and what to expect of it when it is perturbed.

Two distributions, both mixtures of normals:
    execution     the value of the next execution: one normal for each particle of the surrogate and each perturbed
                  point, with the posterior mean there and the variance of the model and of the observation noise
    expectation   the mean of many executions: one normal for each particle, of the response averaged over the input
                  noise; what is left of its spread is what the model does not know
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["Outcome", "Recommendation", "execution_at", "expectation_at", "recommendation"]

_LEVEL: Final = 0.05


@dataclass(frozen=True)
class Outcome:
    """A distribution of values: an equally weighted mixture of normals."""

    means: NDArray[np.float64]
    """(c,)"""
    stds: NDArray[np.float64]
    """(c,)"""

    @property
    def mean(self) -> float:
        """Mean of the distribution."""
        return float(self.means.mean())

    @property
    def std(self) -> float:
        """Standard deviation, by the law of total variance."""
        spread = self.means - self.means.mean()
        unit = max(float(self.stds.max()), float(np.abs(spread).max())) or 1.0  # squares may overflow
        return unit * float(np.sqrt(np.mean((self.stds / unit) ** 2) + np.mean((spread / unit) ** 2)))

    def probability_below(self, value: float) -> float:
        """Return the probability of a value below `value`."""
        from scipy.special import ndtr

        scale = np.maximum(self.stds, 1e-12 * max(float(np.ptp(self.means)), 1e-300))
        return float(ndtr((value - self.means) / scale).mean())

    def quantile(self, level: float) -> float:
        """Return the value below which the share `level` of the distribution lies, by bisection."""
        low = float((self.means - 10.0 * self.stds).min())
        high = float((self.means + 10.0 * self.stds).max())
        for _ in range(60):
            middle = 0.5 * (low + high)
            if self.probability_below(middle) < level:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)


@dataclass(frozen=True)
class Recommendation:
    """The input to use, and what to expect of it when it is perturbed."""

    x: NDArray[np.float64]
    """(d,), in the box's units"""
    mean: float
    """expected outcome under the input noise"""
    std: float
    """standard deviation of one execution: input noise, observation noise and what the model does not know"""
    quantile: float
    """value that 95 % of executions exceed"""
    observed: float
    """value that was told at x; NaN where x was never tried"""
    n: int
    """trials with a value that the recommendation rests on"""
    outcome_std: float
    """standard deviation, over the input noise, of the model's mean: the risk left to take; unscented variance (4.1)"""
    refused: str
    """why the highest observed trial was not recommended; empty where it was"""
    outliers: tuple[int, ...]
    """trials, from 0 in the order told, whose values lie too far below the others to be believed"""
    execution: Outcome = field(repr=False)
    """distribution of the value of one execution"""
    expectation: Outcome = field(repr=False)
    """distribution of the mean of many executions: what the model does not know of it"""

    def probability_below(self, value: float) -> float:
        """Return the probability that the next execution gives less than `value`."""
        return self.execution.probability_below(value)


def execution_at(
    posterior: Posterior, reached: Perturbations, u: NDArray[np.float64], noise_variance: float | None = None
) -> Outcome:
    """Return what to expect of one execution at u (d,) whose perturbations have equal weights.

    `noise_variance` is that of the observations where it is known; by default the surrogate's.
    """
    points = reached.around(u[None, :])[0]
    moments = posterior.moments(points)
    noise = posterior.noise_variance(points) if noise_variance is None else noise_variance  # (m, s) or a number
    return Outcome(moments.mean.ravel(), np.sqrt(moments.variance + noise).ravel())


def expectation_at(posterior: Posterior, reached: Perturbations, u: NDArray[np.float64]) -> Outcome:
    """Return what the model knows of the mean of many executions at u (d,)."""
    moments = reached.outcome(posterior, u[None, :])
    return Outcome(moments.mean.ravel(), np.sqrt(moments.variance).ravel())


def recommendation(
    posterior: Posterior,
    reached: Perturbations,
    sigma_points: Perturbations,
    u: NDArray[np.float64],
    x: NDArray[np.float64],
    observed: float,
    highest: tuple[NDArray[np.float64], float],
    n: int,
    outliers: tuple[int, ...] = (),
    noise_variance: float | None = None,
) -> Recommendation:
    """Describe u (d,) of the unit cube, x in the box's units; `highest` is the best observed trial and its value."""
    outcome = execution_at(posterior, reached, u, noise_variance)
    moments, _ = sigma_points.spread(posterior, u[None, :])
    means, weights = moments.mean.mean(axis=0), sigma_points.quadrature.weights
    spread = means - weights @ means
    unit = float(np.abs(spread).max()) or 1.0  # squares may overflow
    variance = weights @ (spread / unit) ** 2
    refused = ""
    if np.any(np.abs(highest[0] - u) > 1e-6):
        other = execution_at(posterior, reached, highest[0], noise_variance)
        refused = (
            f"The highest observed trial gave {highest[1]:.4g}, but under the noise {other.mean:.4g} is expected, "
            f"and less than {other.quantile(_LEVEL):.4g} once in twenty executions; of the recommended one "
            f"{outcome.mean:.4g} is expected, and less than {outcome.quantile(_LEVEL):.4g} once in twenty."
        )
    return Recommendation(
        x,
        outcome.mean,
        outcome.std,
        outcome.quantile(_LEVEL),
        observed,
        n,
        unit * float(np.sqrt(max(variance, 0.0))),
        refused,
        outliers,
        outcome,
        expectation_at(posterior, reached, u),
    )

"""What a trial must satisfy besides promising much, as the search for the next trial sees it.

Legend
    U   points of the unit cube (q, d)
    P   probability that what is required holds at U, the product over requirements
    a   acquisition function
Hard: inputs that are not allowed, and in safe mode those with P below its level, are no candidates. Soft: an
improvement is multiplied by P (Schonlau, Welch and Jones 1998; Gardner et al. 2014), its logarithm gains log P. A bound
(UCB) has no zero to be multiplied from: it counts where P is at least one half.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.constraints.input import Region
from surehold.optimization.maximizer.ascent import Objective

__all__ = ["Admission", "Likelihood", "Requirement"]

_HALF: Final = 0.5
_UNLIKELY: Final = 1e100  # by so much a bound is lowered where P is 0

Values = tuple[NDArray[np.float64], NDArray[np.float64]]


class Requirement(Protocol):
    """Something that holds with a probability."""

    def log_probability(self, U: NDArray[np.float64], gradient: bool = False) -> Values:
        """Return the logarithm of the probability (q,) and its gradients, (q, d) or, not asked for, (0, d)."""
        ...


@dataclass(frozen=True)
class Admission:
    """All that is required of a trial."""

    region: Region | None = None
    requirements: tuple[Requirement, ...] = ()
    """multiply the acquisition function"""
    safe: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None
    """forbids inputs U (q, d) for which it returns False"""

    def possible(self, U: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which points can be tried, (q,)."""
        inside = np.ones(len(U), dtype=bool) if self.region is None else self.region.contains(U)
        if self.safe is not None and inside.any():
            inside[inside] = self.safe(U[inside])
        return inside

    def log_probability(self, U: NDArray[np.float64], gradient: bool = False) -> Values:
        """Return log P (q,) and its gradients (q, d), or (0, d) where they are not asked for."""
        total, slopes = np.zeros(len(U)), np.zeros((len(U) if gradient else 0, U.shape[1]))
        for requirement in self.requirements:
            value, slope = requirement.log_probability(U, gradient)
            total, slopes = total + value, slopes + slope
        return total, slopes

    def weighed(self, objective: Objective) -> "Weighed":
        """Return an acquisition function times P, and -inf where nothing can be tried."""
        return Weighed(objective, self)

    def among(self, points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Return those of the points (c, d) that can be tried, and others if none or few can; none: (0, d)."""
        possible = points[self.possible(points)]
        if self.region is not None and 2 * len(possible) < len(points):
            others = np.concatenate([self.region.points, self.region.draw(len(self.region.points), rng)])
            possible = np.concatenate([possible, others[self.possible(others)]])
        return possible


class Weighed:
    """An acquisition function that knows what is required."""

    def __init__(self, objective: Objective, admission: Admission):
        self._objective: Final = objective
        self._admission: Final = admission
        self._nature: Final = getattr(objective, "nature", "improvement")

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (q,) at U (q, d)."""
        values = np.full(len(U), -np.inf)
        possible = self._admission.possible(U)
        if possible.any():
            values[possible] = self._combined(
                self._objective(U[possible]), self._admission.log_probability(U[possible])[0]
            )
        return values

    def with_gradient(self, U: NDArray[np.float64]) -> Values:
        """Return the values (q,) and gradients (q, d) at U (q, d)."""
        values, gradients = np.full(len(U), -np.inf), np.zeros(U.shape)
        possible = self._admission.possible(U)
        if not possible.any():
            return values, gradients
        value, slope = self._objective.with_gradient(U[possible])
        if not self._admission.requirements:
            values[possible], gradients[possible] = value, slope
            return values, gradients
        logs, log_slope = self._admission.log_probability(U[possible], True)
        P = np.exp(logs)[:, None]
        values[possible] = self._combined(value, logs)
        if self._nature == "logarithm":
            gradients[possible] = slope + log_slope
        elif self._nature == "bound":
            gradients[possible] = np.where(P >= _HALF, slope, _UNLIKELY * P * log_slope)
        else:  # where no draw improves, the value is negative: how far it is from improving
            up = value[:, None] > 0.0
            gradients[possible] = np.where(
                up, P * (slope + value[:, None] * log_slope), (2.0 - P) * slope - value[:, None] * P * log_slope
            )
        return values, gradients

    def _combined(self, value: NDArray[np.float64], logs: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._nature == "logarithm":
            return value + logs
        P = np.exp(logs)
        if self._nature == "bound":
            return np.where(P >= _HALF, value, -_UNLIKELY * (1.0 - P))
        return np.where(value > 0.0, value * P, value * (2.0 - P))


class Likelihood:
    """P itself as what is maximized: the search for anything that satisfies all."""

    nature: Final = "logarithm"

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return zeros (q,): the admission adds log P."""
        return np.zeros(len(U))

    def with_gradient(self, U: NDArray[np.float64]) -> Values:
        """Return zeros (q,) and (q, d)."""
        return np.zeros(len(U)), np.zeros(U.shape)

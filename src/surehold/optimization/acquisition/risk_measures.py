"""Risk measures of the outcome under input noise, and the acquisition functions that improve them.

Legend
    draws     joint draws of f at the perturbed points of a query, (..., s)
    weights   w_i of the perturbations, (s,), positive, summing to 1
    rho       risk measure of one draw, larger is better; its distribution over draws is what the model knows of it
    alpha     share of the worst outcomes that counts, in (0, 1)
    beta      standard deviations or variances taken off the mean
    kappa     of the worst case: standard deviations added to and taken off the model's mean
"""

from copy import copy
from dataclasses import dataclass
from numbers import Real
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import RISK_DRAWS
from surehold.errors import InputError, unknown_name
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.numerics.differences import by_differences
from surehold.optimization.surrogates.protocol import Posterior, means, mixture

__all__ = ["RISKS", "Risk", "RiskImprovement", "WorstCaseBound"]

RISKS: Final = ("mean", "mean-std", "mean-variance", "var", "cvar", "worst")
_UNWEIGHTED: Final = ("mean", "worst")  # measures that a negative weight does no harm
_PARAMETERS: Final = {"mean-std": "beta", "mean-variance": "beta", "var": "alpha", "cvar": "alpha"}


@dataclass(frozen=True)
class Risk:
    """A risk measure of the outcome under input noise, without the noise of observations.

    "mean": the expected outcome. "mean-std": mean - beta standard deviations. "mean-variance": mean - beta variances.
    "var": value at risk, the outcome that a share alpha of executions falls below. "cvar": the mean of that share
    (Rockafellar and Uryasev 2000). "worst": the lowest outcome among the perturbations (after Bogunovic et al. 2018).
    """

    name: str = "mean"
    alpha: float = 0.1
    beta: float = 1.0

    def __post_init__(self) -> None:
        if self.name not in RISKS:
            raise self._unknown()
        for name, value in (("alpha", self.alpha), ("beta", self.beta)):
            if isinstance(value, bool) or not isinstance(value, Real):
                raise InputError(f"{name} is {value!r}; give a number.")
        if not 0.0 < self.alpha < 1.0:
            raise InputError(f"alpha is {self.alpha!r}; give the share of worst outcomes, strictly between 0 and 1.")
        if not (np.isfinite(self.beta) and self.beta >= 0.0):
            raise InputError(
                f"beta is {self.beta!r}; give a finite number of standard deviations or variances, 0 or more."
            )
        own = _PARAMETERS.get(self.name)
        for name, value, usual in (("alpha", self.alpha, Risk.alpha), ("beta", self.beta, Risk.beta)):
            if name != own and value != usual:
                takes = "no parameter" if own is None else f"{own} alone"
                raise InputError(f"{name} is {value!r}, but risk '{self.name}' takes {takes}; leave it out.")

    def _unknown(self) -> InputError:
        """Return the error for a name that is none; of the command line's form, "cvar=0.1", it names that of Python."""
        name, _, value = str(self.name).partition("=")
        if name in _PARAMETERS:
            return InputError(
                f"risk {self.name!r} is how the command line says it; give "
                f"surehold.Risk({name!r}, {_PARAMETERS[name]}={value})."
            )
        return unknown_name("risk", self.name, RISKS)

    @classmethod
    def parse(cls, text: str) -> "Risk":
        """Return the measure of a text: a name, or a name and its parameter, such as "cvar=0.05", "mean-std=2".

        Raises InputError for an unknown name, and for a parameter that is none, or out of range.
        """
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            return cls(name)
        parameter = _PARAMETERS.get(name)
        if parameter is None:
            if name in RISKS:
                raise InputError(f"risk {text!r}: '{name}' has no parameter; write {name}.")
            raise unknown_name("risk", name, RISKS)
        try:
            number = float(value)
        except ValueError:
            raise InputError(f"risk {text!r}: {value!r} is not a number; write for example {name}=0.2.") from None
        try:
            return cls(name, **{parameter: number})
        except InputError as error:
            raise InputError(f"risk {text!r}: {error}") from None

    def __str__(self) -> str:
        parameter = _PARAMETERS.get(self.name)
        return self.name if parameter is None else f"{self.name}={getattr(self, parameter):.12g}"

    def words(self, minimized: bool = False) -> str:
        """Return the measure in words, such as "mean of the worst 10 %"; `minimized`: where low values are good."""
        share = 1.0 - self.alpha if minimized else self.alpha
        several = "" if self.beta == 1.0 else "s"
        taken_off = f"mean {'plus' if minimized else 'less'} {self.beta:g}"
        return {
            "mean": "mean",
            "mean-std": f"{taken_off} standard deviation{several}",
            "mean-variance": f"{taken_off} variance{several}",
            "var": f"{100.0 * share:.10g} % quantile",
            "cvar": f"mean of the worst {100.0 * self.alpha:.10g} %",
            "worst": "worst case",
        }[self.name]

    def of_executions(self, values: NDArray[np.floating], minimized: bool = False) -> float:
        """Return what executions that gave these values (q,) are worth; NaN where there are none."""
        if not len(values):
            return float("nan")
        sign = -1.0 if minimized else 1.0
        return sign * float(
            self.measure(sign * np.asarray(values, dtype=np.float64), np.full(len(values), 1.0 / len(values)))
        )

    def check_weights(self, weights: NDArray[np.float64], rule: str = "") -> None:
        """Raise InputError where the measure needs weights of 0 or more and the quadrature `rule` has others."""
        if self.name not in _UNWEIGHTED and weights.min() < 0.0:
            raise InputError(
                f"quadrature{rule and f' {rule!r}'} has a weight of {weights.min():.4g}, but risk '{self.name}' needs "
                "weights of 0 or more; choose 'quasi_monte_carlo', 'gauss_hermite', or 'unscented' with k >= 0."
            )

    def measure(self, draws: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return rho (...) of draws (..., s); raises InputError for negative weights where they have no meaning."""
        self.check_weights(weights)
        if self.name == "worst":
            return draws.min(axis=-1)
        mean = draws @ weights
        if self.name == "mean":
            return mean
        if self.name in ("mean-std", "mean-variance"):
            variance = np.maximum(np.square(draws - mean[..., None]) @ weights, 0.0)
            return mean - self.beta * (variance if self.name == "mean-variance" else np.sqrt(variance))
        order = np.argsort(draws, axis=-1)
        ordered = np.take_along_axis(draws, order, axis=-1)
        reached = np.cumsum(weights[order], axis=-1)
        if self.name == "var":
            first = np.argmax(reached >= self.alpha - 1e-12, axis=-1)
            return np.take_along_axis(ordered, first[..., None], axis=-1)[..., 0]
        share = np.clip(
            self.alpha - (reached - weights[order]), 0.0, weights[order]
        )  # of the worst alpha, point by point
        return (ordered * share).sum(axis=-1) / self.alpha


class RiskImprovement:
    """Expected improvement of a risk measure, by joint draws of the posterior around each query.

    Parameters
    ----------
    posterior, perturbations, risk
        The surrogate, the input noise, what is asked of the outcome.
    best
        Value to improve upon; None for the expected measure itself.
    rng
        For the common random numbers of the draws.
    """

    def __init__(
        self,
        posterior: Posterior,
        perturbations: Perturbations,
        risk: Risk,
        best: float | None,
        rng: np.random.Generator,
    ):
        self._posterior = posterior
        self._perturbations = perturbations
        self._finer: Perturbations | None = None
        self._risk = risk
        self._best = best
        self._normals = rng.standard_normal((RISK_DRAWS, len(perturbations.quadrature.weights)))

    def corrected(self, finer: Perturbations | None) -> "RiskImprovement":
        """Return the improvement of the measure by more perturbations of the same noise, of the same draws.

        Under each particle the measure by the finer perturbations less that by the few, both of the model's mean, is
        added to every draw: what few get wrong of a variance or a quantile hardly differs from draw to draw where the
        model is sure, and joint draws at many points cost the cube of their number. Without finer ones nothing changes.
        """
        other = copy(self)
        other._finer = finer
        return other

    def mirrored(self) -> "RiskImprovement":
        """Return the improvement by these draws and their mirror images about the mean, whose mean is exact."""
        other = copy(self)
        other._normals = np.concatenate([self._normals, -self._normals])
        return other

    def over(self, points: NDArray[np.float64]) -> "RiskImprovement":
        """Return the improvement upon the best of the points (q, d), by the same draws."""
        other = copy(self)
        other._best = float(self.expectation(points).max())
        return other

    def values(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return draws of the risk measure (m b, q) at U (q, d)."""
        draws = self._posterior.sample(self._perturbations.around(U), self._normals)  # (m, q, b, s)
        rho = self._risk.measure(draws, self._perturbations.quadrature.weights)
        if self._finer is not None:
            few, many = self._of_mean(self._perturbations, U), self._of_mean(self._finer, U)
            sound = np.isfinite(few) & np.isfinite(many)  # a variance of huge values is infinite
            rho += np.subtract(many, few, out=np.zeros_like(few), where=sound)[:, :, None]
        return np.swapaxes(rho, 1, 2).reshape(-1, len(U))

    def expectation(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the expected risk measure (q,) at U (q, d)."""
        return self.values(U).mean(axis=0)

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the expected improvement (q,); where no draw improves, how near the best one comes (negative)."""
        rho = self.values(U)
        if self._best is None:
            return rho.mean(axis=0)
        gain = np.maximum(rho - self._best, 0.0).mean(axis=0)
        return np.where(gain > 0.0, gain, np.minimum(rho.max(axis=0) - self._best, 0.0))

    def with_gradient(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values (q,) and gradients (q, d) at U (q, d), by central differences on common random numbers."""
        return by_differences(self, U)

    def _of_mean(self, perturbations: Perturbations, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the risk measure (m, q) of each particle's mean at U (q, d)."""
        around = perturbations.around(U)  # (q, s, d)
        mean = means(self._posterior, around.reshape(-1, U.shape[1])).reshape(-1, *around.shape[:2])
        return self._risk.measure(mean, perturbations.quadrature.weights)


class WorstCaseBound:
    """Upper confidence bound of the worst outcome among the perturbations: min_i mean + kappa std at x + xi_i.

    Bogunovic, Scarlett, Jegelka and Cevher 2018, StableOpt: the candidate has the highest bound, the trial is made
    where its lower bound is lowest.
    """

    nature: Final = "bound"

    def __init__(self, posterior: Posterior, perturbations: Perturbations, kappa: float):
        self._posterior = posterior
        self._perturbations = perturbations
        self._kappa = kappa

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the bound (q,) at U (q, d)."""
        return self._bounds(U, self._kappa).min(axis=1)

    def with_gradient(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the bounds (q,) and their gradients (q, d) at U (q, d), by central differences."""
        return by_differences(self, U)

    def to_try(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points of the cube (c, d) to try for the candidate u (d,), best first.

        These are its perturbed points, the one with the lowest lower bound first (StableOpt). Where that one is better
        known than u, nothing is to be learnt from it, and u itself is first: answers are inputs that were tried, and
        the best place lies between the points that threaten it.
        """
        points = np.clip(self._perturbations.around(u[None, :])[0], 0.0, 1.0)
        mean, std = self._known(points)
        order = np.argsort(mean - self._kappa * std, kind="stable")
        if self._perturbations.held is None and std[order[0]] < self._known(u[None, :])[1][0]:
            return np.vstack([u, points[order]])
        return points[order]  # of uncontrolled variables the candidate's own values mean nothing

    def _bounds(self, U: NDArray[np.float64], kappa: float) -> NDArray[np.float64]:
        points = self._perturbations.around(U)
        mean, std = self._known(points.reshape(-1, U.shape[1]))
        return (mean + kappa * std).reshape(len(U), -1)

    def _known(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return mean and standard deviation (q,) of f at points (q, d)."""
        mean, variance = mixture(self._posterior.moments(points))
        return mean, np.sqrt(variance)

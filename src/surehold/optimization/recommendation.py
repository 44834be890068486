"""The answer: an input, and what to expect of it when it is perturbed.

Two distributions, both mixtures of normals:
    execution     the value of the next execution: one normal for each particle of the surrogate and each perturbed
                  point, with the posterior mean there and the variance of the model and of the observation noise
    expectation   the mean of many executions: one normal for each particle, of the response averaged over the input
                  noise; what is left of its spread is what the model does not know
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.box import Box
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.surrogates.protocol import Posterior, means

__all__ = [
    "MANY_OUTSIDE",
    "Outcome",
    "Recommendation",
    "execution_at",
    "expectation_at",
    "in_digits",
    "outliers_in_words",
    "outside_in_words",
    "place",
    "recommendation",
]

_LEVEL: Final = 0.05
#: Share of executions from which it is worth a sentence that they leave the box.
MANY_OUTSIDE: Final = 0.2
_SOME_OUTSIDE: Final = 0.01


@dataclass(frozen=True)
class Outcome:
    """A distribution of values: a mixture of normals."""

    means: NDArray[np.float64]
    """(c,)"""
    stds: NDArray[np.float64]
    """(c,)"""
    weights: NDArray[np.float64] | None = None
    """(c,), summing to 1; None where all are equal"""

    @property
    def mean(self) -> float:
        """Mean of the distribution."""
        return self._average(self.means)

    def _average(self, values: NDArray[np.float64]) -> float:
        return float(values.mean() if self.weights is None else values @ self.weights)

    @property
    def std(self) -> float:
        """Standard deviation, by the law of total variance."""
        spread = self.means - self.mean
        unit = max(float(self.stds.max()), float(np.abs(spread).max())) or 1.0  # squares may overflow
        return unit * float(np.sqrt(self._average((self.stds / unit) ** 2) + self._average((spread / unit) ** 2)))

    def probability_below(self, value: float) -> float:
        """Return the probability of a value below `value`."""
        from scipy.special import ndtr

        scale = np.maximum(self.stds, 1e-12 * max(float(np.ptp(self.means)), 1e-300))
        return self._average(ndtr((value - self.means) / scale))

    def quantile(self, level: float) -> float:
        """Return the value below which the share `level` of the distribution lies, by bisection.

        Raises InputError for a level outside of [0, 1].
        """
        _check_share(level)
        low = float((self.means - 10.0 * self.stds).min())
        high = float((self.means + 10.0 * self.stds).max())
        for _ in range(60):
            middle = 0.5 * (low + high)
            if self.probability_below(middle) < level:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)


@dataclass(frozen=True, repr=False)
class Recommendation:
    """The input to use, and what to expect of it when it is perturbed; values in the sign in which they were told.

    Attributes
    ----------
    x : (d,)
        In the box's units, those of `Box.from_unit`: of a logarithmic variable the logarithm, of a choice a number for
        each of its values.
    mean
        Expected outcome under the input noise.
    std
        Standard deviation of one execution: input noise, observation noise and what the model does not know.
    quantile
        The value that 95 % of executions are better than: they exceed it, or stay below where the optimizer minimizes.
        Where trials succeed or fail: the share of successes that is exceeded with 95 %.
    observed
        Value that was told at x; NaN where x was never tried. Where the box has uncontrolled variables: told at this
        setting, under the condition of that trial.
    n
        Trials with a value that the recommendation rests on.
    outcome_std
        Standard deviation, over the input noise, of the model's mean: the risk left to take.
    refused
        Why the best observed trial was not recommended; empty where it was.
    warning
        What is wrong with the trials or the model that all this rests on: inputs that were reached far outside of the
        box, and see `diagnosis.Diagnosis`; empty where nothing is.
    outliers
        Trials, from 0 in the order told, whose values are too far on the bad side of all others to be believed.
    execution : Outcome
        Distribution of the value of one execution.
    expectation : Outcome
        Distribution of the mean of many executions: what the model does not know of it.
    parameters
        x as {name: value}.
    feasible
        Probability that the further outputs keep all limits of `constraints` in one execution, over the input noise and
        what the models do not know; 1 where there are none. Unlike `outputs` it is of the outputs themselves, without
        the noise of their observations: measured values may break a limit more often.
    infeasible
        Why no feasible input is known and what came nearest; empty where one is. `x` is the nearest then.
    outputs : dict
        {name: Outcome} of the further outputs of one execution, as they would be measured: input noise, observation
        noise and what the models do not know.
    by_risk
        What x is expected to be worth by the risk measure that was asked for; None where that is the mean. Unlike
        `quantile` and `execution` it is of the response, without the noise of observations.
    outside : dict
        {name: share of executions that leave the box along this variable}, of shares from 0.01 on. Nothing can be tried
        there: what is expected of these executions rests on the model alone. Empty with `border="clip"` or "keep".
    """

    x: NDArray[np.float64]
    mean: float
    std: float
    quantile: float
    observed: float
    n: int
    outcome_std: float
    refused: str
    warning: str
    outliers: tuple[int, ...]
    execution: Outcome
    expectation: Outcome
    parameters: dict[str, Any]
    feasible: float = 1.0
    infeasible: str = ""
    outputs: Mapping[str, Outcome] = field(default_factory=dict)
    by_risk: float | None = None
    outside: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        mean, quantile = (in_digits(value, self.std, 6) for value in (self.mean, self.quantile))
        risk = "" if self.by_risk is None else f", by_risk={in_digits(self.by_risk, self.std, 6)}"
        found = f"{place(self.x, self.parameters)}, mean={mean}, std={self.std:.3g}, quantile={quantile}{risk}"
        return f"Recommendation({found})"

    @property
    def worth(self) -> float:
        """What x is expected to be worth by what was asked for: `by_risk`, or the mean."""
        return self.mean if self.by_risk is None else self.by_risk

    def probability_below(self, value: float) -> float:
        """Return the probability that the next execution gives less than `value`."""
        return self.execution.probability_below(value)

    def probability_of_share(self, level: float = 0.9) -> float:
        """Return the probability that at least a share `level` of executions succeed, where trials succeed or fail.

        Over what is not known: the share itself is that under the input noise. Raises InputError for a level outside
        of [0, 1].
        """
        _check_share(level)
        return 1.0 - self.expectation.probability_below(level)


def _check_share(level: Any) -> None:
    """Raise InputError where a level is no share of executions, such as 95 for 95 %."""
    if isinstance(level, bool) or not isinstance(level, (int, float, np.number)) or not 0.0 <= level <= 1.0:
        raise InputError(f"level is {level!r}; give a share of executions from 0 to 1, such as 0.95.")


def outliers_in_words(numbers: Sequence[int]) -> str:
    """Return what a user should know of trials that are `Recommendation.outliers`; empty where there are none."""
    if not numbers:
        return ""
    several = len(numbers) > 1
    return (
        f"{'Trials' if several else 'Trial'} {', '.join(map(str, numbers))} gave {'values' if several else 'a value'} "
        f"so far on the bad side of all others that {'they count' if several else 'it counts'} as the worst of those. "
        "Nothing is to be done if that is how the place is; a trial that gave no measurement is better told as failed."
    )


def outside_in_words(outside: Mapping[str, float]) -> str:
    """Return what a user should know of `Recommendation.outside`; empty where few executions leave the box."""
    many = [f"{100.0 * share:.0f} along {name}" for name, share in outside.items() if share >= MANY_OUTSIDE]
    if not many:
        return ""
    return (
        f"The recommended input is near the border of the box: of 100 executions {', '.join(many)} leave it. Nothing "
        "was tried there, and the model goes on as inside: behind a cliff they would be worth less. Execute it a few "
        "times before you rely on it, or widen the box if trials can be made there; where executions stop at the "
        'border, say so: border="clip" in Python, --border clip where a study is created.'
    )


def in_digits(value: float, deviation: float, least: int = 4) -> str:
    """Return a value in `least` digits, or, where it is far from 0, in as many as show a tenth of the deviation."""
    known = value and math.isfinite(value) and 0.0 < deviation < math.inf
    apart = math.log10(abs(value)) - math.log10(deviation) if known else 0.0
    return f"{value:.{min(max(least, math.ceil(apart) + 2), 15)}g}"


def execution_at(
    posterior: Posterior, reached: Perturbations, u: NDArray[np.float64], noise_variance: float | None = None
) -> Outcome:
    """Return what to expect of one execution at u (d,) whose perturbations have no negative weights.

    `noise_variance` is that of the observations where it is known; by default the surrogate's.
    """
    points = reached.around(u[None, :])[0]
    moments = posterior.moments(points)
    noise = posterior.noise_variance(points) if noise_variance is None else noise_variance  # (m, s) or a number
    weights = reached.quadrature.weights
    each = None
    if np.ptp(weights) > 0.0:
        each = np.tile(weights / len(moments.mean), len(moments.mean))
    return Outcome(moments.mean.ravel(), np.sqrt(moments.variance + noise).ravel(), each)


def expectation_at(
    posterior: Posterior, reached: Perturbations, u: NDArray[np.float64], finer: Perturbations | None = None
) -> Outcome:
    """Return what the model knows of the mean of many executions at u (d,).

    What the finer perturbations of the same noise make of each particle's mean is the better average; by how much they
    move it is added to its deviation: a model that is sure to five digits does not make the average so.
    """
    moments = reached.outcome(posterior, u[None, :])
    mean, variance = moments.mean.ravel(), moments.variance.ravel()
    if finer is None:
        return Outcome(mean, np.sqrt(variance))
    few, many = (means(posterior, rule.around(u[None, :])[0]) @ rule.quadrature.weights for rule in (reached, finer))
    return Outcome(mean + many - few, np.hypot(np.sqrt(variance), many - few))


def recommendation(
    posterior: Posterior,
    reached: Perturbations,
    finer: Perturbations | None,
    u: NDArray[np.float64],
    box: Box,
    observed: float,
    highest: tuple[NDArray[np.float64], float],
    n: int,
    sign: float = 1.0,
    outliers: tuple[int, ...] = (),
    noise_variance: float | None = None,
    warning: str = "",
    risk: Risk | None = None,
    by_risk: tuple[float, float] | None = None,
    no_answer: str = "",
) -> Recommendation:
    """Describe u (d,) of the unit cube; `highest` is where the best observed trial was, and its value.

    `reached` are the perturbations of one execution, `finer` more of them, for its mean. `sign` is that of the values
    in which the answer is given: -1 where what was told has been turned over. `risk` is the measure by which u was
    chosen, and `by_risk` what `highest` and u are worth by it; None: the mean. `no_answer` says why `highest` is none.
    """
    outcome = execution_at(posterior, reached, u, noise_variance)
    expectation = expectation_at(posterior, reached, u, finer)
    near, weights = outcome.means.reshape(-1, len(reached.quadrature.weights)).mean(axis=0), reached.quadrature.weights
    refused = ""

    def said(value: float) -> str:
        return in_digits(sign * value, outcome.std)

    best, worse = ("highest", "less") if sign > 0.0 else ("lowest", "more")
    if no_answer:
        refused = f"The {best} observed trial gave {said(highest[1])}, but {no_answer}"
    elif np.any(np.abs(highest[0] - u) > 1e-6):
        other = execution_at(posterior, reached, highest[0], noise_variance)
        expected = expectation_at(posterior, reached, highest[0], finer).mean
        refused = f"The {best} observed trial gave {said(highest[1])}, but under the noise "
        if risk is not None and by_risk is not None:
            one, another, words = said(by_risk[0]), said(by_risk[1]), risk.words(sign < 0.0)
            refused += (
                f"it is worth no more than the recommended one: its {words} is {another}, too."
                if one == another
                else f"its {words} is {one}, that of the recommended one {another}."
            )
        elif expected >= expectation.mean or said(expected) == said(expectation.mean):
            refused += f"it is worth no more than the recommended one: {said(expectation.mean)} is expected."
        else:
            refused += (
                f"{said(expected)} is expected, and {worse} than {said(other.quantile(_LEVEL))} once in twenty "
                f"executions; of the recommended one {said(expectation.mean)} is expected, and {worse} than "
                f"{said(outcome.quantile(_LEVEL))} once in twenty."
            )
    x = box.from_unit(u)
    return Recommendation(
        x,
        sign * expectation.mean,
        outcome.std,
        sign * outcome.quantile(_LEVEL),
        sign * observed,
        n,
        Outcome(near, np.zeros(len(near)), weights).std,
        refused,
        warning,
        outliers,
        Outcome(sign * outcome.means, outcome.stds, outcome.weights),
        Outcome(sign * expectation.means, expectation.stds),
        box.as_dict(x),
        by_risk=None if by_risk is None else sign * by_risk[1],
        outside=_outside(reached, u, box),
    )


def _outside(reached: Perturbations, u: NDArray[np.float64], box: Box) -> dict[str, float]:
    """Return the share of executions at u (d,) that leave the box, by variable."""
    beyond = np.abs(reached.around(u[None, :])[0] - 0.5) > 0.5 + 1e-9  # (s, d)
    shares = zip(box.names, reached.quadrature.weights @ beyond, strict=True)
    return {name: float(share) for name, share in shares if share >= _SOME_OUTSIDE}


def place(x: NDArray[np.float64], parameters: Mapping[str, Any]) -> str:
    """Return an input (d,) as it is shown: as numbers where it is nothing else, or by names."""
    if not parameters or list(parameters.values()) == x.tolist():
        return f"x={np.array2string(x, precision=6, separator=', ')}"
    named = {k: float(f"{v:.6g}") if isinstance(v, float) else v for k, v in parameters.items()}
    return f"parameters={named}"

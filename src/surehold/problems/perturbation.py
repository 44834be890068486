"""Score an input by what happens around it: re-query the problem where an imprecise execution would end up."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise, needed_input_noise
from surehold.problems.problem import Problem, checked_points

__all__ = ["RobustScore", "perturbed_points", "robust_score"]

_MOST = 10_000_000  # perturbations; more is a slip of the pen


@dataclass(frozen=True)
class RobustScore:
    """Outcome of n perturbed re-queries of one input. They only score; they are no part of a budget."""

    mean: float  #: mean of `values`; NaN if every re-query failed
    std: float  #: sample standard deviation of `values` (divisor n - 1); 0 for a single value
    worst: float  #: lowest of `values`
    values: NDArray[np.float64]  #: (n - n_failed,) outcomes, in the order of `points` without the failed ones
    points: NDArray[np.float64]  #: (n, d) inputs that were queried, in the units of the box
    n_failed: int  #: re-queries that raised or gave no finite number

    def quantile(self, level: float) -> float:
        """Return the value below which the share `level` (0 to 1) of the outcomes lies.

        Raises
        ------
        InputError
            If level is outside [0, 1].
        """
        if not 0.0 <= level <= 1.0:
            raise InputError(f"quantile level is {level!r}; give a share from 0 to 1, such as 0.05.")
        return float(np.quantile(self.values, level)) if self.values.size else float("nan")


def perturbed_points(
    x: ArrayLike,
    box: Box,
    noise: InputNoise | None,
    n: int = 100,
    seed: int | np.random.Generator = 0,
    border: Literal["keep", "extend"] = "keep",
) -> NDArray[np.float64]:
    """Draw n inputs x + noise around x (d,) -> (n, d), in the units of the box.

    A coordinate that would leave the box keeps its noise-free value (the thesis' rule), or with "extend" leaves it. An
    uncontrolled variable of the box is what it happens to be, drawn from its distribution, whatever x says of it; the
    noise may then be None. The draw depends on (box, noise, n, seed) only: two inputs that are compared shake alike.

    Raises
    ------
    InputError
        If n is not a positive integer, x lies outside the box, or the border rule is unknown.
    """
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 1 <= n <= _MOST:
        raise InputError(f"number of perturbations is {n!r}; give an integer from 1 to {_MOST:,}.")
    center, single = checked_points(x, box)
    if not single:
        raise InputError(f"x has shape {center.shape}; score one point ({box.dimension},) at a time.")
    if not box.contains(center[0]):
        raise InputError(f"x = {center[0].tolist()} lies outside {box!r}; score a point of the box.")
    if border not in ("keep", "extend"):
        raise unknown_name("border rule of re-queries", border, ("keep", "extend"))
    rng = np.random.default_rng(seed)
    unit, nobody = box.to_unit(center[0]), box.uncontrolled
    reached = np.tile(unit, (int(n), 1))
    drawn = np.zeros(int(n), dtype=np.intp) if nobody is None else rng.integers(len(nobody.values), size=int(n))
    if nobody is not None:
        reached[:, nobody.held] = nobody.samples[drawn]
    if noise is not None or nobody is None:
        at = unit if nobody is None else reached  # noise that varies may depend on the condition
        reached = reached + needed_input_noise(noise, box.names).draws(box, at, int(n), rng)
    if border == "extend":
        points = box.lower + reached * box.widths
    else:
        outside = (reached < 0.0) | (reached > 1.0)
        points = np.where(outside, center[0], box.from_unit(np.clip(reached, 0.0, 1.0)))
    if nobody is not None:
        points[:, nobody.held] = nobody.values[drawn]
    return points


def robust_score(
    problem: Problem,
    x: ArrayLike,
    noise: InputNoise | None,
    n: int = 100,
    seed: int | np.random.Generator = 0,
    told: Callable[[float], object] = lambda outcome: None,
) -> RobustScore:
    """Query `problem` at n perturbations of x (d,) and return mean, standard deviation and worst outcome.

    `told` is called with each outcome, NaN where a re-query failed.

    A re-query that raises an exception or gives no finite number is counted in `n_failed` and left out. Inputs leave
    the box only if the problem says so (`problem.border == "extend"`), see `perturbed_points`.

    Raises
    ------
    InputError
        If the problem has no box, n is not a positive integer, x lies outside the box, or the noise does not fit it.
    """
    if not isinstance(getattr(problem, "box", None), Box):
        raise InputError(
            f"problem is {problem!r}, which has no box; give a problem, such as surehold.problems.Function(f, box)."
        )
    border = "extend" if getattr(problem, "border", "keep") == "extend" else "keep"
    points = perturbed_points(x, problem.box, noise, n, seed, border)
    outcomes = np.empty(len(points))
    for i, point in enumerate(points):
        outcomes[i] = _outcome(problem, point)
        told(outcomes[i])
    values = outcomes[np.isfinite(outcomes)]
    n_failed = int(outcomes.size - values.size)
    if values.size == 0:
        return RobustScore(np.nan, np.nan, np.nan, values, points, n_failed)
    std = float(np.std(values, ddof=1)) if values.size > 1 else 0.0
    return RobustScore(float(np.mean(values)), std, float(np.min(values)), values, points, n_failed)


def _outcome(problem: Problem, point: NDArray[np.float64]) -> float:
    try:
        return float(problem(point))
    except Exception:  # a user's function may raise anything; the failure is counted, the score goes on
        return float("nan")

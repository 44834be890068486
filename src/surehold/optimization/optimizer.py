"""The optimizer: ask for a trial, tell its outcome, and recommend the input that still holds when it is perturbed.

Legend
    u        point of the unit cube (d,); x the same point in the box's units
    n        finished trials that gave a value
    outcome  UO(x) = sum_i w_i mean_j mu_j(x + xi_i) over particles j and perturbations xi_i     thesis (3.21)
"""

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization import acquisition, maximizer, quadratures
from surehold.optimization.box import Box
from surehold.optimization.designs import design as initial_design
from surehold.optimization.gaussian_process import GaussianProcess
from surehold.optimization.input_noise import InputNoise
from surehold.optimization.presets import thesis_preset
from surehold.optimization.quadratures import exact
from surehold.optimization.robustness import Perturbations
from surehold.optimization.surrogate import Posterior, Surrogate, mixture
from surehold.optimization.threads import single_threaded

__all__ = ["Optimizer", "Recommendation"]

SURROGATES: Final = ("gp",)
_SEPARATION: Final = 1e-6  # points closer than this in every coordinate of the unit cube are the same trial
_ANCHORS: Final = 3
_SHORTLIST: Final = 16
_QUANTILE: Final = 0.05


@dataclass(frozen=True)
class Recommendation:
    """The input to use, and what to expect of it when it is perturbed."""

    x: NDArray[np.float64]
    """(d,), in the box's units"""
    mean: float
    """expected outcome under the input noise"""
    std: float
    """standard deviation of one outcome: input noise and what the model does not know together"""
    quantile: float
    """value that 95 % of outcomes exceed"""
    observed: float
    """value that was told at x"""
    n: int
    """trials with a value that the recommendation rests on"""


class Optimizer:
    """Bayesian optimization by ask and tell; everything is maximized.

    What `ask` returns depends on the settings, the trials told, the pending trials and the seed alone: an optimizer
    rebuilt from stored trials asks the same next point. (The thesis presets continue their chains and do not.)

    Parameters
    ----------
    box
        The search space.
    input_noise
        How far the reached input strays from the commanded one; None for inputs that are reached exactly.
    surrogate
        "gp", or an object with the method `condition` (see `surrogate.Surrogate`).
    criterion
        "ei", "log_ei", "pi", "ucb"; with input noise also "uei", "ulog_ei", "upi", "uucb" (the criterion averaged over
        sigma points) and "robust_ei", ... (the criterion of the averaged outcome). By default "log_ei" without and
        "robust_log_ei" with input noise; in the thesis presets "ei" and "uei".
    n_initial
        Trials of the initial design; by default 5 a variable, at least 6.
    design
        "latin_hypercube" (default), "sobol" or "uniform".
    seed
        Non-negative integer.
    noise
        Observation noise of "gp": "none" (default), its standard deviation in the outputs' units, or "inferred".
    output_range
        (lowest, highest) value to expect, if known.
    quadrature
        How the input noise is averaged over: "unscented" (default of the criteria averaged over sigma points),
        "scaled_unscented", "central_difference", "gauss_hermite" or "quasi_monte_carlo" (default of the robust ones).
    k
        Free parameter of the unscented transformation.
    border
        What happens to perturbed points outside the box: "extend" (default) evaluates the model there, "clip" moves
        them to the border, "keep" gives a coordinate that would leave its noise-free value.
    kappa
        Standard deviations added by the "ucb" criteria.
    preset
        "thesis", or "thesis-rkhs", "thesis-gf", "thesis-gm", "thesis-gm-noise", "thesis-grasp": the settings of the
        thesis, with the constants that it chose by hand for that problem.

    Raises
    ------
    InputError
        For unknown names and values out of range; the message names the valid ones.
    """

    def __init__(
        self,
        box: Box,
        *,
        input_noise: InputNoise | None = None,
        surrogate: str | Surrogate = "gp",
        criterion: str | None = None,
        n_initial: int | None = None,
        design: str = "latin_hypercube",
        seed: int = 0,
        noise: float | Literal["none", "inferred"] = "none",
        output_range: tuple[float, float] | None = None,
        quadrature: str | None = None,
        k: float = 1.0,
        border: str = "extend",
        kappa: float = 2.0,
        preset: str | None = None,
    ):
        if not isinstance(box, Box):
            raise InputError(f"box is {box!r}; give a surehold.Box of named bounds.")
        self.box: Final = box
        self.input_noise: Final = input_noise
        self.seed: Final = _count("seed", seed, 0)
        self.n_initial: Final = _count("n_initial", self.default_n_initial(box) if n_initial is None else n_initial, 1)
        self._thesis = None if preset is None else thesis_preset(preset)
        self._noisy = noise != "none" and noise != 0.0
        if isinstance(surrogate, str):
            if surrogate not in SURROGATES:
                raise unknown_name("surrogate", surrogate, SURROGATES)
            self._surrogate: Surrogate = (
                GaussianProcess(noise=noise, output_range=output_range)
                if self._thesis is None
                else self._thesis.gaussian_process()
            )
        else:
            self._surrogate = surrogate
        default = "log_ei" if self._thesis is None else "ei"
        if input_noise is not None:
            default = "robust_log_ei" if self._thesis is None else "uei"
        self._criterion = acquisition.criterion_name(default if criterion is None else criterion)
        if input_noise is None:
            if self._criterion.scale != "exact":
                raise InputError(f"criterion '{criterion}' averages over input noise; give input_noise= as well.")
            self._covariance = np.zeros((box.dimension, box.dimension))
            rule = exact(box.dimension)
        else:
            self._covariance = input_noise.unit_covariance(box)
            default = "quasi_monte_carlo" if self._criterion.scale == "robust" else "unscented"
            rule = quadratures.quadrature(quadrature or default, self._covariance, k)
        self._perturbations = Perturbations(rule, border)
        self._sigma_points = Perturbations(quadratures.sigma_points(self._covariance), border)
        if not np.isfinite(kappa):
            raise InputError(f"kappa is {kappa!r}; give a finite number of standard deviations.")
        self._kappa = float(kappa)
        rng = np.random.default_rng([self.seed, 0])
        self._design = initial_design(design, self.n_initial, box.dimension, rng)
        self._told: list[NDArray[np.float64]] = []
        self._values: list[float] = []
        self._pending: list[NDArray[np.float64]] = []
        self._cache: tuple[int, Posterior] | None = None

    @staticmethod
    def default_n_initial(box: Box) -> int:
        """Return the size of the initial design where none is given: 5 a variable, at least 6."""
        return max(6, 5 * box.dimension)

    # --- trials -------------------------------------------------------------------------------------------------

    @property
    def X(self) -> NDArray[np.float64]:
        """Inputs told so far, failed ones included, (t, d), in the box's units."""
        return self.box.from_unit(self._inputs)

    @property
    def y(self) -> NDArray[np.float64]:
        """Values told so far, (t,); NaN for failed trials."""
        return np.array(self._values)

    @property
    def pending(self) -> NDArray[np.float64]:
        """Inputs asked for and not told yet, (p, d), in the box's units."""
        return self.box.from_unit(np.array(self._pending).reshape(-1, self.box.dimension))

    def tell(self, x: ArrayLike, y: float | None = None, *, failed: bool = False) -> None:
        """Record the outcome y of a trial at x (d,), or that it gave nothing.

        A failed trial counts for the model as the lowest value told so far, so that it is avoided. If x is pending it
        is so no more; a trial that was never asked for is welcome too.

        Raises
        ------
        InputError
            If x has the wrong shape, is not finite or lies outside the box; if y is missing, not finite or not a
            number; if a failed trial comes with a value. Nothing told before is lost.
        """
        u = self.box.to_unit(x)
        if u.ndim != 1:
            raise InputError(f"x has shape {u.shape}; tell one trial at a time, x of shape ({self.box.dimension},).")
        if not np.all(np.isfinite(u)):
            raise InputError(f"x is {np.asarray(x).tolist()}; every coordinate must be a finite number.")
        if not self.box.contains(x):
            raise InputError(f"x = {self.box.as_dict(x)} lies outside {self.box}; tell a point inside the box.")
        if failed:
            if y is not None:
                raise InputError(f"a failed trial has no value, but y is {y!r}; leave one of the two out.")
            value = np.nan
        else:
            value = _finite(y)
        u = np.clip(u, 0.0, 1.0)
        self._told.append(u)
        self._values.append(value)
        for index, waiting in enumerate(self._pending):
            if _same(u, waiting[None, :]).any():
                del self._pending[index]
                break

    def forget(self, x: ArrayLike) -> None:
        """Drop a pending trial at x (d,) that will never be told; raises InputError if it is not pending."""
        u = self.box.to_unit(x)
        for index, waiting in enumerate(self._pending):
            if _same(u, waiting[None, :]).any():
                del self._pending[index]
                return
        raise InputError(f"x = {self.box.as_dict(x)} is not pending; see Optimizer.pending.")

    # --- ask ----------------------------------------------------------------------------------------------------

    def ask(self, n: int | None = None) -> NDArray[np.float64]:
        """Return the next trial (d,), or the next n trials (n, d) for parallel execution, in the box's units.

        Points asked for are pending until they are told: further asks keep away from them.
        """
        if n is None:
            return self._ask_one()
        return np.array([self._ask_one() for _ in range(_count("n", n, 1))])

    def _ask_one(self) -> NDArray[np.float64]:
        position = len(self._told) + len(self._pending)
        if position < self.n_initial:
            u = self._design[position]
        elif not np.any(np.isfinite(self._values)):
            u = self._rng(2, position).random(self.box.dimension)  # every trial failed or is pending: keep covering
        else:
            with single_threaded():
                u = self._propose(self._rng(2, position))
        self._pending.append(u)
        return self.box.from_unit(u)

    def _propose(self, rng: np.random.Generator) -> NDArray[np.float64]:
        posterior = self._posterior()
        best, anchors = self._incumbent(posterior)
        if self._pending:
            posterior = posterior.with_pending(np.array(self._pending))

        def objective(perturbations: Perturbations) -> acquisition.Acquisition:
            margin = 0.0 if self._thesis is None else self._thesis.margin
            return acquisition.Acquisition(
                posterior, self._criterion, perturbations, best, margin=margin, kappa=self._kappa
            )

        dimension = self.box.dimension
        if self._criterion.scale == "exact":
            accurate = screen = objective(Perturbations(exact(dimension)))
        else:
            accurate, screen = objective(self._perturbations), objective(self._sigma_points)
        if self._thesis is not None:
            return maximizer.direct(accurate, dimension, anchors[0], rng)[0]
        points = maximizer.multistart(accurate, screen, dimension, anchors, rng)
        if self._criterion.scale == "robust":
            steps = self._sigma_points.quadrature.offsets
            looks = acquisition.where_to_look(posterior, points[0], self._perturbations, steps)
            points = np.concatenate([looks, points])
        if self._noisy:
            return points[0]
        tried = np.array(self._told + self._pending)
        for point in points:
            if not _same(point, tried).any():
                return point
        return rng.random(self.box.dimension)  # every candidate has been tried already

    # --- recommend ----------------------------------------------------------------------------------------------

    def recommend(self) -> Recommendation:
        """Return the tried input whose outcome under the input noise is expected best, thesis (3.22).

        Raises
        ------
        InputError
            If no trial has given a value yet.
        """
        with single_threaded():
            posterior = self._posterior()
            index = int(self._ranking(posterior)[0])
            u = self._inputs[self._successful][index]
            reached = Perturbations(quadratures.quasi_monte_carlo(self._covariance, 7), self._perturbations.border)
            moments, _ = reached.spread(posterior, u[None, :])
            mean, variance = mixture(moments)
            quantile = _mixture_quantile(moments.mean.ravel(), np.sqrt(moments.variance).ravel(), _QUANTILE)
        return Recommendation(
            self.box.from_unit(u),
            float(mean.mean()),
            float(np.sqrt(variance.mean() + mean.var())),
            quantile,
            float(self.y[self._successful][index]),
            int(self._successful.sum()),
        )

    def predict(self, X: ArrayLike, *, under_noise: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the model's mean and standard deviation (q,) at X (q, d) in the box's units.

        With `under_noise`, of the outcome averaged over the input noise instead.
        """
        U = np.atleast_2d(self.box.to_unit(X))
        with single_threaded():
            perturbations = self._perturbations if under_noise else Perturbations(exact(self.box.dimension))
            mean, variance = mixture(perturbations.outcome(self._posterior(), U))
        return mean, np.sqrt(variance)

    @property
    def posterior(self) -> Posterior:
        """The surrogate conditioned on the trials told so far; inputs in the unit cube."""
        with single_threaded():
            return self._posterior()

    # --- inside -------------------------------------------------------------------------------------------------

    @property
    def _inputs(self) -> NDArray[np.float64]:
        return np.array(self._told).reshape(-1, self.box.dimension)

    @property
    def _successful(self) -> NDArray[np.bool_]:
        return np.isfinite(self._values)

    def _posterior(self) -> Posterior:
        values = self.y
        if not self._successful.any():
            raise InputError("no trial has given a value yet; tell the outcome of at least one.")
        if self._cache is not None and self._cache[0] == len(values):
            return self._cache[1]
        previous = None if self._thesis is None or self._cache is None else self._cache[1]
        values = np.where(self._successful, values, values[self._successful].min())
        posterior = self._surrogate.condition(self._inputs, values, self._rng(1, len(values)), previous)
        self._cache = (len(values), posterior)
        return posterior

    def _ranking(self, posterior: Posterior) -> NDArray[np.intp]:
        """Return the tried inputs that gave a value, as indices among them, best outcome under the noise first.

        All are ranked by sigma points; where the rule has more points, it ranks the first of them again.
        """
        tried = self._inputs[self._successful]
        first = self._perturbations if self._thesis is not None else self._sigma_points
        order = np.argsort(-first.outcome(posterior, tried).mean.mean(axis=0), kind="stable")
        top = order[:_SHORTLIST]
        outcomes = self._perturbations.outcome(posterior, tried[top]).mean.mean(axis=0)
        order[:_SHORTLIST] = top[np.argsort(-outcomes, kind="stable")]
        return order

    def _incumbent(self, posterior: Posterior) -> tuple[Any, NDArray[np.float64]]:
        """Return the value to improve upon, on the criterion's scale, and the best tried inputs (a, d)."""
        tried = self._inputs[self._successful]
        observed = self.y[self._successful]
        anchors = tried[self._ranking(posterior)[:_ANCHORS]]
        if self._thesis is not None:  # the original improves upon the best observed value inside UEI too
            return float(observed.max()), anchors
        if self._criterion.scale == "exact":
            values = mixture(posterior.moments(tried))[0] if self._noisy else observed
            return float(values.max()), tried[np.argsort(-values, kind="stable")[:_ANCHORS]]
        best = self._perturbations.outcome(posterior, anchors[:1]).mean  # (m, 1)
        return best if self._criterion.scale == "robust" else float(best.mean()), anchors

    def _rng(self, purpose: int, position: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, purpose, position])


def _same(u: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.all(np.abs(others - u) < _SEPARATION, axis=1)


def _count(name: str, value: int, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
    return int(value)


def _finite(y: float | None) -> float:
    if y is None:
        raise InputError("the trial has no value; give y, or failed=True for a trial that gave nothing.")
    try:
        value = np.asarray(y, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"y is {y!r}; give one finite number, or failed=True.") from None
    if value.size != 1 or not np.isfinite(value).all():
        raise InputError(f"y is {y!r}; give one finite number, or failed=True for a trial that gave nothing.")
    return float(value.reshape(()))


def _mixture_quantile(means: NDArray[np.float64], stds: NDArray[np.float64], level: float) -> float:
    """Return the quantile at `level` of an equally weighted mixture of normals, by bisection to rounding."""
    from scipy.special import ndtr

    low, high = float((means - 10.0 * stds).min()), float((means + 10.0 * stds).max())
    scale = np.maximum(stds, 1e-12 * max(high - low, 1e-300))
    for _ in range(60):
        middle = 0.5 * (low + high)
        if ndtr((middle - means) / scale).mean() < level:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)

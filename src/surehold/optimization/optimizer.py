"""The optimizer: ask for a trial, tell its outcome, and recommend the input that still holds when it is perturbed.

Legend
    u   point of the unit cube (d,); x the same point in the box's units
    t   trials told, failed ones included
"""

from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.acquisition.scales import criterion_name
from surehold.optimization.box import Box
from surehold.optimization.lattice import Lattice, LatticePosterior
from surehold.optimization.noise.estimation import noise_from_reached, noise_from_repeats
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.numerics.threads import single_threaded
from surehold.optimization.recommendation import Recommendation, recommendation
from surehold.optimization.strategy.goal import Goal
from surehold.optimization.strategy.initial_design import design as initial_design
from surehold.optimization.strategy.presets import thesis_preset
from surehold.optimization.surrogates.gaussian_process.model import NoiseName
from surehold.optimization.surrogates.named import refuse_settings, surrogate_named
from surehold.optimization.surrogates.noisy_inputs import condition_on_noisy_inputs
from surehold.optimization.surrogates.protocol import NoisySurrogate, Posterior, Surrogate, mixture
from surehold.optimization.trials import Trials, same

__all__ = ["Optimizer"]

# How often an exact trial may be repeated in the thesis presets. The original repeats a point twenty times before it
# jumps to a random one, which cost it whole runs.
_THESIS_REPEATS: Final = 2


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
        "gp" (default), "tgp" (a treed Gaussian process, for functions that are smooth here and rough there),
        "local_global" (rough around a center that is learnt, smooth elsewhere; the fewest trials where little of the
        box matters, at three times the time; no observation noise), or an object such as `GaussianProcess(...)`: see
        `surrogates.protocol.Surrogate`. An object says by its attribute `noisy` whether observations carry noise;
        without that attribute they are taken for exact.
    criterion
        "ei", "log_ei", "pi", "ucb"; with input noise also "uei", "ulog_ei", "upi", "uucb" (the criterion averaged over
        sigma points) and "robust_ei", ... (the criterion of the averaged outcome); "thompson" and "robust_thompson"
        (the maximum of a function, or of its outcome, drawn from the posterior). By default "log_ei" without and
        "robust_log_ei" with input noise; in the thesis presets "ei" and "uei".
    n_initial
        Trials of the initial design; by default 5 a variable, at least 6.
    design
        "latin_hypercube" (default), "sobol" or "uniform".
    seed
        Non-negative integer.
    noise
        Observation noise of "gp" and "tgp": "none" (what None, the default, stands for), its standard deviation in the
        outputs' units, "inferred", or "heteroscedastic" (inferred, differing from place to place). A surrogate object
        and a thesis preset have their own: there it must be None, not given.
    output_range
        (lowest, highest) value to expect, if known; None (default) where it is not, and beside a surrogate object or a
        thesis preset.
    quadrature
        How the input noise is averaged over: "unscented" (default of the criteria averaged over sigma points),
        "scaled_unscented", "central_difference", "gauss_hermite" or "quasi_monte_carlo" (default of the robust ones);
        "closed_form" for a GaussianProcess with the squared-exponential kernel.
    k
        Free parameter of the unscented transformation.
    border
        What happens to perturbed points outside the box: "extend" (default) evaluates the model there, "clip" moves
        them to the border, "keep" gives a coordinate that would leave its noise-free value.
    kappa
        Standard deviations added by the "ucb" criteria, and by the bounds of the "worst" risk.
    risk
        What is asked of the outcome under input noise: "mean" (default), "mean-std", "var", "cvar" or "worst", or a
        `Risk` with parameters of its own. Any but the mean replaces the criterion by the expected improvement of that
        measure, or, for "worst", by its upper confidence bound.
    noise_while_exploring
        Where the input noise acts. False (default): only when the answer is used; trials reach what is commanded, as in
        a simulator. True: trials stray, too. Those whose reached input is told (`tell(x, y, reached=...)`) are learnt
        from where they were; the others count as less precise where the function is steep (McHutchon and Rasmussen
        2011; left out where observation noise is inferred, which contains it). Needs a surrogate that takes the noise
        of single trials: "gp", "tgp" or such an object.
    trust_region
        Whether the next trial is sought in a box around the best one that grows with success and shrinks without
        (after TuRBO): an option for six variables and more; off by default.
    preset
        "thesis", or "thesis-rkhs", "thesis-gf", "thesis-gm", "thesis-gm-printed", "thesis-gm-noise", "thesis-grasp":
        the settings of the thesis, with the constants that it chose by hand for that problem.
    lattice
        Which points can be tried, where not all of the box can; see `lattice.Lattice`.

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
        noise: float | NoiseName | None = None,
        output_range: tuple[float, float] | None = None,
        quadrature: str | None = None,
        k: float = 1.0,
        border: str = "extend",
        kappa: float = 2.0,
        risk: str | Risk = "mean",
        noise_while_exploring: bool = False,
        trust_region: bool = False,
        preset: str | None = None,
        lattice: Lattice | None = None,
    ):
        if not isinstance(box, Box):
            raise InputError(f"box is {box!r}; give a surehold.Box of named bounds.")
        self.box: Final = box
        self.input_noise: Final = input_noise
        self.seed: Final = _count("seed", seed, 0)
        self.n_initial: Final = _count("n_initial", self.default_n_initial(box) if n_initial is None else n_initial, 1)
        thesis = None if preset is None else thesis_preset(preset)
        deviations = np.zeros(box.dimension)
        if input_noise is not None:
            deviations = np.sqrt(np.diag(input_noise.unit_covariance(box)))
        if not isinstance(surrogate, str):
            refuse_settings("a surrogate object", noise, output_range)
            self._surrogate: Surrogate = surrogate
        elif thesis is not None:
            refuse_settings(f"preset='{preset}'", noise, output_range)
            self._surrogate = thesis.surrogate(surrogate, deviations, self.seed)
        else:
            self._surrogate = surrogate_named(
                surrogate, noise=noise, output_range=output_range, input_deviations=deviations, seed=self.seed
            )
        if criterion is None:
            criterion = ("log_ei", "robust_log_ei", "ei", "uei")[2 * (thesis is not None) + (input_noise is not None)]
        name = criterion_name(criterion)
        if not np.isfinite(kappa):
            raise InputError(f"kappa is {kappa!r}; give a finite number of standard deviations.")
        risk = Risk(risk) if isinstance(risk, str) else risk
        if input_noise is None and (name.scale != "exact" or risk.name != "mean"):
            what = f"risk '{risk.name}'" if risk.name != "mean" else f"criterion '{criterion}'"
            raise InputError(f"{what} needs input noise; give input_noise=.")
        if input_noise is not None:
            input_noise.warn_if_larger_than(box)
        many = name.scale == "robust" or risk.name != "mean"
        rule = ("quasi_monte_carlo" if many else "unscented") if quadrature is None else quadrature
        self._goal = Goal(
            criterion=name,
            accurate=Perturbations.of(input_noise, box, rule, border, k=k),
            coarse=Perturbations.of(input_noise, box, "unscented", border),
            risk=risk,
            margin=0.0 if thesis is None else thesis.margin,
            kappa=float(kappa),
            noisy=getattr(self._surrogate, "noisy", False) or noise_while_exploring,
            trust_region=trust_region,
            n_initial=self.n_initial,
            thesis=thesis is not None,
        )
        takes_noise = isinstance(self._surrogate, NoisySurrogate)
        if noise_while_exploring and (input_noise is None or thesis is not None or not takes_noise):
            raise InputError(
                "noise_while_exploring needs input_noise= and a surrogate that takes the noise of single trials ('gp', "
                "'tgp', or an object with known_noise), without a thesis preset."
            )
        self._straying = noise_while_exploring
        self._lattice = lattice
        rng = np.random.default_rng([self.seed, 0])
        self._design = initial_design(design, self.n_initial, box.dimension, rng)
        self._trials = Trials(box)
        self._cache: tuple[int, Posterior] | None = None

    @staticmethod
    def default_n_initial(box: Box) -> int:
        """Return the size of the initial design where none is given: 5 a variable, at least 6."""
        return max(6, 5 * box.dimension)

    # --- trials -------------------------------------------------------------------------------------------------

    @property
    def X(self) -> NDArray[np.float64]:
        """Inputs commanded so far, failed ones included, (t, d), in the box's units."""
        return self.box.from_unit(self._trials.commanded)

    @property
    def y(self) -> NDArray[np.float64]:
        """Values told so far, (t,); NaN for failed trials."""
        return self._trials.values

    @property
    def pending(self) -> NDArray[np.float64]:
        """Inputs asked for and not told yet, (p, d), in the box's units."""
        return self.box.from_unit(self._trials.pending)

    def tell(
        self, x: ArrayLike, y: float | None = None, *, failed: bool = False, reached: ArrayLike | None = None
    ) -> None:
        """Record the outcome y of a trial at x (d,), or that it gave nothing.

        A failed trial counts for the model as the lowest value told so far, so that it is avoided. If x is pending it
        is so no more; a trial that was never asked for is welcome too. Where the input that was truly reached (d,) is
        known, the model learns from that one.

        Raises
        ------
        InputError
            If x or reached has the wrong shape, is not finite or lies outside the box; if y is missing, not finite or
            not a number; if a failed trial comes with a value. Nothing told before is lost.
        """
        self._trials.tell(x, y, failed, reached)

    def forget(self, x: ArrayLike) -> None:
        """Drop a pending trial at x (d,) that will never be told; raises InputError if it is not pending."""
        self._trials.forget(x)

    def restore(
        self, X: ArrayLike, y: ArrayLike, *, reached: ArrayLike | None = None, pending: ArrayLike | None = None
    ) -> None:
        """Replace all trials by stored ones: X (t, d) with values y (t,), NaN for failed ones, and pending (p, d).

        `reached` (t, d) are the inputs that were truly reached, X where None. What is asked next is what an optimizer
        asks that was told these trials in this order.

        Raises
        ------
        InputError
            If shapes do not fit, an input is not finite or lies outside the box, or a value is infinite.
        """
        trials = Trials(self.box)
        trials.restore(X, y, X if reached is None else reached, () if pending is None else pending)
        if not trials.equal(self._trials):
            self._cache = None
        self._trials = trials

    # --- ask ----------------------------------------------------------------------------------------------------

    def ask(self, n: int | None = None, *, number: int | None = None) -> NDArray[np.float64]:
        """Return the next trial (d,), or the next n trials (n, d) for parallel execution, in the box's units.

        Points asked for are pending until they are told: further asks keep away from them.

        `number` is the number of the (first) trial asked for, 0 for the first of all: its place in the initial design
        and in the random sequence. By default as many as are told or pending.
        """
        first = len(self._trials) + len(self._trials.pending) if number is None else _count("number", number, 0)
        if n is None:
            return self._ask_one(first)
        return np.array([self._ask_one(first + i) for i in range(_count("n", n, 1))])

    def _ask_one(self, position: int) -> NDArray[np.float64]:
        if position < self.n_initial:
            u = self._design[position]
        elif not self._trials.successful.any():
            u = self._rng(2, position).random(self.box.dimension)  # every trial failed or is pending: keep covering
        else:
            with single_threaded():
                u = self._propose(self._rng(2, position))
        u = self._snapped(u)
        self._trials.ask(u)
        return self.box.from_unit(u)

    def _propose(self, rng: np.random.Generator) -> NDArray[np.float64]:
        told, pending = self._trials.successful, self._trials.pending
        candidates = self._goal.candidates(
            self._posterior(),
            self._trials.reached[told],
            self._trials.values[told],
            pending,
            self._trials.reached[~told],
            rng,
        )
        candidates = self._snapped(candidates)
        if self._goal.noisy:
            return candidates[0]
        repeats = _THESIS_REPEATS if self._goal.thesis else 0
        tried = np.concatenate([self._trials.commanded, pending])
        for candidate in candidates[:1] if self._goal.thesis else candidates:
            if np.count_nonzero(same(candidate, tried)) <= repeats:
                return candidate
        return rng.random(self.box.dimension)  # every candidate has been tried already

    # --- recommend ----------------------------------------------------------------------------------------------

    def recommend(self, where: Literal["observed", "box"] = "observed") -> Recommendation:
        """Return the input whose outcome under the input noise is expected best.

        Parameters
        ----------
        where
            "observed": among the inputs that were tried, thesis (3.22). "box": anywhere in the box, by the model.

        Raises
        ------
        InputError
            If no trial has given a value yet.
        """
        if where not in ("observed", "box"):
            raise unknown_name("place of the recommendation", where, ("observed", "box"))
        told = self._trials.successful
        tried, values = self._trials.reached[told], self._trials.values[told]
        with single_threaded():
            posterior = self._posterior()
            if where == "observed":
                index = int(self._goal.rank(posterior, tried, values)[0])
                u, observed = tried[index], float(values[index])
            else:
                u, observed = self._snapped(self._goal.best(posterior, tried, self._rng(3, len(self._trials)))), np.nan
            border = self._goal.accurate.border
            reached = Perturbations.of(self.input_noise, self.box, "quasi_monte_carlo", border, exponent=7)
            highest = int(np.argmax(values))
            return recommendation(
                posterior,
                reached,
                self._goal.coarse,
                u,
                self.box.from_unit(u),
                observed,
                (tried[highest], float(values[highest])),
                len(values),
            )

    def predict(self, X: ArrayLike, *, under_noise: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the model's mean and standard deviation (q,) at X (q, d) in the box's units.

        With `under_noise`, of the outcome averaged over the input noise instead.
        """
        U = np.atleast_2d(self.box.to_unit(X))
        perturbations = self._goal.accurate if under_noise else Perturbations(exact(self.box.dimension))
        with single_threaded():
            mean, variance = mixture(perturbations.outcome(self._posterior(), U))
        return mean, np.sqrt(variance)

    def promise(self) -> float:
        """Return the largest improvement that a further input is expected to bring, in the outputs' units.

        Of the outcome under the input noise, over the best input tried so far; small where there is little left to
        find. Raises InputError if no trial has given a value yet.
        """
        told = self._trials.successful
        with single_threaded():
            posterior = self._posterior()
            return self._goal.promise(
                posterior, self._trials.reached[told], self._trials.values[told], self._rng(4, len(self._trials))
            )

    def estimate_input_noise(self) -> InputNoise:
        """Return the input noise that the trials told so far show.

        From the reached inputs if enough trials told them; else from values that differ between trials of one commanded
        input, taking the noise for the same share of the box in every variable and observations for exact.

        Raises
        ------
        InputError
            If there are neither; it says what to tell.
        """
        told, reported = self._trials.successful, self._trials.reported
        if reported.any():
            return noise_from_reached(self.box, self._trials.commanded[reported], self._trials.reached[reported])
        with single_threaded():
            return noise_from_repeats(self._trials.commanded[told], self._trials.values[told])

    @property
    def posterior(self) -> Posterior:
        """The surrogate conditioned on the trials told so far; inputs in the unit cube."""
        with single_threaded():
            return self._posterior()

    # --- inside -------------------------------------------------------------------------------------------------

    def _posterior(self) -> Posterior:
        t = len(self._trials)
        if not self._trials.successful.any():
            raise InputError("no trial has given a value yet; tell the outcome of at least one.")
        if self._cache is not None and self._cache[0] == t:
            return self._cache[1]
        previous = self._cache[1] if self._goal.thesis and self._cache is not None else None
        stream = t if self._goal.thesis else 0  # one stream for all: what was learnt from some trials stays as it was
        rng = self._rng(1, stream)
        if self._straying and self.input_noise is not None and isinstance(self._surrogate, NoisySurrogate):
            roots = self.input_noise.unit_roots(self.box, self._trials.commanded).copy()
            roots[self._trials.reported] = 0.0
            posterior = condition_on_noisy_inputs(
                self._surrogate, self._trials.reached, self._trials.modelled, roots, [self.seed, 1, 0]
            )
        else:
            posterior = self._surrogate.condition(self._trials.reached, self._trials.modelled, rng, previous)
        if self._lattice is not None:
            posterior = LatticePosterior(posterior, self._lattice)
        self._cache = (t, posterior)
        return posterior

    def _snapped(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        return U if self._lattice is None else self._lattice.snap(U)

    def _rng(self, purpose: int, position: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, purpose, position])


def _count(name: str, value: int, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
    return int(value)

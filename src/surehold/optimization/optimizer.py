"""The optimizer: ask for a trial, tell its outcome, and recommend the input that still holds when it is perturbed.

Legend
    u   point of the unit cube (d,); x the same point in the box's units
    t   trials told, failed ones included
"""

from collections.abc import Callable, Mapping
from inspect import signature
from typing import TYPE_CHECKING, Any, Final, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.defaults import CONTENDERS, FEASIBLE, FEW_VARIABLES, KAPPA, MEAN_EXPONENT_OF_FEW, OUTCOME_EXPONENT
from surehold.errors import InputError, unknown_name
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.asking import Asking, history_of
from surehold.optimization.assembly import assembled, default_n_initial, whole_number
from surehold.optimization.box import Box
from surehold.optimization.compilation import compile_ahead
from surehold.optimization.diagnosis import Diagnosis
from surehold.optimization.lattice import LatticePosterior
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.numerics.threads import computing
from surehold.optimization.recommendation import Recommendation, recommendation
from surehold.optimization.record import Record
from surehold.optimization.strategy.promise import promise
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.success import described
from surehold.optimization.surrogates.gaussian_process.observations import NoiseName
from surehold.optimization.surrogates.protocol import Posterior, Surrogate, mixture
from surehold.optimization.surrogates.success.preference import PreferencePosterior
from surehold.optimization.trial_inputs import query_points
from surehold.optimization.trials import AskedTrial, Trials

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Optimizer", "check_settings"]

_MOST_AT_ONCE = 100_000  # trials asked for in one call; more is a slip of the pen


class Optimizer(Record):
    """Bayesian optimization by ask and tell.

    What `ask` returns depends on the settings, the trials told, the pending trials and the seed alone: an optimizer
    loaded from a file asks the same next point. One that is restored from X does so up to rounding, see `restore`. (The
    thesis presets continue their chains and do neither.)

    Parameters
    ----------
    box
        The search space. Where it is not plain (it has logarithms, whole numbers or choices), trials are handed out by
        `ask_trial`, as dictionaries.
    direction
        "maximize" (default) or "minimize". Whatever is told and answered is in the user's own sign; the model, the
        criteria and `posterior` are of the negated values where the optimizer minimizes.
    input_noise
        How far the reached input strays from the commanded one; None for inputs that are reached exactly.
    surrogate
        "two_scales" (default without a preset: a Gaussian process of one rough scale, of one smooth scale, the sum of
        a long and a short one, or, in 2 to 30 variables, a sum of processes of one variable each, whichever the trials
        speak for), "gp" (one rough scale; default of the presets),
        "tgp" (a treed Gaussian process, for functions that are smooth here and rough there), "local_global" (rough
        around a center that is learnt, smooth elsewhere; the fewest trials where little of the box matters, at three
        times the time; no observation noise), or an object such as `GaussianProcess(...)`: see
        `surrogates.protocol.Surrogate`. An object says by its attribute `noisy` whether observations carry noise;
        without that attribute they are taken for exact.
    criterion
        "ei", "log_ei", "pi", "ucb"; with input noise also "uei" and "ulog_ei" (the criterion averaged over sigma
        points) and "robust_ei", ... (the criterion of the averaged outcome); "thompson" and "robust_thompson" (the
        maximum of a function, or of its outcome, drawn from the posterior). By default "log_ei" without and
        "robust_log_ei" with input noise; in the thesis presets "ei" and "uei".
    n_initial
        Trials of the initial design; by default 5 for each of the d variables that are not fixed, at least
        6 and at most 20 + d/5. With `safety` the `initial_points` alone.
    initial_points
        Points to be tried first, (i, d) or a list of whatever `tell` takes as x; they count as trials of the initial
        design, whose rest follows.
    guess
        {name: value} of variables of which it is known where the optimum may be: two of three trials of the initial
        design keep these values, the third is anywhere. Of those that would be the same trial, as where all variables
        are named, the first is made there, and the others around it. After the initial design it counts no more.
    fixed
        {name: value} of variables that keep this value in every trial that is asked for and in every answer. Trials
        told at other values teach the model, but are no answer.
    design
        "latin_hypercube" (default), "sobol" or "uniform".
    seed
        Non-negative integer.
    noise
        Observation noise of "two_scales", "gp" and "tgp": "none" (what None, the default, stands for), its standard
        deviation in the outputs' units, "inferred", "heteroscedastic" (inferred, differing from place to place once
        the trials show it), or "told": each trial tells its own, `tell(x, y, noise=0.2)`. A surrogate object and a
        thesis preset have their own: there it must be None, not given.
    output_range
        (lowest, highest) value to expect, if known; None (default) where it is not, and beside a surrogate object or a
        thesis preset.
    quadrature
        How the input noise is averaged over: "unscented" (default of the criteria averaged over sigma points),
        "scaled_unscented", "central_difference", "gauss_hermite" or "quasi_monte_carlo" (default of the robust ones);
        "closed_form" for a GaussianProcess with the squared-exponential kernel. The risk measures but
        "mean" and "worst" take a rule without negative weights.
    k
        Free parameter of the unscented transformation.
    border
        What happens to perturbed points outside the box: "extend" (default) evaluates the model there, "clip" moves
        them to the border, "keep" gives a coordinate that would leave its noise-free value.
    kappa
        Standard deviations added by the "ucb" criteria, and by the bounds of the "worst" risk.
    risk
        What is asked of the outcome under input noise: "mean" (default), "mean-std", "mean-variance", "var", "cvar" or
        "worst", or a `Risk` with parameters of its own. Any but the mean replaces the criterion by the expected
        improvement of that measure, or, for "worst", by its upper confidence bound.
    noise_while_exploring
        Where the input noise acts. False (default): only when the answer is used; trials reach what is commanded, as in
        a simulator. True: trials stray, too. Those whose reached input is told (`tell(x, y, reached=...)`) are learnt
        from where they were; the others count as less precise where the function is steep or bends (McHutchon and
        Rasmussen 2011; left out where observation noise is inferred, which contains it). Needs a surrogate that takes
        the noise of single trials: "two_scales", "gp", "tgp" or such an object.
    trust_region
        Whether the next trial is sought in a box around the best one that grows with success and shrinks without
        (after TuRBO): an option for six variables and more; off by default.
    preset
        "thesis", or "thesis-rkhs", "thesis-gf", "thesis-gm", "thesis-gm-printed", "thesis-gm-noise", "thesis-grasp":
        the settings of the thesis, with the constants that it chose by hand for that problem. It chooses trials in a
        way of its own, so that `risk`, `trust_region` and the Thompson criteria cannot be combined with it.
    allowed
        Which inputs may be commanded: a `Linear` constraint or its text ("a + 2*b <= 3"), a function of x (d,) in the
        box's units ({name: value} where the box is not plain) that returns True or False, or a list of these. Kept by
        every trial that is asked for and by every answer. Perturbed points are treated as at the border of the box, see
        `border`.
    constraints
        {name: (lower, upper)} of further outputs that each trial tells (`tell(x, y, constraints={name: value})`), in
        their own units; None where there is no limit. With (None, None) an output is recorded and modelled only.
    feasible
        Probability with which the answer has to keep all limits of `constraints`: over the input noise (the share of
        executions) and what the models do not know, without the noise of observations.
    safety
        Probability with which every trial after the `initial_points`, which must be given and are trusted, has to keep
        all limits. By default None: trials may break them. It holds as far as the models do, without a proof, and what
        cannot be reached through safe inputs is never found (after Sui et al. 2015).
    failures
        What a failed trial teaches. "modelled": the response is learnt from the others alone, and a model of where
        trials succeed multiplies the criterion by the square of that probability. "lowest": it counts as the lowest
        value told. By default "modelled" for the first 200 trials, of which such a model is cheap, and "lowest" beyond;
        in the thesis presets "lowest".
    conditions
        Of a box with uncontrolled variables, while exploring: "commanded" (default), as in a simulator: every trial
        says at which condition it is to be made. "measured", as on a robot: trials are made at whatever comes, and each
        tells it (`tell(x, y, reached={"payload": 1.3})`); what `ask` says of these variables is their mean. The answer
        is good on average over them, or by `risk`, and holds their mean, which nobody sets.
    outcome
        "value" (default): a trial gives a number. "success": it succeeds or fails, `tell(x, success=True)`, or does so
        several times, `tell(x, successes=7, of=10)`. What is maximized is then the probability to succeed, under the
        input noise; `y` and `predict` are shares and probabilities, and `Recommendation.probability_of_share` answers
        how sure it is that nine of ten executions succeed. Model and criterion are its own (Tesch et al. 2013);
        `surrogate` is then "probit" (default) or "beta_process", which counts near by (Montesano and Lopes 2012).
        "preference": two trials are compared, `tell_preference(better, worse)` (Chu and Ghahramani 2005). What is
        maximized is a utility, in units of the error with which it is judged; `y` is the share of its comparisons
        that an input won, and `preferred(x, other)` says how probably x would win.

    Raises
    ------
    InputError
        For unknown names and values out of range; the message names the valid ones.
    """

    def __init__(
        self,
        box: Box,
        *,
        direction: str = "maximize",
        input_noise: InputNoise | None = None,
        surrogate: str | Surrogate | None = None,
        criterion: str | None = None,
        n_initial: int | None = None,
        initial_points: Any = None,
        guess: Mapping[str, Any] | None = None,
        fixed: Mapping[str, Any] | None = None,
        design: str = "latin_hypercube",
        seed: int = 0,
        noise: float | NoiseName | Literal["told"] | None = None,
        output_range: tuple[float, float] | None = None,
        quadrature: str | None = None,
        k: float = 1.0,
        border: str = "extend",
        kappa: float = KAPPA,
        risk: str | Risk = "mean",
        noise_while_exploring: bool = False,
        trust_region: bool = False,
        preset: str | None = None,
        allowed: Any = None,
        constraints: Mapping[str, Any] | None = None,
        feasible: float = FEASIBLE,
        safety: float | None = None,
        conditions: Literal["commanded", "measured"] = "commanded",
        failures: Literal["lowest", "modelled"] | None = None,
        outcome: str = "value",
    ):
        given = {name: value for name, value in locals().items() if name not in ("self", "box", "__class__")}
        parts = assembled(box, given)
        super().__init__(box, parts.settings, parts.limits)
        self.input_noise: Final = parts.input_noise
        self.seed: Final = parts.seed
        self.n_initial: Final = parts.n_initial
        self.risk: Final = parts.strategy.ranking.risk
        self._lattice: Final = parts.lattice
        self._strategy: Final = parts.strategy
        self._model: Final = parts.model
        self._requirements: Final = parts.requirements
        self._asking: Final = Asking(box, parts, self._conditions_measured)
        compile_ahead(given)

    @staticmethod
    def default_n_initial(box: Box, variables: int | None = None) -> int:
        """Return the size of the initial design where none is given: 5 for each variable, at least 6, at most 20 + d/5.

        `variables` are those that can vary, where the box has others.
        """
        return default_n_initial(box, variables)

    # --- trials -------------------------------------------------------------------------------------------------

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether each trial may become the answer, (t,): it gave a value and satisfies all that is required."""
        return self._trials.eligible if self._requirements is None else self._requirements.feasible(self._trials)

    def _replaced(self) -> None:
        self._model.forget()
        if self._requirements is not None:
            self._requirements.forget()

    # --- ask ----------------------------------------------------------------------------------------------------

    def ask(self, n: int | None = None, *, number: int | None = None) -> NDArray[np.float64]:
        """Return the next trial (d,), or the next n trials (n, d) for parallel execution, in the box's units.

        Points asked for are pending until they are told: further asks keep away from them.

        `number` is the number of the (first) trial asked for, 0 for the first of all: its place in the initial design
        and in the random sequence. By default the lowest that is free.

        Raises
        ------
        InputError
            If the box is not plain: `ask_trial` then names what to try.
        """
        if not self.box.plain:
            raise InputError(
                "some variables are logarithmic, whole numbers or choices; ask_trial().parameters has them."
            )
        if n is None:
            return self._ask_one(number).x
        return np.array([trial.x for trial in self._ask(n, number)])

    @overload
    def ask_trial(self, n: None = None, *, number: int | None = None) -> AskedTrial: ...

    @overload
    def ask_trial(self, n: int, *, number: int | None = None) -> list[AskedTrial]: ...

    def ask_trial(self, n: int | None = None, *, number: int | None = None) -> AskedTrial | list[AskedTrial]:
        """Ask as `ask` does, for trials that know their numbers: `tell` takes one in place of x.

        However a rig rounds or names its inputs, the answer belongs to the trial that was asked for.

        Examples
        --------
        >>> from surehold import Box, Optimizer
        >>> optimizer = Optimizer(Box({"force": (0.1, 10.0, "log"), "grip": ["pinch", "power"]}), seed=0)
        >>> sorted(optimizer.ask_trial().parameters)
        ['force', 'grip']
        >>> from surehold import Box, Optimizer
        >>> optimizer = Optimizer(Box({"temperature": (20.0, 120.0)}), seed=0)
        >>> trial = optimizer.ask_trial()
        >>> optimizer.tell(trial, 0.7, reached=trial.x.round())
        >>> len(optimizer.pending)
        0
        """
        return self._ask_one(number) if n is None else self._ask(n, number)

    def _ask(self, n: int, number: int | None) -> list[AskedTrial]:
        asked: list[AskedTrial] = []
        try:
            for i in range(whole_number("n", n, 1, _MOST_AT_ONCE)):
                asked.append(self._ask_one(None if number is None else number + i))
        except BaseException:  # Ctrl-C, too: nobody would make those that were asked for before it
            for trial in asked:
                self._trials.forget(trial)
            raise
        return asked

    def _ask_one(self, number: int | None) -> AskedTrial:
        position = self._trials.next_number if number is None else whole_number("number", number, 0)
        modelled = self._modelled
        u = self._asking.place(
            self._trials, position, number is not None, lambda: self._model.posterior_of_search(modelled)
        )
        x = self.box.from_unit(u)
        return AskedTrial(self._trials.ask(position, u), x, self.box.as_dict(x))

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
            If no trial has given a value yet, or none at the values of `fixed` variables.
        """
        if where not in ("observed", "box"):
            raise unknown_name("place of the recommendation", where, ("observed", "box"))
        history, ranking = self._history, self._ranking
        with computing():
            posterior = self.posterior
            if not len(history.tried):
                if self._requirements is None:
                    raise InputError(
                        "no trial at the values of fixed variables has given a value yet; ask for one, and tell its "
                        "outcome."
                    )
                where, history = "observed", self._requirements.nearest(self._trials)
            reached = self._reached(OUTCOME_EXPONENT)
            few = self.box.dimension <= FEW_VARIABLES and posterior.diagnostics.observations <= CONTENDERS
            finer = self._reached(MEAN_EXPONENT_OF_FEW) if few and not ranking.exact_inputs else None
            if where == "observed":
                index = int(ranking.order(posterior, history.tried, history.observed)[0])
                u, observed = self._snapped(history.tried[index]), float(history.observed[index])
            else:
                rng = self._rng(3, len(self._trials))
                strict = None if self._requirements is None else self._requirements.strict(self._trials)
                u, observed = self._snapped(ranking.best(posterior, history, rng, strict)), np.nan
            best = int(np.argmax(history.observed))
            highest, top = (history.tried[best], float(history.observed[best])), int(np.nanargmax(self._trials.values))
            no_answer, doubt = "", self.diagnosis()
            if self._trials.values[top] > highest[1]:
                highest = self._trials.reached[top], float(self._trials.values[top])
                no_answer = self._trials.why_no_answer(top)
            if self.box.uncontrolled is not None:  # settings are compared, under all conditions
                u = self.box.uncontrolled.at_mean(u)
                highest = self.box.uncontrolled.at_mean(highest[0]), highest[1]
            answer = recommendation(
                posterior,
                reached,
                finer,
                u,
                self.box,
                observed,
                highest,
                int(self._trials.successful.sum()),
                self._sign,
                tuple(np.flatnonzero(self._trials.outliers).tolist()),
                self._model.execution_noise(self._trials, reached),
                " ".join(said for said in (self._trials.astray, "" if doubt is None else doubt.warning) if said),
                self.risk,
                ranking.judged(posterior, highest[0], u),
                no_answer,
            )
            if self._requirements is not None:
                answer = self._requirements.described(answer, self._trials, u, reached, self._sign)
            return described(answer, posterior, reached, u) if self.outcome == "success" else answer

    def predict(self, X: ArrayLike, *, under_noise: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the model's mean and standard deviation (q,) at X (q, d) in the box's units.

        With `under_noise`, of the outcome averaged over the input noise instead, by the perturbations that the search
        uses: the deviation is the model's, and says nothing of how exact that average is (`recommend` takes more).

        Raises InputError if no trial has given a value yet, or X are no finite points.
        """
        U = query_points(self.box, X)
        perturbations = self._ranking.accurate if under_noise else Perturbations(exact(self.box.dimension))
        with computing():
            mean, variance = mixture(perturbations.outcome(self.posterior, U))
        return self._sign * mean, np.sqrt(variance)

    def risk_measure(self, X: ArrayLike) -> NDArray[np.float64]:
        """Return what X (q, d), in the box's units, is expected to be worth by the `risk` that was asked for, (q,).

        Under the input noise; by default its mean, as of `predict`, and raises InputError as that does.
        """
        U = query_points(self.box, X)
        with computing():
            return self._sign * self._ranking.worth(self.posterior, U)

    def preferred(self, x: Any, other: Any) -> float:
        """Return the probability that one judgement prefers x to `other`, both (d,) in the box's units.

        Raises InputError where `outcome` is not "preference", or nothing was told yet.
        """
        posterior = self.posterior
        posterior = posterior.unrounded if isinstance(posterior, LatticePosterior) else posterior
        if not isinstance(posterior, PreferencePosterior):
            raise InputError("only an Optimizer(..., outcome='preference') knows which input would be preferred.")
        return posterior.preferred(*(self._snapped(self.box.to_unit(u)) for u in (x, other)))

    def diagnosis(self) -> Diagnosis | None:
        """Return how well the model predicts each trial from the others; None where it cannot tell.

        Raises InputError if no trial has given a value yet.
        """
        return self._model.diagnosis(self._modelled)

    def promise(self) -> float:
        """Return the largest improvement that a further input is expected to bring, in the outputs' units.

        Of the outcome under the input noise, over the best input tried so far; small where there is little left to
        find, infinite where no trial may become the answer yet. Raises InputError if no trial has given a value yet.
        """
        with computing():
            return promise(self._ranking, self.posterior, self._history, self._rng(4, len(self._trials)))

    @property
    def posterior(self) -> Posterior:
        """The surrogate conditioned on the trials told so far; inputs in the unit cube."""
        return self._model.posterior(self._modelled)

    def plot_slice(self, x: Any = None) -> "Figure":
        """Return the model along each coordinate, a figure of matplotlib; see `surehold.reports.slices.plot_slice`."""
        from surehold.reports.slices import plot_slice

        return plot_slice(self, x)

    def __repr__(self) -> str:
        parts = [f"{len(self._trials)} trials", f"{len(self._trials.pending)} pending"]
        found = self.y[np.isfinite(self.y)]
        if len(found):
            parts.append(f"best {self._sign * (self._sign * found).max():.6g}")
        return f"<Optimizer of {', '.join(self.box.names)} ({self.direction}): {', '.join(parts)}>"

    # --- inside -------------------------------------------------------------------------------------------------

    @property
    def _modelled(self) -> Trials:
        """The trials that the response is learnt from."""
        model_failures = self._requirements is not None and self._requirements.model_failures(self._trials)
        return self._trials.without_failed() if model_failures else self._trials

    @property
    def _ranking(self) -> Ranking:
        return self._strategy.ranking

    @property
    def _history(self) -> History:
        return history_of(self._trials, self._requirements, self._trials.modelled)

    def _reached(self, exponent: int) -> Perturbations:
        """Return 2**exponent quasi-random perturbations of the input noise."""
        accurate = self._ranking.accurate
        return Perturbations.of(
            self.input_noise,
            self.box,
            "quasi_monte_carlo",
            accurate.border,
            exponent=exponent,
            allowed=accurate.allowed,
        )

    def _snapped(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        return U if self._lattice is None else self._lattice.snap(U)

    def _rng(self, purpose: int, position: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, purpose, position])


def check_settings(settings: Mapping[str, Any], *owners: Callable[..., Any]) -> None:
    """Raise InputError for a name that is no setting of an `Optimizer`, nor one of the owners' own arguments."""
    named = [name for function in (Optimizer, *owners) for name in signature(function).parameters]
    known = [name for name in named if name not in ("f", "box", "settings")]
    for name in settings:
        if name not in known:
            raise unknown_name("setting", name, known)

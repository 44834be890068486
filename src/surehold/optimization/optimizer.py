"""The optimizer: ask for a trial, tell its outcome, and recommend the input that still holds when it is perturbed.

Legend
    u   point of the unit cube (d,); x the same point in the box's units
    t   trials told, failed ones included
"""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.defaults import (
    DESIGN_LEAST,
    DESIGN_MOST,
    DESIGN_PER_VARIABLE,
    DESIGN_VARIABLES_PER_MORE,
    FEASIBLE,
    KAPPA,
    OUTCOME_EXPONENT,
)
from surehold.errors import InputError, unknown_name
from surehold.optimization import saving
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.argument_kinds import check_kinds
from surehold.optimization.box import Box
from surehold.optimization.compilation import compile_ahead
from surehold.optimization.constraints.input import region_of
from surehold.optimization.diagnosis import Diagnosis
from surehold.optimization.lattice import lattice_of
from surehold.optimization.limits import limits_of
from surehold.optimization.noise.estimation import noise_from_reached, noise_from_repeats
from surehold.optimization.noise.input_noise import InputNoise, noise_of_coordinates
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact
from surehold.optimization.numerics.threads import single_threaded
from surehold.optimization.recommendation import Recommendation, recommendation
from surehold.optimization.required import required
from surehold.optimization.response_model import ResponseModel, chosen_surrogate
from surehold.optimization.strategy.initial_design import design as initial_design
from surehold.optimization.strategy.named import strategy_named
from surehold.optimization.strategy.promise import promise
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.thesis import thesis_preset
from surehold.optimization.strategy.trust_region import TrustRegion
from surehold.optimization.success import check_combination, counted, described
from surehold.optimization.surrogates.gaussian_process.model import NoiseName
from surehold.optimization.surrogates.named import TELLABLE
from surehold.optimization.surrogates.protocol import NoisySurrogate, Posterior, Surrogate, mixture
from surehold.optimization.surrogates.success.model import SuccessProcess
from surehold.optimization.trials import AskedTrial, Trials, initial_inputs, number_of, same, told_noise

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Optimizer"]


class Optimizer:
    """Bayesian optimization by ask and tell.

    What `ask` returns depends on the settings, the trials told, the pending trials and the seed alone: an optimizer
    rebuilt from stored trials asks the same next point. (The thesis presets continue their chains and do not.)

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
        "two_scales" (default without a preset: a Gaussian process that is the sum of a long and a short one, as far as
        the trials show two scales), "gp" (one scale; default of the presets), "tgp" (a treed Gaussian process, for
        functions that are smooth here and rough there),
        "local_global" (rough around a center that is learnt, smooth elsewhere; the fewest trials where little of the
        box matters, at three times the time; no observation noise), or an object such as `GaussianProcess(...)`: see
        `surrogates.protocol.Surrogate`. An object says by its attribute `noisy` whether observations carry noise;
        without that attribute they are taken for exact.
    criterion
        "ei", "log_ei", "pi", "ucb"; with input noise also "uei" and "ulog_ei" (the criterion averaged over sigma
        points) and "robust_ei", ... (the criterion of the averaged outcome); "thompson" and "robust_thompson" (the
        maximum of a function, or of its outcome, drawn from the posterior). By default "log_ei" without and
        "robust_log_ei" with input noise; in the thesis presets "ei" and "uei".
    n_initial
        Trials of the initial design; by default 5 for each of the d variables that are not fixed, at least
        6 and at most 20 + d/5.
    initial_points
        Points to be tried first, (i, d) or a list of whatever `tell` takes as x; they count as trials of the initial
        design, whose rest follows.
    fixed
        {name: value} of variables that keep this value in every trial.
    design
        "latin_hypercube" (default), "sobol" or "uniform".
    seed
        Non-negative integer.
    noise
        Observation noise of "two_scales", "gp" and "tgp": "none" (what None, the default, stands for), its standard
        deviation in the outputs' units, "inferred", "heteroscedastic" (inferred, differing from place to place), or
        "told": each trial tells its own, `tell(x, y, noise=0.2)`. A surrogate object and a thesis preset have their
        own: there it must be None, not given.
    output_range
        (lowest, highest) value to expect, if known; None (default) where it is not, and beside a surrogate object or a
        thesis preset.
    quadrature
        How the input noise is averaged over: "unscented" (default of the criteria averaged over sigma points),
        "scaled_unscented", "central_difference", "gauss_hermite" or "quasi_monte_carlo" (default of the robust ones);
        "closed_form" for a GaussianProcess with the squared-exponential kernel. The risk measures "mean-std", "var" and
        "cvar" take a rule without negative weights.
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
        from where they were; the others count as less precise where the function is steep (McHutchon and Rasmussen
        2011; left out where observation noise is inferred, which contains it). Needs a surrogate that takes the noise
        of single trials: "two_scales", "gp", "tgp" or such an object.
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
        executions) and what the models do not know.
    safety
        Probability with which every trial after the `initial_points`, which must be given and are trusted, has to keep
        all limits. By default None: trials may break them. What that guarantees, and what not, is said in
        `requirements.Requirements.admission`.
    failures
        What a failed trial teaches. "lowest" (default): it counts as the lowest value told. "modelled": the response is
        learnt from the others alone, and a model of where trials succeed multiplies the criterion by that probability.
    conditions
        Of a box with uncontrolled variables, while exploring: "commanded" (default), as in a simulator: every trial
        says at which condition it is to be made. "measured", as on a robot: trials are made at whatever comes, and each
        tells it (`tell(x, y, reached={"payload": 1.3})`); what `ask` says of these variables is their mean. The answer
        is good on average over them, or by `risk`, and holds their mean, which nobody sets.
    outcome
        "value" (default): a trial gives a number. "success": it succeeds or fails, `tell(x, success=True)`, or does so
        several times, `tell(x, successes=7, of=10)`. What is maximized is then the probability to succeed, under the
        input noise; `y` and `predict` are shares and probabilities, and `Recommendation.probability_of_share` answers
        how sure it is that nine of ten executions succeed. Model and criterion are its own (Tesch et al. 2013).

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
        failures: Literal["lowest", "modelled"] = "lowest",
        outcome: str = "value",
    ):
        given = {name: value for name, value in locals().items() if name not in ("self", "box")}
        if not isinstance(box, Box):
            raise InputError(f"box is {box!r}; give a surehold.Box of named bounds.")
        check_kinds(given)
        if direction not in ("maximize", "minimize"):
            raise unknown_name("direction", direction, ("maximize", "minimize"))
        if outcome not in ("value", "success"):
            raise unknown_name("outcome", outcome, ("value", "success"))
        if outcome == "success":
            check_combination(given)
        self.box: Final = box
        self.outcome: Final = outcome
        self.direction: Final = direction
        self._sign: Final = 1.0 if direction == "maximize" else -1.0
        self.input_noise: Final = noise_of_coordinates(input_noise, box)
        input_noise = self.input_noise
        self.seed: Final = _count("seed", seed, 0)
        variables = len(box.variables) - len(fixed or ())
        first = initial_inputs(box, initial_points)
        self._settings = given | {"initial_points": None if initial_points is None else box.from_unit(first).tolist()}
        wanted = self.default_n_initial(box, variables) if n_initial is None else n_initial
        self.n_initial: Final = len(first) if safety is not None else max(_count("n_initial", wanted, 1), len(first))
        if output_range is not None and direction == "minimize":
            output_range = (-output_range[1], -output_range[0])
        thesis = None if preset is None else thesis_preset(preset)
        self._noise_told: Final = noise == "told"
        if noise == "told" and (preset is not None or outcome == "success" or surrogate not in (None, *TELLABLE)):
            raise InputError(f"noise='told' needs one of the surrogates {', '.join(TELLABLE)}, and no preset.")
        model = chosen_surrogate(
            SuccessProcess() if outcome == "success" else surrogate,
            preset=preset,
            thesis=thesis,
            noise=None if noise == "told" else noise,
            output_range=output_range,
            box=box,
            input_noise=input_noise,
            seed=self.seed,
        )
        if input_noise is not None:
            input_noise.warn_if_larger_than(box)
        self._lattice = lattice_of(box, fixed)
        region = region_of(box, allowed, self._lattice, self.seed, first)
        self._strategy = strategy_named(
            criterion,
            Risk(risk) if isinstance(risk, str) else risk,
            box,
            input_noise,
            quadrature=quadrature,
            k=k,
            border=border,
            kappa=kappa,
            noisy=getattr(model, "noisy", False) or noise_while_exploring or self._noise_told,
            trust_region=TrustRegion(self.n_initial) if trust_region else None,
            thesis=thesis,
            allowed=None if region is None else region.contains,
            outcome=outcome,
        )
        takes_noise = isinstance(model, NoisySurrogate)
        if noise_while_exploring and (input_noise is None or thesis is not None or not takes_noise):
            raise InputError(
                "noise_while_exploring needs input_noise= and a surrogate that takes the noise of single trials "
                "('two_scales', 'gp', 'tgp', or an object with known_noise), without a thesis preset."
            )
        self._model = ResponseModel(
            model,
            box,
            straying=input_noise if noise_while_exploring else None,
            lattice=self._lattice,
            continues_chains=self._strategy.continues_chains,
            seed=self.seed,
            told=self._noise_told,
        )
        if conditions not in ("commanded", "measured"):
            raise unknown_name("conditions", conditions, ("commanded", "measured"))
        self._measured: Final = box.uncontrolled is not None and conditions == "measured"
        limits = limits_of(constraints)
        self._requirements = required(
            box,
            region,
            limits,
            level=feasible,
            safety=safety,
            ranking=self._strategy.ranking,
            straying=input_noise if noise_while_exploring else None,
            lattice=self._lattice,
            seed=self.seed,
            first=first,
            preset=preset,
            failures=failures,
        )
        rng = np.random.default_rng([self.seed, 0])
        rest = initial_design(design, max(self.n_initial - len(first), 1), box.dimension, rng)
        if self._requirements is not None:
            rest = self._requirements.initial(rest, first, rng)
        self._design = np.concatenate([first, rest])
        self._trials = Trials(box, limits, outcome == "success")
        compile_ahead(given)

    @staticmethod
    def default_n_initial(box: Box, variables: int | None = None) -> int:
        """Return the size of the initial design where none is given: 5 for each variable, at least 6, at most 20 + d/5.

        `variables` are those that can vary, where the box has others.
        """
        d = len(box.variables) if variables is None else variables
        return max(DESIGN_LEAST, min(DESIGN_PER_VARIABLE * d, DESIGN_MOST + d // DESIGN_VARIABLES_PER_MORE))

    # --- trials -------------------------------------------------------------------------------------------------

    @property
    def X(self) -> NDArray[np.float64]:
        """Inputs commanded so far, failed ones included, (t, d), in the box's units."""
        return self.box.from_unit(self._trials.commanded)

    @property
    def y(self) -> NDArray[np.float64]:
        """Values told so far, (t,); NaN for failed trials."""
        return self._sign * self._trials.values

    @property
    def pending(self) -> NDArray[np.float64]:
        """Inputs asked for and not told yet, (p, d), in the box's units."""
        return self.box.from_unit(self._trials.pending)

    @property
    def outputs(self) -> dict[str, NDArray[np.float64]]:
        """Further outputs told so far by name, (t,) each; NaN where one was not measured."""
        return {limit.name: self._trials.outputs[:, k] for k, limit in enumerate(self._trials.limits)}

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether each trial may become the answer, (t,): it gave a value and satisfies all that is required."""
        return self._trials.successful if self._requirements is None else self._requirements.feasible(self._trials)

    @property
    def reached(self) -> NDArray[np.float64]:
        """Inputs truly reached (t, d), in the box's units: the commanded ones where nothing else was told."""
        return self.box.from_unit(self._trials.reached)

    def tell(
        self,
        x: Any,
        y: float | None = None,
        *,
        failed: bool | Literal["rig"] = False,
        reached: Any = None,
        constraints: Mapping[str, float | None] | None = None,
        success: bool | None = None,
        successes: int | None = None,
        of: int | None = None,
        noise: float | None = None,
    ) -> None:
        """Record the outcome y of a trial at x, or that it gave nothing.

        Parameters
        ----------
        x
            Where: an `AskedTrial`, or the point (d,) in the box's units; a dictionary or a Series of pandas is read by
            its names. If it is pending it is so no more; a trial that was never asked for is welcome too. A point
            belongs to the nearest pending trial within 0.01 box widths in every variable, so that a rig may round it;
            the model learns from the point as it is told. One beyond a bound by no more than the rounding of single
            precision is on the bound (see `Box.rounding`).
        y
            One finite number.
        failed
            True: the place gave nothing. The trial counts for the model as the lowest value told so far, so that the
            place is avoided. "rig": the place is not at fault (a camera hung, a person came in the way). The trial
            leaves no trace, and its number is asked for again.
        reached
            Where the trial truly was, (d,), where that is known; inside of the box or not. The model learns from
            there; more than 1e6 box widths away counts as 1e6. `recommend` answers inputs inside the box only.
        constraints
            {name: value} of the further outputs: every one that has a limit, unless the trial failed; None for one that
            could not be measured.
        success, successes, of
            In place of y where `outcome` is "success": True or False, or so many successes of so many executions. A
            failed trial counts as one that did not succeed.
        noise
            Standard deviation of the observation noise in y, where the optimizer was made with `noise="told"`; of the
            mean of n readings, that of one by the root of n.

        Raises
        ------
        InputError
            If x or reached has the wrong shape, other names or is not finite, or x lies outside the box; if an
            `AskedTrial` has been told before; if y is missing, not finite or not a number; if a failed trial comes with
            a value; if an output is missing, unknown or not finite. Nothing told before is lost.
        """
        y, executions, failed = counted(self.outcome, y, success, successes, of, failed)
        y = None if y is None else self._sign * number_of(y)
        if self._measured:
            reached = self._with_conditions(x, reached)
        deviation = told_noise(noise, wanted=self._noise_told and not failed)
        self._trials.tell(x, y, failed, reached, constraints, executions, deviation)

    def _with_conditions(self, x: Any, reached: Any) -> Any:
        """Return the reached input, of which only the uncontrolled variables must be said."""
        held = self.box.uncontrolled
        names = [] if held is None else [n for n, h in zip(self.box.names, held.held, strict=True) if h]
        if reached is None or (isinstance(reached, Mapping) and not set(names) <= set(reached)):
            raise InputError(
                f"the trial says nothing about {', '.join(names)}, which nobody sets; tell "
                f"reached={{{', '.join(f'{name!r}: value' for name in names)}}}."
            )
        commanded = self.box.as_dict(x.x if isinstance(x, AskedTrial) else x)
        return {**commanded, **reached} if isinstance(reached, Mapping) else reached

    def forget(self, x: Any) -> None:
        """Drop a pending trial, an `AskedTrial` or its x (d,), that will never be told; its number is asked for again.

        Raises InputError if it is not pending.
        """
        self._trials.forget(x)

    def restore(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        reached: ArrayLike | None = None,
        pending: ArrayLike | None = None,
        numbers: ArrayLike | None = None,
        outputs: ArrayLike | None = None,
        of: ArrayLike | None = None,
        noise: ArrayLike | None = None,
    ) -> None:
        """Replace all trials by stored ones: X (t, d) with values y (t,), NaN for failed ones, and pending (p, d).

        `reached` (t, d) are the inputs that were truly reached, X where None. `numbers` (t + p,) are those of the
        trials, the pending ones last; 0, 1, 2, ... where None. `outputs` (t, o) are the further outputs in the order of
        `constraints`, NaN where not measured. `of` (t,) are the executions of which y is the share of successes, 1 each
        where None. `noise` (t,) are the standard deviations told. What is asked next is what an optimizer asks that was
        told these trials in this order.

        Raises
        ------
        InputError
            If shapes do not fit, an input is not finite, X or pending lie outside the box, or a value is infinite.
        """
        values = self._sign * np.asarray(y, dtype=np.float64)
        if self.outcome == "success":
            values = np.where(np.isnan(values), 0.0, values)  # a failed trial did not succeed
        trials = Trials(self.box, self._trials.limits, self.outcome == "success")
        trials.restore(
            X,
            values,
            X if reached is None else reached,
            () if pending is None else pending,
            numbers,
            outputs,
            of,
            noise,
        )
        if not trials.equal(self._trials):
            self._model.forget()
            if self._requirements is not None:
                self._requirements.forget()
        self._trials = trials

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write settings and trials, pending ones included, into a JSON file, for `load`.

        Raises InputError where it cannot be written.
        """
        saving.write(path, self.box, self._settings, self._trials)

    @classmethod
    def load(cls, path: str | os.PathLike[str], **settings: Any) -> "Optimizer":
        """Return the optimizer that `save` has written: it asks and recommends what that one would.

        Settings that are given replace stored ones; those that a file cannot hold must be: a surrogate that is an
        object, input noise that varies. (The chains of the thesis presets start anew.)

        Raises
        ------
        InputError
            If the file cannot be read or holds no optimizer, or such a setting is missing.

        Examples
        --------
        >>> import tempfile
        >>> from surehold import Box, Optimizer
        >>> optimizer = Optimizer(Box({"x": (0.0, 1.0)}), seed=3)
        >>> optimizer.tell(optimizer.ask(), 0.5)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     optimizer.save(f"{folder}/run.json")
        ...     again = Optimizer.load(f"{folder}/run.json")
        >>> bool(again.ask() == optimizer.ask())
        True
        """
        box, found, trials = saving.read(path, settings)
        optimizer = cls(box, **found)
        optimizer._trials = trials
        return optimizer

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
        return [self._ask_one(None if number is None else number + i) for i in range(_count("n", n, 1))]

    def _ask_one(self, number: int | None) -> AskedTrial:
        position = self._trials.next_number if number is None else _count("number", number, 0)
        if position < self.n_initial:
            u = self._design[self._unused_place(position) if number is None else position]
        elif not self._trials.successful.any():
            u = self._anywhere(self._rng(2, position))  # every trial failed or is pending: keep covering
        else:
            with single_threaded():
                u = self._propose(self._rng(2, position))
        u = self._snapped(u)
        if self.box.uncontrolled is not None and self._measured:
            u = self.box.uncontrolled.at_mean(u)
        x = self.box.from_unit(u)
        return AskedTrial(self._trials.ask(position, u), x, self.box.as_dict(x))

    def _unused_place(self, position: int) -> int:
        """Return the place in the design to ask for next: the position, or the first unused one after a `forget`."""
        design = self._snapped(self._design)
        trials = np.concatenate([self._trials.commanded, self._trials.pending])

        def unused(place: int) -> bool:  # on a lattice several places may be one point
            return int(same(design[place], trials).sum()) <= int(same(design[place], design[:place]).sum())

        return position if unused(position) else next(filter(unused, range(self.n_initial)), position)

    def _propose(self, rng: np.random.Generator) -> NDArray[np.float64]:
        history = self._history
        if len(history.tried):
            candidates = self._snapped(self._strategy.candidates(self.posterior, history, rng))
        else:
            candidates = self._snapped(self._nothing_feasible(rng))
        if history.admission is not None:
            candidates = candidates[history.admission.possible(candidates)]
        if self._ranking.noisy and len(candidates):
            return candidates[0]
        tried = np.concatenate([self._trials.commanded, self._trials.pending])
        for candidate in candidates:
            if np.count_nonzero(same(candidate, tried)) <= self._strategy.repeats:
                return candidate
        return self._anywhere(rng)  # every candidate has been tried already

    def _nothing_feasible(self, rng: np.random.Generator) -> NDArray[np.float64]:
        return (
            np.empty((0, self.box.dimension))
            if self._requirements is None
            else (self._requirements.most_probable(self._trials, rng))
        )

    def _anywhere(self, rng: np.random.Generator) -> NDArray[np.float64]:
        if self._requirements is not None:
            return self._requirements.otherwise(self._trials, rng)
        return rng.random(self.box.dimension)

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
        history, ranking = self._history, self._ranking
        with single_threaded():
            posterior = self.posterior
            if not len(history.tried) and self._requirements is not None:
                where, history = "observed", self._requirements.nearest(self._trials)
            if where == "observed":
                index = int(ranking.order(posterior, history.tried, history.observed)[0])
                u, observed = history.tried[index], float(history.observed[index])
            else:
                rng = self._rng(3, len(self._trials))
                strict = None if self._requirements is None else self._requirements.strict(self._trials)
                u, observed = self._snapped(ranking.best(posterior, history.tried, rng, strict)), np.nan
            if self.box.uncontrolled is not None:
                u = self.box.uncontrolled.at_mean(u)
            reached = Perturbations.of(
                self.input_noise,
                self.box,
                "quasi_monte_carlo",
                ranking.accurate.border,
                exponent=OUTCOME_EXPONENT,
                allowed=ranking.accurate.allowed,
            )
            highest = int(np.argmax(history.observed))
            answer = recommendation(
                posterior,
                reached,
                ranking.coarse,
                u,
                self.box,
                observed,
                (history.tried[highest], float(history.observed[highest])),
                int(self._trials.successful.sum()),
                self._sign,
                tuple(np.flatnonzero(self._trials.outliers).tolist()),
                self._model.execution_noise(self._trials),
                "" if (diagnosis := self.diagnosis()) is None else diagnosis.warning,
            )
            if self.outcome == "success":
                answer = described(answer, posterior, reached, u)
            if self._requirements is None:
                return answer
            return self._requirements.described(answer, self._trials, u, reached, self._sign)

    def predict(self, X: ArrayLike, *, under_noise: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the model's mean and standard deviation (q,) at X (q, d) in the box's units.

        With `under_noise`, of the outcome averaged over the input noise instead.
        """
        U = np.atleast_2d(self.box.to_unit(X))
        perturbations = self._ranking.accurate if under_noise else Perturbations(exact(self.box.dimension))
        with single_threaded():
            mean, variance = mixture(perturbations.outcome(self.posterior, U))
        return self._sign * mean, np.sqrt(variance)

    def diagnosis(self) -> Diagnosis | None:
        """Return how well the model predicts each trial from the others; None where it cannot tell.

        Raises InputError if no trial has given a value yet.
        """
        return self._model.diagnosis(self._trials)

    def promise(self) -> float:
        """Return the largest improvement that a further input is expected to bring, in the outputs' units.

        Of the outcome under the input noise, over the best input tried so far; small where there is little left to
        find, infinite where no trial may become the answer yet. Raises InputError if no trial has given a value yet.
        """
        with single_threaded():
            return promise(self._ranking, self.posterior, self._history, self._rng(4, len(self._trials)))

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
        if self._requirements is not None and self._requirements.failures and self._trials.successful.any():
            return self._model.posterior(self._trials.without_failed())
        return self._model.posterior(self._trials)

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
    def _ranking(self) -> Ranking:
        return self._strategy.ranking

    @property
    def _history(self) -> History:
        told = self._trials.eligible  # those that reached a place outside of the box are no answer, as failed ones
        admission = None
        if self._requirements is not None:
            told = self._requirements.feasible(self._trials)
            admission = self._requirements.admission(self._trials)
        return History(
            self._trials.places[told],
            self._trials.modelled[told],
            self._trials.reached[~told],
            self._trials.pending,
            admission,
        )

    def _snapped(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        return U if self._lattice is None else self._lattice.snap(U)

    def _rng(self, purpose: int, position: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, purpose, position])


def _count(name: str, value: int, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
    return int(value)

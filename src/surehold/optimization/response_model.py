"""What the optimizer believes of the response: its surrogate, conditioned on the trials told so far."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.diagnosis import Diagnosis, diagnosis
from surehold.optimization.lattice import Lattice, LatticePosterior
from surehold.optimization.low_tail import LowTail, low_tail_of
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.numerics.threads import computing
from surehold.optimization.strategy.thesis import ThesisConstants
from surehold.optimization.surrogates.gaussian_process.model import learnt_from
from surehold.optimization.surrogates.gaussian_process.observations import NoiseName
from surehold.optimization.surrogates.named import DEFAULT_SURROGATE, refuse_settings, surrogate_named
from surehold.optimization.surrogates.noisy_inputs import condition_on_noisy_inputs
from surehold.optimization.surrogates.protocol import NoisySurrogate, Posterior, Surrogate
from surehold.optimization.surrogates.success.beta_process import BetaProcess
from surehold.optimization.surrogates.success.model import SuccessProcess
from surehold.optimization.surrogates.success.preference import PreferenceProcess
from surehold.optimization.trials import Trials
from surehold.store import background

__all__ = ["ResponseModel", "chosen_surrogate", "expected_places"]

_SAME_PLACE: Final = 1e-7  # in the unit cube
_SAME_VALUE: Final = 1e-9  # of the values' range
_LOOKED_AT: Final = 64  # trials at which the spread of executions is averaged


def chosen_surrogate(
    surrogate: str | Surrogate | None,
    *,
    preset: str | None,
    thesis: ThesisConstants | None,
    noise: float | NoiseName | None,
    output_range: tuple[float, float] | None,
    box: Box,
    input_noise: InputNoise | None,
    seed: int,
) -> Surrogate:
    """Return the surrogate that a name, an object or a thesis preset stands for.

    None stands for "two_scales", and for the thesis' "gp" beside a preset.

    Raises InputError for an unknown name, and for settings beside an object or a preset, which have their own.
    """
    deviations = np.zeros(box.dimension)
    if input_noise is not None:
        deviations = np.sqrt(np.diag(input_noise.unit_covariance(box)))
    if surrogate is None:
        surrogate = DEFAULT_SURROGATE if thesis is None else "gp"
    if not isinstance(surrogate, str):
        refuse_settings("a surrogate object", noise, output_range)
        return surrogate
    if thesis is not None:
        refuse_settings(f"preset='{preset}'", noise, output_range)
        return thesis.surrogate(surrogate, deviations, seed)
    return surrogate_named(surrogate, noise=noise, output_range=output_range, input_deviations=deviations, seed=seed)


def expected_places(trials: Trials, straying: InputNoise | None, box: Box) -> NDArray[np.float64]:
    """Return where trials were (t, d): the reached input where it was told, else where noise of that mean carries it.

    `straying` is the input noise of the trials themselves; None if they reach what is commanded.
    """
    if straying is None or not (mean := straying.unit_mean(box)).any():
        return trials.reached
    if box.uncontrolled is not None:  # which are as they were told, or commanded
        mean = np.where(box.uncontrolled.held, 0.0, mean)
    return np.where(trials.reported[:, None], trials.reached, trials.reached + mean)


class ResponseModel:
    """A surrogate and its posterior, which is computed once for each set of trials.

    Parameters
    ----------
    surrogate, box, lattice, seed
        As of the optimizer.
    straying
        The input noise of the trials themselves; None if they reach what is commanded.
    continues_chains
        Whether a posterior goes on from the one before, so that it depends on all those before it.
    told
        Whether each trial tells the standard deviation of its observation noise.
    screened
        Whether failed trials and outliers count as the lowest other value; else all must have given a value.
    compressed
        Whether deep values are compressed in the search where the trials speak for it; see `low_tail`.
    """

    def __init__(
        self,
        surrogate: Surrogate,
        box: Box,
        *,
        straying: InputNoise | None,
        lattice: Lattice | None,
        continues_chains: bool,
        seed: int,
        told: bool = False,
        screened: bool = True,
        compressed: bool = False,
    ):
        self._surrogate: Final = surrogate
        self._box: Final = box
        self._straying: Final = straying
        self._lattice: Final = lattice
        self._continues_chains: Final = continues_chains
        self._seed: Final = seed
        self._told: Final = told
        self._screened: Final = screened
        self._compressed: Final = compressed
        self._low_tail: tuple[bytes, LowTail | None] | None = None  # and the values that it rests on
        self._cache: dict[bool, tuple[int, Posterior]] = {}  # by whether deep values are compressed

    def forget(self) -> None:
        """Drop what was learnt: the trials are others from now on."""
        self._low_tail = None
        self._cache.clear()

    def posterior(self, trials: Trials) -> Posterior:
        """Return the surrogate conditioned on the trials told so far; inputs in the unit cube.

        Raises InputError if no trial has given a value yet.
        """
        return self._posterior(trials, None)

    def posterior_of_search(self, trials: Trials) -> Posterior:
        """Return the posterior by which trials are chosen: the same, or of values whose low tail is compressed."""
        return self._posterior(trials, self._tail(trials))

    def values_of_search(self, trials: Trials) -> NDArray[np.float64]:
        """Return the values (t,) that `posterior_of_search` is learnt from; NaN if every trial failed."""
        tail = self._tail(trials)
        return trials.modelled if tail is None else tail.apply(trials.modelled)

    def _tail(self, trials: Trials) -> LowTail | None:
        told = trials.successful
        if not self._compressed or not told.any():
            return None
        values = trials.modelled[told]
        judging = values[: learnt_from(len(values))].tobytes()  # a further trial can make an outlier none
        if self._low_tail is None or self._low_tail[0] != judging:
            background.wait()
            with computing():
                self._low_tail = judging, low_tail_of(trials.reached[told], values)
        return self._low_tail[1]

    def _posterior(self, trials: Trials, tail: LowTail | None) -> Posterior:
        t, kind = len(trials), tail is not None
        if not trials.successful.any():
            raise InputError("no trial has given a value yet; tell the outcome of at least one.")
        if kind in self._cache and self._cache[kind][0] == t:
            return self._cache[kind][1]
        background.wait()
        with computing():
            posterior = self._conditioned(trials, tail)
        if self._lattice is not None:
            posterior = LatticePosterior(posterior, self._lattice)
        self._cache[kind] = (t, posterior)
        return posterior

    def _conditioned(self, trials: Trials, tail: LowTail | None) -> Posterior:
        model: Any = self._surrogate
        if isinstance(model, (SuccessProcess, BetaProcess)):
            rng = np.random.default_rng([self._seed, 1, 0])
            return model.condition(trials.reached, trials.values, rng, trials=trials.executions.astype(np.float64))
        if isinstance(model, PreferenceProcess):
            return model.condition(trials.reached, trials.pairs, np.random.default_rng([self._seed, 1, 0]))
        values = trials.modelled if self._screened else trials.values
        if tail is not None:
            values = tail.apply(values)
        if self._straying is not None and isinstance(self._surrogate, NoisySurrogate):
            told = trials.deviations if self._told else None
            places, roots = expected_places(trials, self._straying, self._box), self._roots(trials, self._straying)
            return condition_on_noisy_inputs(self._surrogate, places, values, roots, [self._seed, 1, 0], told)
        # One random stream for all, so that what some trials taught stays as it was when others follow.
        previous = self._cache[False][1] if self._continues_chains and self._cache else None
        rng = np.random.default_rng([self._seed, 1, len(trials) if self._continues_chains else 0])
        if self._told and isinstance(self._surrogate, NoisySurrogate):
            return self._surrogate.condition(trials.reached, values, rng, previous, trials.deviations)
        told = self._informative(trials)
        return self._surrogate.condition(trials.reached[told], values[told], rng, previous)

    def _roots(self, trials: Trials, straying: InputNoise) -> NDArray[np.float64]:
        """Return roots (t, d, d) of the covariances with which trials strayed; 0 where they told what they reached."""
        held = self._box.uncontrolled
        if held is None:
            roots = straying.unit_roots(self._box, trials.commanded).copy()
        else:  # which are as they were told, or commanded
            roots = straying.unit_roots(self._box, np.where(held.held, trials.reached, trials.commanded)).copy()
            roots[:, held.held] = 0.0
        roots[trials.reported] = 0.0
        return roots

    def _informative(self, trials: Trials) -> NDArray[np.bool_]:
        """Tell which trials (t,) the surrogate is told: of exact ones of the same place and value, the first.

        The others tell nothing, but to learn hyperparameters from them would make the model surer with each: its
        signal variance is what the values need divided by how many there are.
        """
        values = trials.modelled if self._screened else trials.values
        noisy = self._told or self._straying is not None or getattr(self._surrogate, "noisy", False)
        if noisy or self._continues_chains:  # the thesis' models take every trial as it comes
            return np.ones(len(values), dtype=bool)
        unit = _SAME_VALUE * (float(np.ptp(values)) or 1.0)
        rows = np.column_stack([trials.reached / _SAME_PLACE, (values - values.min()) / unit])
        _, first = np.unique(np.round(rows), axis=0, return_index=True)
        told = np.zeros(len(values), dtype=bool)
        told[first] = True
        return told

    def diagnosis(self, trials: Trials) -> Diagnosis | None:
        """Return how well the model explains the trials told so far; None where it cannot tell."""
        posterior = self.posterior(trials)
        if isinstance(posterior, LatticePosterior):
            posterior = posterior.unrounded
        told = self._informative(trials)
        return diagnosis(posterior, trials.reached[told], trials.modelled[told])

    def execution_noise(self, trials: Trials, executions: Perturbations) -> float | None:
        """Return the variance of the observation noise of one execution; None is what the surrogate says.

        What the surrogate learns from trials that strayed contains the input noise, which executions have anyway: where
        noise is learnt, what is left of it when the spread that `executions` have at the trials is taken off. Where
        each trial tells its own, the mean of theirs.
        """
        if self._told:
            return float(np.mean(trials.deviations[trials.successful] ** 2))
        if self._straying is None:
            return None
        known = getattr(self._surrogate, "known_noise", None)
        if known is not None:
            return known**2
        strayed = trials.successful & ~trials.reported
        if not strayed.any():
            return None
        rows = np.flatnonzero(strayed)
        places = trials.reached[rows[np.linspace(0, len(rows) - 1, min(len(rows), _LOOKED_AT)).astype(np.intp)]]
        posterior, weights = self.posterior(trials), executions.quadrature.weights
        points = executions.around(places)
        means = posterior.moments(points.reshape(-1, points.shape[2])).mean.mean(axis=0).reshape(points.shape[:2])
        spread = (means - (means @ weights)[:, None]) ** 2 @ weights
        learnt = float(posterior.noise_variance(places).mean())
        return max(learnt - float(spread.mean()) * len(rows) / int(trials.successful.sum()), 0.0)

"""Where the next trial is made: of the initial design, then by the strategy, and where neither has a place left."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import ROUNDED, SEPARATION
from surehold.optimization.assembly import Parts
from surehold.optimization.box import Box
from surehold.optimization.numerics.threads import computing
from surehold.optimization.requirements import Requirements
from surehold.optimization.strategy.ranking import History
from surehold.optimization.surrogates.protocol import Posterior
from surehold.optimization.trials import Trials, same

__all__ = ["Asking", "history_of"]


def history_of(trials: Trials, requirements: Requirements | None, values: NDArray[np.float64]) -> History:
    """Return what a strategy knows of the trials, whose values (t,) count as given."""
    told = trials.eligible  # those that reached a place outside of the box are no answer, as failed ones
    admission = None
    if requirements is not None:
        told = requirements.feasible(trials)
        admission = requirements.admission(trials)
    return History(trials.places[told], values[told], trials.reached[~told], trials.pending, admission)


class Asking:
    """Chooses the places of trials; which one depends on the trials, the settings and the position alone.

    `conditions_measured`: whether variables that nobody sets stay at their mean in every trial asked for.
    """

    def __init__(self, box: Box, parts: Parts, conditions_measured: bool):
        self._box: Final = box
        self._parts: Final = parts
        self._measured: Final = conditions_measured

    def place(
        self, trials: Trials, position: int, numbered: bool, posterior: Callable[[], Posterior]
    ) -> NDArray[np.float64]:
        """Return the place (d,) in the cube of the trial at this position in the design and the random sequence.

        Places of the design at which trials were told are left out. A `numbered` position also leaves one to each
        trial of a lower number that was not told: others may have asked for it. `posterior` is called where it is
        needed.
        """
        parts = self._parts
        rng = np.random.default_rng([parts.seed, 2, position])
        if position < parts.n_initial:
            u = parts.design[self._place_in_design(trials, position, numbered)]
        elif not trials.successful.any():
            u = self._anywhere(trials, rng)  # every trial failed or is pending: keep covering
        else:
            with computing():
                u = self._proposed(trials, posterior, rng)
        u = self._snapped(u)
        return self._box.uncontrolled.at_mean(u) if self._measured and self._box.uncontrolled is not None else u

    def _place_in_design(self, trials: Trials, position: int, numbered: bool) -> int:
        """Return which place of the design is asked for, see `place`; the position where none is left."""
        made = trials.commanded if numbered else np.concatenate([trials.commanded, trials.pending])
        design = self._controlled(self._snapped(self._parts.design[: self._parts.n_initial]))
        left = list(range(len(design)))
        for u in self._controlled(made):  # which may have been rounded; most are in the order of the design
            at = next((k for k, place in enumerate(left) if np.abs(design[place] - u).max() <= ROUNDED), None)
            if at is not None:
                del left[at]
        elsewhere = position - int(np.sum(trials.numbers < position)) if numbered else 0
        return left[elsewhere] if elsewhere < len(left) else position

    def _controlled(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (k, d) of the cube that differ in what is commanded alone."""
        return U if self._box.uncontrolled is None else self._box.uncontrolled.at_mean(U)

    def _proposed(
        self, trials: Trials, posterior: Callable[[], Posterior], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        strategy, requirements = self._parts.strategy, self._parts.requirements
        history = history_of(trials, requirements, self._parts.model.values_of_search(trials))
        if len(history.tried):
            candidates = strategy.candidates(posterior(), history, rng)
        elif requirements is not None:
            candidates = requirements.most_probable(trials, rng)
        else:
            candidates = np.empty((0, self._box.dimension))
        candidates = self._snapped(candidates)
        if history.admission is not None:
            candidates = candidates[history.admission.possible(candidates)]
        gaps = np.abs(candidates[:, None] - trials.pending).max(axis=2)
        apart = candidates[np.all(gaps >= SEPARATION, axis=1)]
        if strategy.ranking.noisy and len(candidates):
            return (apart if len(apart) else candidates)[0]
        for candidate in apart:
            if np.count_nonzero(same(candidate, trials.commanded)) <= strategy.repeats:
                return candidate
        return self._anywhere(trials, rng)  # every candidate has been tried already

    def _anywhere(self, trials: Trials, rng: np.random.Generator) -> NDArray[np.float64]:
        requirements, lattice = self._parts.requirements, self._parts.lattice
        if lattice is not None and not lattice.smooth.any() and (requirements is None or requirements.safety is None):
            tried = np.concatenate([trials.commanded, trials.pending])
            region = None if requirements is None else requirements.region
            found = lattice.untried(tried, rng, None if region is None else region.contains)
            if found is not None:
                return found
        if requirements is not None:
            return requirements.otherwise(trials, rng)
        return rng.random(self._box.dimension)

    def _snapped(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        return U if self._parts.lattice is None else self._parts.lattice.snap(U)

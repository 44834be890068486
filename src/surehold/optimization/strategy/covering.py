"""Insurance against a wrong model: where the search is stalled, some trials go where nothing has been tried."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import COVERING_PATIENCE, COVERING_PERIOD
from surehold.optimization.maximizer.holes import largest_holes
from surehold.optimization.strategy.protocol import Strategy
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["Covering"]


@dataclass(frozen=True)
class Covering:
    """Another strategy, except that every third trial fills the largest hole while the search is stalled.

    It is stalled where none of the last three trials is the best one: a model that is too smooth can be sure that
    nothing is left to find. Trials that polish (`defaults.POLISH_PERIOD`) are due on the same numbers, so that there is
    none of them while the search is stalled.
    """

    strategy: Strategy
    exactly: bool
    """whether the best trial is the best one without input noise"""

    repeats: ClassVar[int] = 0
    continues_chains: ClassVar[bool] = False

    @property
    def ranking(self) -> Ranking:
        """That of the strategy."""
        return self.strategy.ranking

    def candidates(self, posterior: Posterior, history: History, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points of the cube (c, d) for the next trial, best first."""
        if self._stalled(posterior, history):
            points = np.concatenate([history.tried, history.failed, history.pending])
            return largest_holes(points, rng, history.admission)
        return self.strategy.candidates(posterior, history, rng)

    def _stalled(self, posterior: Posterior, history: History) -> bool:
        n = len(history.tried)
        if n <= COVERING_PATIENCE or history.told % COVERING_PERIOD != 0:
            return False
        return int(self.ranking.trials(posterior, history, self.exactly)[0]) < n - COVERING_PATIENCE

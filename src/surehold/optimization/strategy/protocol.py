"""What the optimizer asks of a strategy: candidates for the next trial."""

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["Strategy"]


class Strategy(Protocol):
    """A way to choose the next trial."""

    repeats: ClassVar[int]
    """how often a trial may be repeated where observations are exact"""
    continues_chains: ClassVar[bool]
    """whether the surrogate's chains of hyperparameters continue from one trial to the next"""

    @property
    def ranking(self) -> Ranking:
        """Which inputs count as the best ones."""
        ...

    def candidates(self, posterior: Posterior, history: History, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points of the cube (c, d) for the next trial, best first; `posterior` is conditioned on the history.

        Of trials under way the posterior knows nothing yet.
        """
        ...

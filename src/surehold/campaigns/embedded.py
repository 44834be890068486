"""Random embeddings as methods of a campaign; the initial design is one of their own, in the subspace."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.embedding import NestedEmbedding, RandomEmbedding
from surehold.optimization.box import Box

__all__ = ["EMBEDDED", "Embedded"]

_BINS: Final = 4
_DIMENSION: Final = 6  # of a random embedding, which has to be guessed: that of Hartmann-6
_EMBEDDINGS: Final = 4
_STAGED: Final = 100  # trials that the nested embedding plans for, as the shipped plan has


class Embedded:
    """A search in a subspace of the unit cube."""

    def __init__(self, search: RandomEmbedding | NestedEmbedding):
        self._search = search

    def ask(self) -> NDArray[np.float64]:
        """Return the next trial."""
        return self._search.ask()

    def tell(self, u: NDArray[np.float64], y: float) -> None:
        """Record a trial."""
        if np.isfinite(y):
            self._search.tell(u, y)
        else:
            self._search.tell(u, failed=True)

    def answer(self) -> NDArray[np.float64]:
        """Return the highest observed."""
        return self._search.best()[0]


def _random(d: int, initial: NDArray[np.float64], seed: int, embeddings: int) -> Embedded:
    share = max(1, len(initial) // embeddings)
    inner = min(_DIMENSION, d)
    return Embedded(RandomEmbedding(Box.unit(d), inner, embeddings=embeddings, seed=seed, n_initial=share))


def _nested(d: int, initial: NDArray[np.float64], seed: int) -> Embedded:
    return Embedded(NestedEmbedding(Box.unit(d), _STAGED, min(_BINS, d), seed=seed, n_initial=min(10, len(initial))))


#: Maker of each by the name that a plan gives it.
EMBEDDED: Final[dict[str, Callable[..., Any]]] = {
    "random-embedding": lambda d, initial, seed: _random(d, initial, seed, 1),
    "random-embeddings": lambda d, initial, seed: _random(d, initial, seed, _EMBEDDINGS),
    "nested-embedding": _nested,
}

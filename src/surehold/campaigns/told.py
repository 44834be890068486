"""What the methods of other libraries have in common: the initial design, and what was told."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Told"]

Array = NDArray[np.float64]


class Told:
    """The initial design, and what was told."""

    def __init__(self, initial: Array):
        self.waiting = list(initial)
        self.X: list[Array] = []
        self.y: list[float] = []

    def add(self, u: Array, y: float) -> None:
        """Record a trial."""
        self.X.append(np.asarray(u, dtype=np.float64))
        self.y.append(y)

    def best(self) -> Array:
        """Return the highest observed."""
        return self.X[int(np.argmax(self.y))]

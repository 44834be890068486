"""What every kind of input noise answers; `gaussian`, `uniform`, `varying` and `samples` hold the kinds.

Legend: d variables, box units as in `Box`; S covariance of the noise in the unit cube, (d, d).
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.box import Box
from surehold.optimization.noise.quadratures import Quadrature

__all__ = ["Kind", "Root", "root_of"]

Root = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Kind(Protocol):
    """One kind of input noise; a frozen dataclass. A new kind also gets a constructor in `InputNoise`."""

    @property
    def gaussian(self) -> bool:
        """Whether the noise is N(0, S) with the same S everywhere, which closed forms need."""
        ...

    @property
    def bounded(self) -> bool:
        """Whether the noise is uniform within half-widths."""
        ...

    @property
    def varies(self) -> bool:
        """Whether the noise depends on the input."""
        ...

    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """Return S (d, d) at x (d,) in the box's units; noise that varies takes the middle of the box for None."""
        ...

    def unit_mean(self, box: Box) -> NDArray[np.float64]:
        """Return the mean of the noise (d,) in the unit cube."""
        ...

    def draws(self, box: Box, u: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n draws (n, d) of the noise at u (d,) of the unit cube, or one at each of n, in widths of the cube."""
        ...

    def quadrature(self, box: Box, rule: str, k: float, exponent: int) -> tuple[Quadrature, Root | None]:
        """Return a quadrature by its rule.

        For noise that varies it is one of standard normal variables, and the second value is the function of points
        (q, d) of the unit cube that returns the roots (q, d, d) that scale them; None otherwise.
        """
        ...


def root_of(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return L (d, d) with L L' = covariance; variables without noise have zero rows."""
    shaken = np.flatnonzero(np.diag(covariance) > 0.0)
    root = np.zeros_like(covariance)
    root[np.ix_(shaken, shaken)] = np.linalg.cholesky(covariance[np.ix_(shaken, shaken)])
    return root

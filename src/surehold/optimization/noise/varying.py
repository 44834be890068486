"""Gaussian input noise that differs from place to place."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.gaussian import Correlated, Independent, checked_covariance, checked_deviations
from surehold.optimization.noise.kinds import Root, root_of
from surehold.optimization.noise.quadratures import Quadrature, quadrature

__all__ = ["Varying"]


@dataclass(frozen=True, repr=False)
class Varying:
    """Noise by a function of the input."""

    function: Callable[[NDArray[np.float64]], Any]
    """x (d,) -> standard deviations by name or (d,), or a covariance (d, d), in the box's units; zeros for no noise"""
    gaussian, bounded, varies = False, False, True

    def unit_covariance(self, box: Box, x: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the covariance (d, d) at x (d,) in the box's units, in the middle of the box for None."""
        place = box.from_unit(np.full(box.dimension, 0.5)) if x is None else x
        return self._at(place, box).unit_covariance(box)

    def unit_mean(self, box: Box) -> NDArray[np.float64]:
        """Return the mean (d,), which is 0."""
        return np.zeros(box.dimension)

    def draws(self, box: Box, u: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return n draws (n, d) at u (d,) of the unit cube, or one at each of n points (n, d)."""
        standard = rng.standard_normal((n, box.dimension))
        return np.matmul(self._roots(box, np.atleast_2d(u)), standard[:, :, None])[:, :, 0]

    def quadrature(self, box: Box, rule: str, k: float, exponent: int) -> tuple[Quadrature, Root | None]:
        """Return the quadrature of standard normal variables and the function that returns their roots.

        All variables get points: one that is exact at any number of places may be noisy between them.
        """
        return quadrature(rule, np.eye(box.dimension), k, exponent=exponent), partial(self._roots, box)

    def _roots(self, box: Box, U: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([root_of(self.unit_covariance(box, x)) for x in box.from_unit(np.clip(U, 0.0, 1.0))])

    def _at(self, x: NDArray[np.float64], box: Box) -> Independent | Correlated:
        """Return the noise that the user's function states at x (d,), checked."""
        try:
            stated = self.function(x)
        except Exception as error:
            raise InputError(
                f"the input-noise function raised {type(error).__name__} at {box.as_dict(x)}: {error}. Mend it; it is "
                "asked everywhere in the box."
            ) from error
        try:
            if isinstance(stated, Mapping):
                return Independent(checked_deviations(stated))
            array = np.asarray(stated, dtype=np.float64)
            if array.shape == (box.dimension,):
                return Independent(checked_deviations(dict(zip(box.names, array.tolist(), strict=True))))
            if array.shape == (box.dimension, box.dimension):
                return Correlated(checked_covariance(array))
        except (TypeError, ValueError) as error:  # InputError is a ValueError
            raise InputError(f"the input-noise function returned nonsense at {box.as_dict(x)}: {error}") from None
        raise InputError(
            f"the input-noise function returned an array of shape {array.shape} at {box.as_dict(x)}; it must return "
            f"{{name: standard deviation}}, ({box.dimension},) or ({box.dimension}, {box.dimension})."
        )

    def __repr__(self) -> str:
        return f"InputNoise.varying({getattr(self.function, '__name__', self.function)!r})"

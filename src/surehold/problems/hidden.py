"""A function of few variables hidden among many that change nothing."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise, needed_input_noise
from surehold.problems.problem import Optimum, checked_points

__all__ = ["Hidden"]


class Hidden:
    """A function of the unit cube whose variables are spread evenly over d, the first and the last among them.

    Parameters
    ----------
    name
        Short name.
    few
        The function of the variables that count: a problem on a unit cube with `optimum`, and with `expectation` and
        `standard_deviation` where these are asked for.
    d
        Number of variables, at least as many as `few` has.
    """

    border: Final = "extend"

    def __init__(self, name: str, few: Any, d: int):
        self.name: Final = name
        self.box: Final = Box.unit(d)
        self._few = few
        self.places: Final[NDArray[np.int64]] = np.linspace(0, d - 1, few.box.dimension).round().astype(np.int64)
        """which variables count"""

    @property
    def optimum(self) -> Optimum:
        """The highest value and where it is, the variables that do not count at .5."""
        return self.among(self._few.optimum)

    def among(self, best: Optimum) -> Optimum:
        """Return a best place of the few variables as one of all."""
        x = np.full(self.box.dimension, 0.5)
        x[self.places] = best.x
        return Optimum(x, best.value)

    def __call__(self, x: ArrayLike) -> float | NDArray[np.float64]:
        """Return the value at x (d,) as a float, or the values at x (n, d) as an array (n,)."""
        points, single = checked_points(x, self.box)
        values = self._few(points[:, self.places])
        return float(values[0]) if single else values

    def expectation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return E f(x + xi), xi ~ `noise`, at x (d,) or (n, d)."""
        points, single = checked_points(x, self.box)
        values = self._few.expectation(points[:, self.places], self._noise_of_few(noise))
        return float(values[0]) if single else values

    def standard_deviation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return the standard deviation of f(x + xi), xi ~ `noise`, at x (d,) or (n, d)."""
        points, single = checked_points(x, self.box)
        values = self._few.standard_deviation(points[:, self.places], self._noise_of_few(noise))
        return float(values[0]) if single else values

    def _noise_of_few(self, noise: InputNoise) -> InputNoise:
        noise = needed_input_noise(noise, self.box.names)
        if not noise.kind.gaussian or noise.varies:
            raise InputError(f"{noise!r} has no closed form here; give Gaussian noise that is the same everywhere.")
        return InputNoise(covariance=noise.unit_covariance(self.box)[np.ix_(self.places, self.places)])

    def __repr__(self) -> str:
        return f"<{self.name} on {self.box!r}>"

"""Outputs on a common scale: what the surrogate learns from is (y - shift) / scale."""

from math import log2
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError

__all__ = ["Standardization"]

_FLAT: Final = 64.0  # units in the last place of the largest |y|: a smaller range is rounding, not information
_SMALLEST: Final = 1e-150  # a spread below this, squared, is 0 in double precision
_LARGEST: Final = 1e150  # and the square of one above this is infinite


class Standardization(NamedTuple):
    """Affine map of the outputs."""

    shift: float
    """subtracted, in the outputs' units"""
    scale: float
    """divided by, positive, in the outputs' units"""
    flat: bool
    """whether the outputs do not differ, so that their scale is unknown"""

    @classmethod
    def identity(cls, y: NDArray[np.float64]) -> "Standardization":
        """Return the map that leaves outputs y (n,) as they are."""
        return cls(0.0, 1.0, _is_flat(y))

    @classmethod
    def of(cls, y: NDArray[np.float64], output_range: tuple[float, float] | None = None) -> "Standardization":
        """Return the map to zero mean and unit standard deviation of y (n,).

        Outputs that do not differ, or by less than 1e-150 or than 64 units in the last place of the largest, which is
        rounding, say nothing about the scale, and `flat` says so. It is their size then, in whatever unit they are:
        values that are all 0.3 may be 0.1 or 0.5 elsewhere. Where they are 0, or only one is there, it is 1. A stated
        `output_range` (lowest and highest value to expect) sets the scale instead: the range counts as four standard
        deviations, or the data's own spread where that is larger.
        """
        flat = _is_flat(y)
        top = float(np.abs(y).max()) if len(y) else 0.0
        unit = y / top if top > _SMALLEST else y  # sums and squares of outputs near the largest float overflow
        factor = top if top > _SMALLEST else 1.0
        shift = factor * float(unit.mean()) if len(y) else 0.0
        spread = 0.0 if flat else factor * float(unit.std())
        if output_range is not None:
            return cls(shift, max((output_range[1] - output_range[0]) / 4.0, spread), flat)
        return cls(shift, spread if spread > 0.0 else factor if len(y) > 1 else 1.0, flat)

    def coarse(self) -> "Standardization":
        """Return the map with its scale rounded to a power of sqrt(2): one more output seldom changes it."""
        return self if self.scale == 1.0 else self._replace(scale=float(2.0 ** (0.5 * round(2.0 * log2(self.scale)))))

    @property
    def square(self) -> float:
        """Squared scale, by which variances are multiplied; beyond 1e150 the scale counts as 1e150."""
        return min(self.scale, _LARGEST) ** 2

    def apply(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return standardized outputs."""
        return (y - self.shift) / self.scale


def checked_range(output_range: tuple[float, float] | None) -> tuple[float, float] | None:
    """Return a stated output range, or raise InputError if it is not two finite numbers, the lower one first."""
    if output_range is None:
        return None
    try:
        lower, upper = (float(value) for value in output_range)
    except (TypeError, ValueError):
        raise InputError(f"output_range is {output_range!r}; give (lowest, highest) value to expect.") from None
    if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper):
        raise InputError(f"output_range is ({lower}, {upper}); give two finite numbers, the lower one first.")
    return lower, upper


def _is_flat(y: NDArray[np.float64]) -> bool:
    if len(y) < 2:
        return True
    top = float(np.abs(y).max())
    half = 0.5 * float(y.max()) - 0.5 * float(y.min())  # the whole range of the largest floats overflows
    return half <= 0.5 * max(_FLAT * float(np.spacing(top)), _SMALLEST)

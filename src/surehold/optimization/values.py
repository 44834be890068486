"""Values of trials as they are told: checked, outliers among them, and the shares that stand for comparisons."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.defaults import OUTLIER_DISTANCE
from surehold.errors import InputError
from surehold.optimization.points import numbers_of

__all__ = ["LARGEST", "LARGEST_SQUARED", "checked_pairs", "number_of", "outliers_among", "shares_won", "told_noise"]

LARGEST: Final = 1e300  #: magnitude of a value; differences and sums of larger ones overflow
LARGEST_SQUARED: Final = 1e150  #: magnitude of a number of which squares are taken


def number_of(y: Any) -> float:
    """Return the value of a trial as a float; raises InputError where it is not one finite number."""
    if y is None:
        raise InputError("the trial has no value; give y, or failed=True for a trial that gave nothing.")
    try:
        value = numbers_of(y)
    except (TypeError, ValueError, OverflowError):
        shown = " ".join(repr(y).split())
        shown = shown if len(shown) <= 80 else f"{shown[:77]}..."
        raise InputError(f"y is {shown}; give one finite number, or failed=True.") from None
    if value.size != 1 or not np.isfinite(value).all():
        raise InputError(f"y is {y!r}; give one finite number, or failed=True for a trial that gave nothing.")
    number = float(value.reshape(()))
    if abs(number) > LARGEST:
        raise InputError(f"y is {number:g}, of which no model can be made; give it in another unit, or failed=True.")
    return number


def told_noise(noise: Any, wanted: bool) -> float:
    """Return the standard deviation told with a value, 0 where none is wanted; raises InputError where it is bad."""
    if not wanted:
        if noise is not None:
            raise InputError("noise= goes with a value, and with an optimizer that was made with noise='told'.")
        return 0.0
    try:
        value = float(numbers_of(noise).reshape(())) if noise is not None else np.nan
    except (TypeError, ValueError, OverflowError):
        value = np.nan
    if not 0.0 <= value <= LARGEST_SQUARED:
        raise InputError(f"noise is {noise!r}; tell the standard deviation of y, from 0 to {LARGEST_SQUARED:g}.")
    return value


def outliers_among(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which values (t,) lie so far below the others that they are no measurements of the response, (t,).

    Such as a reading of -30 among values from 0 to 1, or a penalty of -1000 for a crash: it, and all that is lower,
    lies below the others by more than `OUTLIER_DISTANCE` times their whole range. A third of the values or more are no
    outliers, and where the others are all equal nothing can be said.
    """
    told = np.sort(values[np.isfinite(values)])
    n = len(told)
    unit = told / max(float(np.abs(told).max()), 1e-300) if n else told  # differences of the largest overflow
    gap, above = np.diff(unit), (unit[-1:] - unit)[1:]
    apart = np.flatnonzero((gap > OUTLIER_DISTANCE * above) & (above > 0.0) & (3 * np.arange(1, n) < n))
    return values < told[apart[-1] + 1] if len(apart) else np.zeros(len(values), dtype=bool)


def shares_won(pairs: NDArray[np.intp], n: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the share of its comparisons that each of n inputs won, NaN without any, and their number, at least 1.

    `pairs` (p, 2) are those compared, the better one first.
    """
    won, made = np.bincount(pairs[:, 0], minlength=n), np.bincount(pairs.ravel(), minlength=n)
    return np.where(made > 0, won / np.maximum(made, 1), np.nan), np.maximum(made, 1)


def checked_pairs(pairs: ArrayLike, n: int) -> NDArray[np.intp]:
    """Return pairs (p, 2) of n rows that were compared; raises InputError where one is none."""
    rows = np.asarray(pairs, dtype=np.float64).reshape(-1, 2)
    if not np.all(np.isin(rows, np.arange(n))) or np.any(rows[:, 0] == rows[:, 1]):
        raise InputError(f"preferences are {pairs!r}; give pairs of different rows of X, the better one first.")
    return rows.astype(np.intp)

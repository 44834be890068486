"""Values of trials as they are told."""

from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.optimization.points import numbers_of

__all__ = ["LARGEST", "LARGEST_SQUARED", "number_of", "told_noise"]

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

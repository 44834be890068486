"""Values of trials as they are told."""

from typing import Any

import numpy as np

from surehold.errors import InputError
from surehold.optimization.points import numbers_of

__all__ = ["number_of", "told_noise"]


def number_of(y: Any) -> float:
    """Return the value of a trial as a float; raises InputError where it is not one finite number."""
    if y is None:
        raise InputError("the trial has no value; give y, or failed=True for a trial that gave nothing.")
    try:
        value = numbers_of(y)
    except (TypeError, ValueError, OverflowError):
        shown = " ".join(repr(y).split())
        raise InputError(f"y is {shown}; give one finite number, or failed=True.") from None
    if value.size != 1 or not np.isfinite(value).all():
        raise InputError(f"y is {y!r}; give one finite number, or failed=True for a trial that gave nothing.")
    return float(value.reshape(()))


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
    if not (np.isfinite(value) and value >= 0.0):
        raise InputError(f"noise is {noise!r}; tell the standard deviation of y, a finite number of 0 or more.")
    return value

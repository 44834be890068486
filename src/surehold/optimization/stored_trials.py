"""Columns of stored trials, checked before any of them is taken over."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.optimization.points import column_of
from surehold.optimization.values import LARGEST, LARGEST_SQUARED, checked_pairs

__all__ = ["Columns", "checked_columns"]


class Columns(NamedTuple):
    """t trials that were told, and p that are pending; inputs are points whose unit cube is the box."""

    commanded: NDArray[np.float64]
    """(t, d)"""
    values: NDArray[np.float64]
    """(t,); NaN for failed trials"""
    reached: NDArray[np.float64]
    """(t, d)"""
    pending: NDArray[np.float64]
    """(p, d)"""
    numbers: NDArray[np.intp]
    """(t + p,), those pending last"""
    outputs: NDArray[np.float64]
    """(t, o); NaN where one was not measured"""
    executions: NDArray[np.intp]
    """(t,)"""
    deviations: NDArray[np.float64]
    """(t,)"""
    pairs: NDArray[np.intp]
    """(k, 2) rows of trials that were compared, the preferred one first"""


def checked_columns(
    d: int,
    limits: int,
    counted: bool,
    *,
    commanded: ArrayLike,
    y: ArrayLike,
    reached: ArrayLike,
    pending: ArrayLike,
    numbers: ArrayLike | None,
    outputs: ArrayLike | None,
    executions: ArrayLike | None,
    deviations: ArrayLike | None,
    pairs: ArrayLike,
) -> Columns:
    """Return the columns with what was left out: d variables, `limits` further outputs, `counted` shares of successes.

    Raises InputError where they do not fit together, or hold what no trial can have told.
    """
    inputs, actual, waiting = (
        np.asarray(points, dtype=np.float64).reshape(-1, d) for points in (commanded, reached, pending)
    )
    compared = checked_pairs(pairs, len(inputs))
    values = np.zeros(len(inputs)) if len(compared) else np.asarray(y, dtype=np.float64)
    if values.shape != (len(inputs),) or len(actual) != len(inputs):
        raise InputError(
            f"y has shape {values.shape} and reached {len(actual)} rows, but X has {len(inputs)} rows; give one "
            "value and one reached input a trial."
        )
    if (huge := np.abs(values) > LARGEST).any():
        row = int(np.argmax(huge))
        raise InputError(
            f"y holds {values[row]:g} at row {row}; give numbers up to {LARGEST:g}, or NaN for failed trials."
        )
    measured = np.full((len(inputs), limits), np.nan) if outputs is None else column_of("outputs", outputs)
    if measured.shape != (len(inputs), limits) or (np.abs(measured) > LARGEST_SQUARED).any():
        raise InputError(
            f"outputs have shape {measured.shape}; give one number up to {LARGEST_SQUARED:g}, or NaN, for each of "
            f"{len(inputs)} trials and {limits} constraints."
        )
    of = np.ones(len(inputs), dtype=np.intp) if executions is None else np.asarray(executions)
    if of.shape != values.shape or (len(of) and (of.dtype.kind not in "iu" or np.any(of < 1))):
        raise InputError(f"of is {executions!r}; give a whole number of executions, 1 or more, for each trial.")
    whole = np.abs(of * values - np.round(of * values)) < 1e-6
    if counted and not np.all((values >= 0.0) & (values <= 1.0) & whole):
        raise InputError("y holds a number that is no share of successes; give successes divided by executions.")
    spread = np.zeros(len(inputs)) if deviations is None else column_of("noise", deviations)
    if spread.shape != values.shape or not np.all((spread >= 0.0) & (spread <= LARGEST_SQUARED)):
        raise InputError(f"noise holds no standard deviation, 0 to {LARGEST_SQUARED:g}, for some trial.")
    total = len(inputs) + len(waiting)
    given = np.arange(total) if numbers is None or total == 0 else np.asarray(numbers)
    whole = given.shape == (total,) and given.dtype.kind in "iu" and np.all(given >= 0)
    if not whole or len(np.unique(given)) < total:
        raise InputError(f"numbers are {numbers!r}; give {total} different whole numbers, those pending last.")
    return Columns(inputs, values, actual, waiting, given, measured, of, spread, compared)

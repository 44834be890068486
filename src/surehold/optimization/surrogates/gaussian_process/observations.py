"""What a user tells a Gaussian process of observations: data and noise, checked."""

from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.points import numbers_of
from surehold.optimization.values import LARGEST

__all__ = ["NOISES", "NoiseName", "checked_data", "checked_noise", "checked_noise_setting"]

NoiseName = Literal["none", "inferred", "heteroscedastic"]
NOISES: Final = get_args(NoiseName)


def checked_data(
    X: ArrayLike, y: ArrayLike | None, d: int | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return X (n, d) and y (n,) as float64 arrays (y empty where None); raises InputError where they do not fit."""
    try:
        inputs = np.ascontiguousarray(numbers_of(X))
        outputs = np.ascontiguousarray(numbers_of([] if y is None else y))
    except (TypeError, ValueError, OverflowError):
        raise InputError("X and y must be numeric arrays of shapes (n, d) and (n,).") from None
    if inputs.ndim != 2 or inputs.shape[1] == 0 or (d is not None and inputs.shape[1] != d):
        wanted = "(n, d)" if d is None else f"(q, {d})"
        raise InputError(f"X has shape {inputs.shape}; it must be {wanted}: one row a point.")
    if y is not None and outputs.shape != (len(inputs),):
        raise InputError(f"y has shape {outputs.shape}, but X has {len(inputs)} rows; give one output a row.")
    if y is not None and len(inputs) == 0:
        raise InputError("X has no rows; give at least one observation.")
    for name, values in (("X", inputs), ("y", outputs)):
        if not np.all(np.abs(values) <= LARGEST):
            raise InputError(f"{name} holds NaN or numbers beyond {LARGEST:g}; remove those observations first.")
    return inputs, outputs


def checked_noise_setting(noise: float | NoiseName) -> float | NoiseName:
    """Return a setting of the observation noise; raises InputError where it is neither a name nor a deviation."""
    if isinstance(noise, str):
        if noise not in NOISES:
            raise unknown_name("observation noise", noise, (*NOISES, "a standard deviation"))
        return noise
    number = isinstance(noise, (int, float, np.integer, np.floating)) and not isinstance(noise, bool)
    if not (number and np.isfinite(noise) and noise >= 0.0):
        raise InputError(f"observation noise is {noise!r}; give a finite standard deviation of 0 or more.")
    return float(noise)


def checked_noise(noise: ArrayLike, n: int) -> NDArray[np.float64]:
    """Return known standard deviations (n,) of n observations; raises InputError where they are none."""
    try:
        deviations = numbers_of(noise)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"noise is {noise!r}; give {n} standard deviations, one an observation.") from None
    if deviations.shape != (n,):
        raise InputError(f"noise has shape {deviations.shape}, but there are {n} observations; give one number each.")
    if not np.all(np.isfinite(deviations) & (deviations >= 0.0)):
        raise InputError("noise holds a number that is negative or not finite; give standard deviations of 0 or more.")
    return deviations

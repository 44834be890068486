"""What a trial is worth, given the model's mean and standard deviation there (compiled).

Legend (the thesis' symbols in brackets)
    mean, std   of the quantity that is maximized, any shape
    best        the incumbent's value on the same scale                         [y+]
    margin      improvement that does not count                                 [xi]
    z           (mean - best - margin) / std, held where its square stays finite   [Z]
    phi, Phi    density and distribution function of the standard normal
Each function returns its value and its derivatives with respect to mean and std.
"""

from math import erfc, exp, log, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from surehold.store.kernels import njit

__all__ = [
    "Value",
    "expected_improvement",
    "log_expected_improvement",
    "probability_of_improvement",
    "upper_confidence_bound",
]

_LOG_SQRT_2PI: Final = 0.5 * log(2.0 * pi)
_SQRT_HALF: Final = sqrt(0.5)
_SQRT_HALF_PI: Final = sqrt(0.5 * pi)
_SMALLEST: Final = 1e-290  # a standard deviation below this is treated as this
_FARTHEST: Final = 1e8  # |z| beyond this is treated as this: derivatives stay finite


class Value(NamedTuple):
    """A criterion and its derivatives, each of the shape of its arguments."""

    value: NDArray[np.float64]
    by_mean: NDArray[np.float64]
    by_std: NDArray[np.float64]


def expected_improvement(mean: ArrayLike, std: ArrayLike, best: ArrayLike, margin: float = 0.0) -> Value:
    """Return (mean - best - margin) Phi(z) + std phi(z), thesis (3.15), (3.16).

    At a standard deviation of 0 that is max(mean - best - margin, 0).
    """
    return _improvement(mean, std, best, margin, False)


def log_expected_improvement(mean: ArrayLike, std: ArrayLike, best: ArrayLike, margin: float = 0.0) -> Value:
    """Return the logarithm of the expected improvement, finite where the improvement itself underflows.

    log EI = log std + log h(z), h(z) = phi(z) + z Phi(z), after Ament et al. 2023.
    """
    return _improvement(mean, std, best, margin, True)


def probability_of_improvement(mean: ArrayLike, std: ArrayLike, best: ArrayLike, margin: float = 0.0) -> Value:
    """Return Phi(z), thesis table 2.1; 0 or 1 at std 0."""
    gain = np.asarray(mean, dtype=np.float64) - np.asarray(best) - margin
    std = np.maximum(np.asarray(std, dtype=np.float64), _SMALLEST)
    z = _standardized(gain, std)
    density = _density(z)
    return Value(ndtr(z), density / std, -z * density / std)


def upper_confidence_bound(mean: ArrayLike, std: ArrayLike, kappa: float) -> Value:
    """Return mean + kappa std, thesis table 2.1."""
    mean, std = np.asarray(mean, dtype=np.float64), np.asarray(std, dtype=np.float64)
    return Value(mean + kappa * std, np.ones_like(mean), np.full_like(std, kappa))


def _standardized(gain: NDArray[np.float64], std: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return z = gain / std, held where its square, over a small std, stays finite."""
    return gain / np.maximum(np.maximum(std, _SMALLEST), np.abs(gain) / _FARTHEST)


def _density(z: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.exp(-0.5 * z * z - _LOG_SQRT_2PI)


def _improvement(mean: ArrayLike, std: ArrayLike, best: ArrayLike, margin: float, logarithm: bool) -> Value:
    gain = np.asarray(mean, dtype=np.float64) - np.asarray(best) - margin
    gain, deviation = np.broadcast_arrays(gain, np.asarray(std, dtype=np.float64))
    value, by_mean, by_std = np.empty(gain.shape), np.empty(gain.shape), np.empty(gain.shape)
    fill = _fill_log_improvement if logarithm else _fill_improvement
    fill(
        np.ascontiguousarray(gain).ravel(),
        np.ascontiguousarray(deviation).ravel(),
        value.reshape(-1),
        by_mean.reshape(-1),
        by_std.reshape(-1),
    )
    return Value(value, by_mean, by_std)


@njit(cache=True)
def _fill_improvement(gain, std, value, by_mean, by_std):
    for i in range(gain.size):
        z = gain[i] / max(std[i], _SMALLEST, abs(gain[i]) / _FARTHEST)
        density = exp(-0.5 * z * z - _LOG_SQRT_2PI)
        if z < -1.0:
            k = _continued_fraction(-z)
            value[i] = std[i] * density * k / (k - z)
        else:
            value[i] = gain[i] * 0.5 * erfc(-z * _SQRT_HALF) + std[i] * density
        by_mean[i] = 0.5 * erfc(-z * _SQRT_HALF)
        by_std[i] = density


@njit(cache=True)
def _fill_log_improvement(gain, std, value, by_mean, by_std):
    for i in range(gain.size):
        s = max(std[i], _SMALLEST, gain[i] / _FARTHEST)  # of a gain that is as good as sure, the logarithm is of it
        z = gain[i] / max(s, abs(gain[i]) / _FARTHEST)
        if z < -1.0:
            k = _continued_fraction(-z)
            log_h = -0.5 * z * z - _LOG_SQRT_2PI + log(k / (k - z))
            ratio = 1.0 / k
        else:
            probability = 0.5 * erfc(-z * _SQRT_HALF)
            h = exp(-0.5 * z * z - _LOG_SQRT_2PI) + z * probability
            log_h = log(h)
            ratio = probability / h
        value[i] = log(s) + log_h
        by_mean[i] = ratio / s
        by_std[i] = (1.0 - z * ratio) / s


@njit(cache=True)
def _continued_fraction(x):
    """Return K = 1 / (x + 2 / (x + 3 / (x + ...))) for x >= 1: with it nothing cancels.

    Phi(-x) / phi(x) = 1 / (x + K) (Laplace; Abramowitz and Stegun 1964, 26.2.14), so h(-x) = phi(x) K / (x + K) and
    Phi(-x) / h(-x) = 1 / K.
    """
    if x < 3.0:  # where it converges slowly, and little cancels yet
        return 1.0 / (_SQRT_HALF_PI * exp(0.5 * x * x) * erfc(x * _SQRT_HALF)) - x
    k = 0.0
    for i in range(int(400.0 / (x * x)) + 8, 0, -1):
        k = i / (x + k)
    return k

"""What a trial is worth, given the model's mean and standard deviation there.

Legend (the thesis' symbols in brackets)
    mean, std   of the quantity that is maximized, any shape
    best        the incumbent's value on the same scale                         [y+]
    margin      improvement that does not count                                 [xi]
    z           (mean - best - margin) / std                                    [Z]
    phi, Phi    density and distribution function of the standard normal
Each function returns its value and its derivatives with respect to mean and std.
"""

from math import log, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erfcx, ndtr

__all__ = [
    "Value",
    "expected_improvement",
    "log_expected_improvement",
    "probability_of_improvement",
    "upper_confidence_bound",
]

_LOG_SQRT_2PI: Final = 0.5 * log(2.0 * pi)
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
    mean, std = np.asarray(mean, dtype=np.float64), np.asarray(std, dtype=np.float64)
    gain = mean - np.asarray(best) - margin
    z = _standardized(gain, std)
    density = _density(z)
    probability = ndtr(z)
    # For z below -1 the two terms nearly cancel; the scaled complementary error function does not.
    low = z < -1.0
    value = np.where(low, std * density * _mills_gap(np.where(low, z, -1.0)), gain * probability + std * density)
    return Value(value, probability, density)


def log_expected_improvement(mean: ArrayLike, std: ArrayLike, best: ArrayLike, margin: float = 0.0) -> Value:
    """Return the logarithm of the expected improvement, finite where the improvement itself underflows.

    log EI = log std + log h(z), h(z) = phi(z) + z Phi(z), with the asymptotic branch of Ament et al. 2023.
    """
    gain = np.asarray(mean, dtype=np.float64) - np.asarray(best) - margin
    std = np.maximum(np.asarray(std, dtype=np.float64), _SMALLEST)
    z = _standardized(gain, std)
    # log h: below -1 the sum cancels; 1 - |z| Phi / phi by erfcx does not, nor does the ratio Phi / h = d log h / dz.
    low = z < -1.0
    z_low = np.where(low, z, -1.0)
    z_high = np.where(low, 0.0, z)
    gap = _mills_gap(z_low)
    probability = ndtr(z_high)
    h = np.exp(-0.5 * z_high * z_high - _LOG_SQRT_2PI) + z_high * probability
    log_h = np.where(low, -0.5 * z_low * z_low - _LOG_SQRT_2PI + np.log(gap), np.log(h))
    ratio = np.where(low, sqrt(0.5 * pi) * erfcx(-z_low / sqrt(2.0)) / gap, probability / h)
    return Value(np.log(std) + log_h, ratio / std, (1.0 - z * ratio) / std)


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


def _mills_gap(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 1 - |z| Phi(z) / phi(z) for z <= -1 without cancellation; about 1 / z^2 far out."""
    far = 1.0 / (z * z)
    near = 1.0 + z * sqrt(0.5 * pi) * erfcx(-z / sqrt(2.0))
    series = far * (1.0 - 3.0 * far * (1.0 - 5.0 * far * (1.0 - 7.0 * far)))
    return np.where(z < -200.0, series, near)

"""Stationary covariance functions with one length-scale a dimension, their values and gradients (compiled).

Legend (unit-cube inputs; the thesis' symbols in brackets)
    x, q   points                    (d,)
    l      length-scales             (d,)   [theta]
    rho    || (q - x) / l ||         scalar
    c      correlation k / s2        scalar, 1 at rho = 0
    g      radial factor             scalar, -(dc/drho) / rho, finite at rho = 0

With g, every derivative that is needed has no singularity:
    dc/dq_i     = -g (q_i - x_i) / l_i^2
    dc/dlog l_i =  g (q_i - x_i)^2 / l_i^2

    Matern-5/2            c = (1 + r + r^2/3) exp(-r),  r = sqrt(5) rho,  g = 5/3 (1 + r) exp(-r)     thesis (3.2)
    Matern-3/2            c = (1 + r) exp(-r),          r = sqrt(3) rho,  g = 3 exp(-r)
    squared exponential   c = exp(-rho^2 / 2),                            g = c
(Rasmussen and Williams 2006, section 4.2.)
"""

from math import exp, sqrt
from typing import Final

import numpy as np
from numba import njit

from surehold.errors import unknown_name

__all__ = ["KERNELS", "correlation_and_factor", "cross_correlation", "kernel_number", "self_correlation"]

KERNELS: Final = ("matern52", "matern32", "squared_exponential")
_SQRT3: Final = sqrt(3.0)
_SQRT5: Final = sqrt(5.0)


def kernel_number(name: str) -> int:
    """Return the number by which the compiled functions know a kernel; raises InputError for an unknown name."""
    if name not in KERNELS:
        raise unknown_name("kernel", name, KERNELS)
    return KERNELS.index(name)


@njit(cache=True, inline="always")
def _correlation(kernel: int, squared: float) -> float:
    if kernel == 0:
        r = _SQRT5 * sqrt(squared)
        return (1.0 + r + r * r / 3.0) * exp(-r)
    if kernel == 1:
        r = _SQRT3 * sqrt(squared)
        return (1.0 + r) * exp(-r)
    return exp(-0.5 * squared)


@njit(cache=True, inline="always")
def _correlation_and_factor(kernel: int, squared: float) -> tuple[float, float]:
    if kernel == 0:
        r = _SQRT5 * sqrt(squared)
        e = exp(-r)
        return (1.0 + r + r * r / 3.0) * e, 5.0 / 3.0 * (1.0 + r) * e
    if kernel == 1:
        r = _SQRT3 * sqrt(squared)
        e = exp(-r)
        return (1.0 + r) * e, 3.0 * e
    e = exp(-0.5 * squared)
    return e, e


@njit(cache=True)
def self_correlation(kernel, X, inverse_l, out):
    """Fill the strict lower triangle of `out` (n, n) with c(x_i, x_j) of X (n, d) and its diagonal with 1."""
    n, d = X.shape
    for i in range(n):
        for j in range(i):
            squared = 0.0
            for k in range(d):
                t = (X[i, k] - X[j, k]) * inverse_l[k]
                squared += t * t
            out[i, j] = squared
    for i in range(n):
        for j in range(i):
            out[i, j] = _correlation(kernel, out[i, j])
        out[i, i] = 1.0


@njit(cache=True)
def cross_correlation(kernel, X, Q, inverse_l, out):
    """Fill `out` (n, q) with c(x_i, q_j) of X (n, d) and Q (q, d)."""
    n, d = X.shape
    for i in range(n):
        for j in range(Q.shape[0]):
            squared = 0.0
            for k in range(d):
                t = (X[i, k] - Q[j, k]) * inverse_l[k]
                squared += t * t
            out[i, j] = squared
    for i in range(n):
        for j in range(Q.shape[0]):
            out[i, j] = _correlation(kernel, out[i, j])


@njit(cache=True)
def correlation_and_factor(kernel, X, Q, inverse_l, out, factor):
    """Fill `out` (n, q) with c(x_i, q_j) and `factor` (n, q) with the radial factor g of the module's legend."""
    n, d = X.shape
    for i in range(n):
        for j in range(Q.shape[0]):
            squared = 0.0
            for k in range(d):
                t = (X[i, k] - Q[j, k]) * inverse_l[k]
                squared += t * t
            out[i, j], factor[i, j] = _correlation_and_factor(kernel, squared)


def correlation(kernel: str, X: np.ndarray, Q: np.ndarray, length_scales: np.ndarray) -> np.ndarray:
    """Return c(X, Q) of shape (n, q) for X (n, d), Q (q, d) and length-scales (d,)."""
    out = np.empty((len(X), len(Q)))
    cross_correlation(
        kernel_number(kernel),
        np.ascontiguousarray(X, dtype=np.float64),
        np.ascontiguousarray(Q, dtype=np.float64),
        1.0 / np.asarray(length_scales, dtype=np.float64),
        out,
    )
    return out

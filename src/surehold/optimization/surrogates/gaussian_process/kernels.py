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

The product form multiplies one-dimensional Matern-5/2 correlations c_i (thesis (3.2) as printed). There g stands for c
itself, and both derivatives take the factor h_i = g_i / c_i of their dimension besides (`along`; 1 for the others):
    Matern-5/2, product   c = prod_i (1 + r_i + r_i^2/3) exp(-r_i),  r_i = sqrt(5) |q_i - x_i| / l_i
"""

from math import sqrt
from typing import Final

import numpy as np

from surehold.errors import unknown_name
from surehold.store.kernels import njit

__all__ = [
    "KERNELS",
    "along",
    "correlation_and_factor",
    "cross_correlation",
    "kernel_number",
    "self_correlation",
    "transposed",
]

KERNELS: Final = ("matern52", "matern32", "squared_exponential", "matern52_product")
_PRODUCT: Final = 3
_SQRT3: Final = sqrt(3.0)
_SQRT5: Final = sqrt(5.0)
_FAR: Final = 700.0  # beyond this exponent a correlation is 0 in double precision


def kernel_number(name: str) -> int:
    """Return the number by which the compiled functions know a kernel; raises InputError for an unknown name."""
    if name not in KERNELS:
        raise unknown_name("kernel", name, KERNELS)
    return KERNELS.index(name)


@njit(cache=True, inline="always")
def _exponential(x):
    """Return exp(x) for x in [-700, 0] to 2 units in the last place, in a form that compilers turn into SIMD code.

    exp(x) = 2^k exp(t) with |t| <= ln 2 / 2 (Cody and Waite 1980), exp(t) by its Taylor polynomial of degree 13; a call
    of the C library's exp, one element at a time, takes three times as long.
    """
    k = np.floor(x * 1.4426950408889634 + 0.5)
    t = (x - k * 0.693145751953125) - k * 1.4286068203094172e-06
    p = 1.6059043836821613e-10
    p = p * t + 2.08767569878681e-09
    p = p * t + 2.505210838544172e-08
    p = p * t + 2.755731922398589e-07
    p = p * t + 2.7557319223985893e-06
    p = p * t + 2.48015873015873e-05
    p = p * t + 0.0001984126984126984
    p = p * t + 0.001388888888888889
    p = p * t + 0.008333333333333333
    p = p * t + 0.041666666666666664
    p = p * t + 0.16666666666666666
    p = p * t + 0.5
    p = p * t + 1.0
    p = p * t + 1.0
    return p * np.int64((np.int64(k) + np.int64(1023)) << np.int64(52)).view(np.float64)


@njit(cache=True, fastmath={"contract"})
def _transform(kernel, squared):
    """Overwrite squared scaled distances (n,) with correlations c."""
    if kernel == 0:
        for i in range(squared.size):
            r = min(_SQRT5 * sqrt(squared[i]), _FAR)
            squared[i] = (1.0 + r + r * r / 3.0) * _exponential(-r)
    elif kernel == 1:
        for i in range(squared.size):
            r = min(_SQRT3 * sqrt(squared[i]), _FAR)
            squared[i] = (1.0 + r) * _exponential(-r)
    else:
        for i in range(squared.size):
            squared[i] = _exponential(-min(0.5 * squared[i], _FAR))


@njit(cache=True, fastmath={"contract"})
def _transform_with_factor(kernel, squared, factor):
    """Overwrite squared scaled distances (n,) with correlations c and fill `factor` (n,) with radial factors g."""
    if kernel == 0:
        for i in range(squared.size):
            r = min(_SQRT5 * sqrt(squared[i]), _FAR)
            e = _exponential(-r)
            squared[i] = (1.0 + r + r * r / 3.0) * e
            factor[i] = 5.0 / 3.0 * (1.0 + r) * e
    elif kernel == 1:
        for i in range(squared.size):
            r = min(_SQRT3 * sqrt(squared[i]), _FAR)
            e = _exponential(-r)
            squared[i] = (1.0 + r) * e
            factor[i] = 3.0 * e
    else:
        for i in range(squared.size):
            e = _exponential(-min(0.5 * squared[i], _FAR))
            squared[i] = e
            factor[i] = e


@njit(cache=True, fastmath={"contract"})
def _squared_distances(x, Z, inverse_l, out):
    """Fill `out` (q,) with || (x - z_j) / l ||^2 for x (d,) and the columns z_j of Z (d, q) that `out` has room for."""
    out[:] = 0.0
    for k in range(x.size):
        scale = inverse_l[k]
        for j in range(out.size):
            t = (x[k] - Z[k, j]) * scale
            out[j] += t * t


@njit(cache=True, fastmath={"contract"})
def _products(x, Z, inverse_l, out):
    """Fill `out` (q,) with the product form's correlation of x (d,) with columns of Z (d, q)."""
    out[:] = 1.0
    for k in range(x.size):
        scale = _SQRT5 * inverse_l[k]
        for j in range(out.size):
            r = min(abs(x[k] - Z[k, j]) * scale, _FAR)
            out[j] *= (1.0 + r + r * r / 3.0) * _exponential(-r)


@njit(cache=True, inline="always")
def along(kernel, difference, scale):
    """Return the factor h of the module's legend for one dimension: coordinates' difference, inverse length-scale."""
    if kernel != _PRODUCT:
        return 1.0
    r = _SQRT5 * abs(difference) * scale
    return 5.0 * (1.0 + r) / (3.0 + 3.0 * r + r * r)


@njit(cache=True)
def transposed(A):
    """Return A' (d, n) of A (n, d), C-contiguous; NumPy's own way takes seconds to compile."""
    out = np.empty((A.shape[1], A.shape[0]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            out[k, i] = A[i, k]
    return out


@njit(cache=True)
def self_correlation(kernel, X, inverse_l, out):
    """Fill the strict lower triangle of `out` (n, n) with c(x_i, x_j) of X (n, d) and its diagonal with 1."""
    Z = transposed(X)
    for i in range(X.shape[0]):
        row = out[i, :i]
        if kernel == _PRODUCT:
            _products(X[i], Z, inverse_l, row)
        else:
            _squared_distances(X[i], Z, inverse_l, row)
            _transform(kernel, row)
        out[i, i] = 1.0


@njit(cache=True)
def cross_correlation(kernel, X, Q, inverse_l, out):
    """Fill `out` (n, q) with c(x_i, q_j) of X (n, d) and Q (q, d)."""
    Z = transposed(Q)
    for i in range(X.shape[0]):
        if kernel == _PRODUCT:
            _products(X[i], Z, inverse_l, out[i])
        else:
            _squared_distances(X[i], Z, inverse_l, out[i])
            _transform(kernel, out[i])


@njit(cache=True)
def correlation_and_factor(kernel, X, Q, inverse_l, out, factor):
    """Fill `out` (n, q) with c(x_i, q_j) and `factor` (n, q) with the radial factor g of the module's legend."""
    Z = transposed(Q)
    for i in range(X.shape[0]):
        if kernel == _PRODUCT:
            _products(X[i], Z, inverse_l, out[i])
            for j in range(out.shape[1]):
                factor[i, j] = out[i, j]
        else:
            _squared_distances(X[i], Z, inverse_l, out[i])
            _transform_with_factor(kernel, out[i], factor[i])


def correlation(kernel: str, X: np.ndarray, Q: np.ndarray, length_scales: np.ndarray) -> np.ndarray:
    """Return c(X, Q) of shape (n, q) for X (n, d), Q (q, d) and length-scales (d,)."""
    out = np.empty((len(X), len(Q)))
    cross_correlation(
        kernel_number(kernel),
        np.ascontiguousarray(X, dtype=np.float64),
        np.ascontiguousarray(Q, dtype=np.float64),
        1.0 / np.asarray(length_scales, dtype=np.float64).ravel(),
        out,
    )
    return out

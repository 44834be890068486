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

Two forms are made of one-dimensional Matern-5/2 correlations c_i with their factors g_i at r_i = sqrt(5) |q_i - x_i| /
l_i. In both derivatives a factor of dimension i takes the place of g (`along`):
    Matern-5/2, product   c = prod_i c_i (thesis (3.2) as printed),  g stands for c,  its factor is c g_i / c_i
    additive              see below                                                  g + (1 - w) g_i / d

The form of two scales is the sum of a long and a short process, independent of each other, whose length-scales are in
one proportion a in all dimensions; w is the share of the short one:
    Matern-5/2, two scales  c = (1 - w) c_long(rho) + w c_long(a rho),  g = (1 - w) g_long(rho) + w a^2 g_long(a rho)
Its scales (d + 2,) are the inverse length-scales followed by a and w; those of the others are the former (d,) alone.
Where w is 0 the long process is alone, and a, which then says nothing else, says which one it is: squared exponential
where a is 0, Matern-5/2 otherwise. Where a stands multiplied by e^50, the long process is a sum of independent ones, of
one variable each (additive processes: Duvenaud, Nickisch and Rasmussen 2011; of first order here):
    additive                c = (1 - w) / d sum_i c_i + w c_long(a rho),  g = w a^2 g_long(a rho)
So particles of all four can stand side by side.
"""

from math import exp, sqrt
from typing import Final

import numpy as np

from surehold.errors import unknown_name
from surehold.optimization.numerics.exponential import exponential
from surehold.store.kernels import njit

__all__ = [
    "KERNELS",
    "LOG_ADDITIVE",
    "TWO_SCALES",
    "additive_share",
    "along",
    "are_sums",
    "correlation_and_factor",
    "correlations",
    "cross_correlation",
    "kernel_number",
    "rectangle",
    "shape_size",
    "transposed",
    "triangle",
    "two_scale_slopes",
]

KERNELS: Final = ("matern52", "matern32", "squared_exponential", "matern52_product", "matern52_two_scales")
_PRODUCT: Final = 3
TWO_SCALES: Final = 4
_NOTHING: Final = 1e-20  # a share that adds nothing in double precision; a proportion that is none
LOG_ADDITIVE: Final = 50.0  # what log a exceeds the logarithm of the proportion by, where the long process is a sum
_ADDITIVE: Final = exp(0.5 * LOG_ADDITIVE)  # beyond which a is of that kind
_OF_ADDITIVE: Final = exp(-LOG_ADDITIVE)
_SQRT3: Final = sqrt(3.0)
_SQRT5: Final = sqrt(5.0)
_FAR: Final = 700.0  # beyond this exponent a correlation is 0 in double precision


def kernel_number(name: str) -> int:
    """Return the number by which the compiled functions know a kernel; raises InputError for an unknown name."""
    if name not in KERNELS:
        raise unknown_name("kernel", name, KERNELS)
    return KERNELS.index(name)


def shape_size(kernel: int) -> int:
    """Return how many hyperparameters the kernel has besides length-scales: 2 for two scales, else none."""
    return 2 if kernel == TWO_SCALES else 0


@njit(cache=True, inline="always")
def additive_share(kernel, scales):
    """Return the share (1 - w) / d of each process of one variable; 0 where the kernel has none."""
    if kernel == TWO_SCALES and scales[-2] > _ADDITIVE:
        return max(1.0 - scales[-1], _NOTHING) / (scales.size - 2)
    return 0.0


def are_sums(kernel: int, scales: np.ndarray) -> np.ndarray:
    """Return which of the scales (m, d + 2) of particles are those of sums of processes of one variable, (m,)."""
    return scales[:, -2] > _ADDITIVE if kernel == TWO_SCALES else np.zeros(len(scales), dtype=bool)


@njit(cache=True, fastmath={"contract"})
def _transform(kernel, squared, scales):
    """Overwrite squared scaled distances (n,) with correlations c; of additive ones with their short part."""
    if additive_share(kernel, scales) > 0.0:
        a, w = scales[-2] * _OF_ADDITIVE, scales[-1]
        for i in range(squared.size):
            s = min(a * (_SQRT5 * sqrt(squared[i])), _FAR)
            squared[i] = w * ((1.0 + s + s * s / 3.0) * exponential(-s))
    elif kernel == TWO_SCALES and scales[-1] >= _NOTHING:
        a, w = scales[-2], scales[-1]
        for i in range(squared.size):
            rho = _SQRT5 * sqrt(squared[i])
            r = min(rho, _FAR)
            s = min(a * rho, _FAR)
            squared[i] = (1.0 - w) * ((1.0 + r + r * r / 3.0) * exponential(-r))
            squared[i] += w * ((1.0 + s + s * s / 3.0) * exponential(-s))
    elif kernel == 0 or (kernel == TWO_SCALES and scales[-2] >= _NOTHING):
        for i in range(squared.size):
            r = min(_SQRT5 * sqrt(squared[i]), _FAR)
            squared[i] = (1.0 + r + r * r / 3.0) * exponential(-r)
    elif kernel == 1:
        for i in range(squared.size):
            r = min(_SQRT3 * sqrt(squared[i]), _FAR)
            squared[i] = (1.0 + r) * exponential(-r)
    else:
        for i in range(squared.size):
            squared[i] = exponential(-min(0.5 * squared[i], _FAR))


@njit(cache=True, fastmath={"contract"})
def _transform_with_factor(kernel, squared, factor, scales):
    """Do as `_transform` does, and fill `factor` (n,) with radial factors g."""
    if additive_share(kernel, scales) > 0.0:
        a, w = scales[-2] * _OF_ADDITIVE, scales[-1]
        for i in range(squared.size):
            s = min(a * (_SQRT5 * sqrt(squared[i])), _FAR)
            e = w * exponential(-s)
            squared[i] = (1.0 + s + s * s / 3.0) * e
            factor[i] = 5.0 / 3.0 * a * a * (1.0 + s) * e
    elif kernel == TWO_SCALES and scales[-1] >= _NOTHING:
        a, w = scales[-2], scales[-1]
        for i in range(squared.size):
            rho = _SQRT5 * sqrt(squared[i])
            r = min(rho, _FAR)
            s = min(a * rho, _FAR)
            e, f = (1.0 - w) * exponential(-r), w * exponential(-s)
            squared[i] = (1.0 + r + r * r / 3.0) * e + (1.0 + s + s * s / 3.0) * f
            factor[i] = 5.0 / 3.0 * ((1.0 + r) * e + a * a * (1.0 + s) * f)
    elif kernel == 0 or (kernel == TWO_SCALES and scales[-2] >= _NOTHING):
        for i in range(squared.size):
            r = min(_SQRT5 * sqrt(squared[i]), _FAR)
            e = exponential(-r)
            squared[i] = (1.0 + r + r * r / 3.0) * e
            factor[i] = 5.0 / 3.0 * (1.0 + r) * e
    elif kernel == 1:
        for i in range(squared.size):
            r = min(_SQRT3 * sqrt(squared[i]), _FAR)
            e = exponential(-r)
            squared[i] = (1.0 + r) * e
            factor[i] = 3.0 * e
    else:
        for i in range(squared.size):
            e = exponential(-min(0.5 * squared[i], _FAR))
            squared[i] = e
            factor[i] = e


@njit(cache=True)
def transposed(A):
    """Return A' (d, n) of A (n, d), C-contiguous; NumPy's own way takes seconds to compile."""
    out = np.empty((A.shape[1], A.shape[0]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            out[k, i] = A[i, k]
    return out


@njit(cache=True)
def rectangle(s, q):
    """Return where each of s rows of q numbers starts in a flat array, and where the last one ends, (s + 1,)."""
    return q * np.arange(s + 1)


@njit(cache=True)
def triangle(n):
    """Return where each row of a lower triangle with its diagonal starts in a flat array, and its size, (n + 1,)."""
    rows = np.arange(n + 1)
    return rows * (rows + 1) // 2


@njit(cache=True, fastmath={"contract"})
def _squared_distances(P, Z, inverse_l, starts, out):
    """Fill the rows of `out` with || (p_i - z_j) / l ||^2 of P (s, d) and the first columns of Z (d, q)."""
    s, d = P.shape
    even = d - d % 2
    for i in range(s):
        x, row = P[i], out[starts[i] : starts[i + 1]]
        row[:] = 0.0
        for k in range(0, even, 2):  # two dimensions at a time load and store the sums half as often
            this, next_scale = inverse_l[k], inverse_l[k + 1]
            for j in range(row.size):
                t = (x[k] - Z[k, j]) * this
                u = (x[k + 1] - Z[k + 1, j]) * next_scale
                row[j] += t * t + u * u
        if even < d:
            this = inverse_l[even]
            for j in range(row.size):
                t = (x[even] - Z[even, j]) * this
                row[j] += t * t


@njit(cache=True, fastmath={"contract"})
def _distances_along(P, Z, k, scale, starts, out):
    """Fill the rows of `out` with r = sqrt(5) |p_ik - z_jk| / l_k of P (s, d) and the first columns of Z (d, q)."""
    for i in range(P.shape[0]):
        z, row = P[i, k], out[starts[i] : starts[i + 1]]
        for j in range(row.size):
            row[j] = min(abs(z - Z[k, j]) * scale, _FAR)


@njit(cache=True, fastmath={"contract"})
def _multiply(r, out):
    """Multiply `out` by the Matern-5/2 correlations at r, of the same size."""
    for j in range(out.size):
        out[j] *= (1.0 + r[j] + r[j] * r[j] / 3.0) * exponential(-r[j])


@njit(cache=True, fastmath={"contract"})
def _add(share, r, out):
    """Add share times the Matern-5/2 correlations at r to `out`, of the same size."""
    for j in range(out.size):
        out[j] += share * ((1.0 + r[j] + r[j] * r[j] / 3.0) * exponential(-r[j]))


@njit(cache=True, fastmath={"contract"})
def along(kernel, P, Z, scales, k, starts, factor, room):
    """Return the factors of dimension k in the derivatives, see the module's legend and `correlations`.

    They are the radial factors g themselves of kernels whose dimensions share one; others fill `room`, of their size.
    """
    share = additive_share(kernel, scales)
    if share > 0.0:
        _distances_along(P, Z, k, _SQRT5 * scales[k], starts, room)
        for j in range(room.size):
            room[j] = factor[j] + share * (5.0 / 3.0 * (1.0 + room[j]) * exponential(-room[j]))
    elif kernel == _PRODUCT:
        _distances_along(P, Z, k, _SQRT5 * scales[k], starts, room)
        for j in range(room.size):
            room[j] = factor[j] * (5.0 * (1.0 + room[j]) / (3.0 + 3.0 * room[j] + room[j] * room[j]))
    else:
        return factor
    return room


@njit(cache=True)
def correlations(kernel, P, Z, scales, starts, out, factor):
    """Fill `out` with c(p_i, z_j) of P (s, d) and columns of Z (d, q), and `factor` with g of the module's legend.

    Row i of the flat arrays, from starts[i] to starts[i + 1], is that of p_i and of as many first columns of Z: see
    `rectangle` and `triangle`. A `factor` without room is not filled. All rows go through the exponential together:
    SIMD code takes what is left over of each row one by one.
    """
    share = additive_share(kernel, scales)
    if kernel == _PRODUCT:
        out[:] = 1.0
    else:
        _squared_distances(P, Z, scales, starts, out)
        if factor.size > 0:
            _transform_with_factor(kernel, out, factor, scales)
        else:
            _transform(kernel, out, scales)
    if kernel == _PRODUCT or share > 0.0:
        r = np.empty(out.size)
        for k in range(P.shape[1]):
            _distances_along(P, Z, k, _SQRT5 * scales[k], starts, r)
            if kernel == _PRODUCT:
                _multiply(r, out)
            else:
                _add(share, r, out)
    if kernel == _PRODUCT and factor.size > 0:
        for j in range(out.size):
            factor[j] = out[j]


@njit(cache=True)
def cross_correlation(kernel, X, Q, inverse_l, out):
    """Fill `out` (n, q) with c(x_i, q_j) of X (n, d) and Q (q, d)."""
    flat = out.reshape(out.size)
    correlations(kernel, X, transposed(Q), inverse_l, rectangle(*out.shape), flat, flat[:0])


@njit(cache=True)
def correlation_and_factor(kernel, X, Q, inverse_l, out, factor):
    """Fill `out` (n, q) with c(x_i, q_j) and `factor` (n, q) with the radial factor g of the module's legend."""
    starts = rectangle(*out.shape)
    correlations(kernel, X, transposed(Q), inverse_l, starts, out.reshape(out.size), factor.reshape(factor.size))


@njit(cache=True)
def two_scale_slopes(squared, c, a, w, by_proportion, by_share):
    """Fill the derivatives of correlations c of two scales by log a and by log(w / (1 - w)), at rho^2 = squared."""
    if a > _ADDITIVE:
        for i in range(c.size):
            s = min(a * _OF_ADDITIVE * (_SQRT5 * sqrt(squared[i])), _FAR)
            e = exponential(-s)
            by_proportion[i] = -w * s * s / 3.0 * (1.0 + s) * e
            by_share[i] = w * ((1.0 + s + s * s / 3.0) * e - c[i])
    else:
        for i in range(c.size):
            rho = _SQRT5 * sqrt(squared[i])
            r, s = min(rho, _FAR), min(a * rho, _FAR)
            e = exponential(-s)
            long = (1.0 + r + r * r / 3.0) * exponential(-r)
            by_proportion[i] = -w * s * s / 3.0 * (1.0 + s) * e
            by_share[i] = w * (1.0 - w) * ((1.0 + s + s * s / 3.0) * e - long)


def correlation(kernel: str, X: np.ndarray, Q: np.ndarray, length_scales: np.ndarray, *shape: float) -> np.ndarray:
    """Return c(X, Q) of shape (n, q) for X (n, d), Q (q, d), length-scales (d,) and, of two scales, a and w."""
    out = np.empty((len(X), len(Q)))
    cross_correlation(
        kernel_number(kernel),
        np.ascontiguousarray(X, dtype=np.float64),
        np.ascontiguousarray(Q, dtype=np.float64),
        np.append(1.0 / np.asarray(length_scales, dtype=np.float64).ravel(), shape),
        out,
    )
    return out

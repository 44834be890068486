"""Log posterior density of Gaussian-process hyperparameters, weighted over blocks of data (compiled).

Legend (the thesis' symbols in brackets)
    X, y     inputs (n, d) in the unit cube, outputs (n,)
    theta    hyperparameters (p,): log l_1 .. log l_d, then those of the kernel's shape, if it has any, then log s2 if
             learnt, then log v if learnt
    l        length-scales (d,)
    a, w     shape of the kernel of two scales: proportion of its length-scales, share of the short one; in theta
             log a, log(w / (1 - w))
    s2       signal variance                                        [sigma_p, used as a variance]
    v        observation-noise variance, common to all observations
    noise    known observation-noise variance of each observation (n,)
    ratio    nugget as a fraction of the signal variance            [sigma_n, used as a ratio]
    m2       prior variance of the constant mean, which is integrated out; 0 is a zero mean
    A        covariance of the data: s2 (C + ratio I) + m2 11' + diag(noise) + v I, C the correlation matrix
    L        lower Cholesky factor of A
    blocks   slices of the observations, each an independent process with the same theta; block b has weight w_b  (3.11)

    log p(y | X, theta) = -1/2 y' A^-1 y - log|L| - n/2 log 2 pi                        thesis (3.3); GPML algorithm 2.1
    log posterior       = sum_b w_b log p(y_b | X_b, theta) + log prior(theta),  prior: independent normals on theta
"""

from math import exp, inf, log, pi
from typing import Final, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from surehold.optimization.numerics.cholesky import cholesky
from surehold.optimization.numerics.triangular import gram_of_lower, invert_lower, solve_lower, solve_lower_transposed
from surehold.optimization.surrogates.gaussian_process.kernels import (
    TWO_SCALES,
    along,
    correlations,
    transposed,
    triangle,
    two_scale_slopes,
)
from surehold.store.kernels import njit

__all__ = ["EVIDENCE_TYPE", "Evidence", "log_posterior", "log_posterior_and_gradient"]

_LOG_2PI: Final = log(2.0 * pi)
_LARGEST: Final = 60.0  # |theta| beyond this is outside every useful scale and would overflow


class Evidence(NamedTuple):
    """What the density of the hyperparameters depends on; plain arrays and numbers for compiled code."""

    X: NDArray[np.float64]
    """inputs, (n, d), C-contiguous"""
    y: NDArray[np.float64]
    """outputs, (n,)"""
    noise: NDArray[np.float64]
    """known observation-noise variances, (n,)"""
    offsets: NDArray[np.int64]
    """block b is the observations offsets[b] : offsets[b + 1], (b + 1,)"""
    weights: NDArray[np.float64]
    """weight of each block, (b,)"""
    prior_mean: NDArray[np.float64]
    """mean of the normal prior of each hyperparameter, (p,)"""
    prior_deviation: NDArray[np.float64]
    """its standard deviation, (p,)"""
    signal_variance: float
    """s2 where it is not learnt"""
    ratio: float
    """nugget as a fraction of s2"""
    mean_variance: float
    """prior variance of the constant mean"""
    kernel: int
    """number of the kernel"""
    learn_signal: bool
    """whether theta holds log s2"""
    learn_noise: bool
    """whether theta ends with log v"""

    def first_block(self) -> "Evidence":
        """Return the evidence of the first block alone, with weight 1."""
        n = int(self.offsets[1])
        if n == len(self.y):
            return self
        return self._replace(
            X=self.X[:n], y=self.y[:n], noise=self.noise[:n], offsets=np.array([0, n]), weights=np.ones(1)
        )


EVIDENCE_TYPE: Final = types.NamedTuple(
    (
        types.float64[:, ::1],
        types.float64[::1],
        types.float64[::1],
        types.int64[::1],
        types.float64[::1],
        types.float64[::1],
        types.float64[::1],
        types.float64,
        types.float64,
        types.float64,
        types.int64,
        types.boolean,
        types.boolean,
    ),
    Evidence,
)


@njit(cache=True)
def unpack(theta, evidence):
    """Return (s2, v) of theta."""
    d = evidence.X.shape[1]
    s2, v = evidence.signal_variance, 0.0
    position = d + (2 if evidence.kernel == TWO_SCALES else 0)
    if evidence.learn_signal:
        s2 = exp(theta[position])
        position += 1
    if evidence.learn_noise:
        v = exp(theta[position])
    return s2, v


@njit(cache=True)
def scales_of(theta, evidence):
    """Return the kernel's scales: inverse length-scales (d,), and those of its shape, if it has any."""
    d = evidence.X.shape[1]
    if evidence.kernel != TWO_SCALES:
        return np.exp(-theta[:d])
    scales = np.exp(-theta[: d + 2])
    scales[d] = exp(theta[d])
    scales[d + 1] = 1.0 / (1.0 + exp(-theta[d + 1]))
    return scales


@njit(cache=True)
def data_covariance(X, noise, inverse_l, s2, v, ratio, mean_variance, kernel, A):
    """Fill the lower triangle of A (n, n) with s2 (C + ratio I) + m2 11' + diag(noise) + v I."""
    n = X.shape[0]
    starts = triangle(n)
    C = np.empty(starts[n])
    correlations(kernel, X, transposed(X), inverse_l, starts, C, C[:0])
    for i in range(n):
        for j in range(i):
            A[i, j] = C[starts[i] + j] * s2 + mean_variance
        A[i, i] = s2 * (1.0 + ratio) + mean_variance + noise[i] + v


@njit(cache=True)
def _log_prior(theta, evidence):
    value = 0.0
    for i in range(theta.size):
        if not abs(theta[i]) < _LARGEST:
            return -inf
        z = (theta[i] - evidence.prior_mean[i]) / evidence.prior_deviation[i]
        value -= 0.5 * z * z + log(evidence.prior_deviation[i]) + 0.5 * _LOG_2PI
    return value


@njit(cache=True)
def log_posterior(theta, evidence):
    """Return the log posterior density of theta (p,), up to no constant; -inf where A is not positive definite."""
    value = _log_prior(theta, evidence)
    if value == -inf:
        return value
    inverse_l = scales_of(theta, evidence)
    s2, v = unpack(theta, evidence)
    for b in range(evidence.weights.size):
        start, stop = evidence.offsets[b], evidence.offsets[b + 1]
        n = stop - start
        if n == 0 or evidence.weights[b] == 0.0:
            continue
        A = np.empty((n, n))
        data_covariance(
            evidence.X[start:stop],
            evidence.noise[start:stop],
            inverse_l,
            s2,
            v,
            evidence.ratio,
            evidence.mean_variance,
            evidence.kernel,
            A,
        )
        if not cholesky(A):
            return -inf
        z = evidence.y[start:stop].copy()
        solve_lower(A, z)
        total = 0.5 * n * _LOG_2PI
        for i in range(n):
            total += 0.5 * z[i] * z[i] + log(A[i, i])
        value -= evidence.weights[b] * total
    return value


@njit(cache=True, fastmath={"reassoc", "contract"})
def _add_weighted_squares(z, row, scale, weights, gradient, k):
    """Add the sum over j of weights (z - row_j)^2 scale^2, for z, scale and row, weights (q,), to gradient[k]."""
    t = 0.0
    for j in range(weights.size):
        step = z - row[j]
        t += weights[j] * (step * step)
    gradient[k] += t * scale * scale


@njit(cache=True)
def _add_slopes_by_shape(X, Z, scales, starts, weights, C, room, gradient):
    """Add the derivatives by the shape of two scales to `gradient` (d + 4,), for pairs of `weights` and correlations C.

    These are flat triangles, as `room` is, which is overwritten.
    """
    n, d = X.shape
    room[:] = 0.0  # squared distances; products are not fused, whose last bits send chains of hyperparameters elsewhere
    for i in range(n):
        for k in range(d):
            for j in range(i):
                t = (X[i, k] - Z[k, j]) * scales[k]
                room[starts[i] + j] += t * t
    by_proportion, by_share = np.empty(C.size), np.empty(C.size)
    two_scale_slopes(room, C, scales[d], scales[d + 1], by_proportion, by_share)
    for i in range(n):
        for pair in range(starts[i], starts[i] + i):
            gradient[d + 2] += weights[pair] * by_proportion[pair]
            gradient[d + 3] += weights[pair] * by_share[pair]


@njit(cache=True)
def _block_gradient(X, y, noise, inverse_l, s2, v, ratio, mean_variance, kernel, gradient):
    """Return log p of one block and add its derivatives to `gradient` (d + 4,): log l, log s2, log v, shape."""
    n, d = X.shape
    Z = transposed(X)
    starts = triangle(n)
    C, factor, room = np.empty(starts[n]), np.empty(starts[n]), np.empty(starts[n])
    correlations(kernel, X, Z, inverse_l, starts, C, factor)
    L = np.empty((n, n))
    for i in range(n):
        for j in range(i):
            L[i, j] = s2 * C[starts[i] + j] + mean_variance
        L[i, i] = s2 * (1.0 + ratio) + mean_variance + noise[i] + v
    if not cholesky(L):
        return -inf
    inverse = np.empty((n, n))
    invert_lower(L, inverse)
    alpha = np.empty(n)
    for i in range(n):
        alpha[i] = y[i]
    value = -0.5 * n * _LOG_2PI
    solve_lower(L, alpha)
    for i in range(n):
        value -= 0.5 * alpha[i] * alpha[i] + log(L[i, i])
    solve_lower_transposed(L, alpha)
    A_inverse = L  # not needed any more
    gram_of_lower(inverse, A_inverse)
    weights, weighted = np.empty(starts[n]), np.empty(n)
    for i in range(n):  # 1/2 tr((alpha alpha' - A^-1) dA/dtheta), GPML (5.9)
        by_signal = 0.0
        for j in range(i):
            w = (alpha[i] * alpha[j] - A_inverse[i, j]) * s2  # the two symmetric entries together
            c = C[starts[i] + j]
            by_signal += w * c
            weights[starts[i] + j] = w
        w = 0.5 * (alpha[i] * alpha[i] - A_inverse[i, i])
        gradient[d] += by_signal + w * s2 * (1.0 + ratio)
        gradient[d + 1] += w * v
    if kernel == TWO_SCALES:
        _add_slopes_by_shape(X, Z, inverse_l, starts, weights, C, room, gradient)
    for k in range(d):
        g = along(kernel, X, Z, inverse_l, k, starts, factor, room)
        for i in range(n):
            for j in range(i):
                weighted[j] = weights[starts[i] + j] * g[starts[i] + j]
            _add_weighted_squares(X[i, k], Z[k, :i], inverse_l[k], weighted[:i], gradient, k)
    return value


@njit(cache=True)
def log_posterior_and_gradient(theta, evidence):
    """Return the log posterior density of theta (p,) and its gradient (p,); -inf and 0 where A is not definite."""
    gradient = np.zeros(theta.size)
    value = _log_prior(theta, evidence)
    if value == -inf:
        return value, gradient
    d = evidence.X.shape[1]
    inverse_l = scales_of(theta, evidence)
    s2, v = unpack(theta, evidence)
    full = np.zeros(d + 4)
    for b in range(evidence.weights.size):
        start, stop = evidence.offsets[b], evidence.offsets[b + 1]
        weight = evidence.weights[b]
        if stop == start or weight == 0.0:
            continue
        part = np.zeros(d + 4)
        block = _block_gradient(
            evidence.X[start:stop],
            evidence.y[start:stop],
            evidence.noise[start:stop],
            inverse_l,
            s2,
            v,
            evidence.ratio,
            evidence.mean_variance,
            evidence.kernel,
            part,
        )
        if block == -inf:
            return -inf, gradient
        value += weight * block
        for i in range(d + 4):
            full[i] += weight * part[i]
    for i in range(d):
        gradient[i] = full[i]
    position = d
    if evidence.kernel == TWO_SCALES:
        gradient[d], gradient[d + 1] = full[d + 2], full[d + 3]
        position += 2
    if evidence.learn_signal:
        gradient[position] = full[d]
        position += 1
    if evidence.learn_noise:
        gradient[position] = full[d + 1]
    for i in range(theta.size):
        gradient[i] -= (theta[i] - evidence.prior_mean[i]) / evidence.prior_deviation[i] ** 2
    return value, gradient

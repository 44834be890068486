"""Laplace's approximation of a Gaussian process behind a binomial probit likelihood (compiled).

Legend
    X         inputs (n, d) in the unit cube; s successes of r trials at each, (n,)
    f         latent function, (n,); K its prior covariance s2 (C + ratio I) + m2 11', C the correlation; of pairs that
              were compared in place of f the differences g = (f_a - f_b) / sqrt 2, which have a covariance as well
    Phi, phi  standard normal distribution function and density;  log p(s | f) = s log Phi(f) + (r - s) log Phi(-f)
    u, W      d log p / df and -d2 log p / df2, (n,)
    a         K^-1 f at the mode, where it equals u
    B         I + W^1/2 K W^1/2 = L L'
    theta     log length-scales (d,), then log s2

    log p(s | X, theta) = -1/2 a' f + log p(s | f) - sum log L_ii     Rasmussen and Williams 2006, algorithm 3.1
The binomial coefficients, which do not depend on theta, are left out.
"""

from math import erfc, exp, inf, log, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.numerics.cholesky import cholesky
from surehold.optimization.numerics.triangular import solve_lower, solve_lower_transposed
from surehold.optimization.surrogates.gaussian_process.likelihood import data_covariance
from surehold.store.kernels import njit

__all__ = ["Counts", "compared_covariance", "laplace", "log_posterior"]

_NEWTON: Final = 50  # steps at most; six are usual
_HALVINGS: Final = 30
_CONVERGED: Final = 1e-10
_LOG_SQRT_2PI: Final = 0.5 * log(2.0 * pi)
_LARGEST: Final = 30.0  # |theta| beyond this is outside every useful scale


class Counts(NamedTuple):
    """What the density of the hyperparameters depends on; plain arrays and numbers for compiled code."""

    X: NDArray[np.float64]
    """inputs, (n, d), C-contiguous"""
    successes: NDArray[np.float64]
    """s, (n,)"""
    trials: NDArray[np.float64]
    """r, (n,)"""
    prior_mean: NDArray[np.float64]
    """mean of the normal prior of each hyperparameter, (d + 1,)"""
    prior_deviation: NDArray[np.float64]
    """its standard deviation, (d + 1,)"""
    ratio: float
    """nugget as a fraction of s2"""
    mean_variance: float
    """m2, prior variance of the constant mean"""
    kernel: int
    """number of the kernel"""
    pairs: NDArray[np.int64]
    """rows of X that were compared, (n, 2), success being that the first was preferred; (0, 2) where s is at each X"""


@njit(cache=True)
def _log_phi(z):
    """Return log Phi(z)."""
    if z > -30.0:
        return log(0.5 * erfc(-z / sqrt(2.0)))
    t = 1.0 / (z * z)  # Abramowitz and Stegun 26.2.12
    return -0.5 * z * z - log(-z) - _LOG_SQRT_2PI + log(1.0 - t * (1.0 - 3.0 * t * (1.0 - 5.0 * t)))


@njit(cache=True)
def _likelihood(f, successes, trials, u, W):
    """Return log p(s | f), and fill u and W (n,)."""
    total = 0.0
    for i in range(f.size):
        s, miss = successes[i], trials[i] - successes[i]
        above, below = _log_phi(f[i]), _log_phi(-f[i])
        density = -0.5 * f[i] * f[i] - _LOG_SQRT_2PI
        up, down = exp(density - above), exp(density - below)
        total += s * above + miss * below
        u[i] = s * up - miss * down
        W[i] = s * up * (up + f[i]) + miss * down * (down - f[i])
        W[i] = max(W[i], 1e-12)  # rounding, far from 0
    return total


@njit(cache=True)
def _times(K, b, out):
    """Fill `out` (n,) with K b for a full K (n, n)."""
    for i in range(b.size):
        t = 0.0
        row = K[i]
        for k in range(b.size):
            t += row[k] * b[k]
        out[i] = t


@njit(cache=True)
def _factor(K, W, L):
    """Fill the lower triangle of L (n, n) with the Cholesky factor of B."""
    for i in range(W.size):
        for k in range(i):
            L[i, k] = sqrt(W[i] * W[k]) * K[i, k]
        L[i, i] = 1.0 + W[i] * K[i, i]
    return cholesky(L)


@njit(cache=True)
def laplace(K, successes, trials, a, W, L):
    """Fill a, W (n,) and the lower triangle of L (n, n) at the mode, given a full K (n, n); return the log evidence.

    Newton steps are halved where they would lower the posterior density. -inf where B could not be factorized.
    """
    n = successes.size
    f, u, b = np.zeros(n), np.empty(n), np.empty(n)
    step, moved, c = np.empty(n), np.empty(n), np.empty(n)
    a[:] = 0.0
    value = _likelihood(f, successes, trials, u, W)
    for _ in range(_NEWTON):
        if not _factor(K, W, L):
            return -inf
        for i in range(n):
            b[i] = W[i] * f[i] + u[i]
        _times(K, b, c)
        for i in range(n):
            c[i] *= sqrt(W[i])
        solve_lower(L, c)
        solve_lower_transposed(L, c)
        for i in range(n):
            step[i] = b[i] - sqrt(W[i]) * c[i] - a[i]
        _times(K, step, moved)
        size, proposed = 1.0, -inf
        for _ in range(_HALVINGS):
            proposed = 0.0
            for i in range(n):
                c[i] = f[i] + size * moved[i]
                proposed -= 0.5 * c[i] * (a[i] + size * step[i])
            proposed += _likelihood(c, successes, trials, u, W)
            if proposed >= value:
                break
            size *= 0.5
        if not proposed >= value:  # at the mode, to the last bit
            _likelihood(f, successes, trials, u, W)
            break
        for i in range(n):
            a[i] += size * step[i]
            f[i] = c[i]
        gain = proposed - value
        value = proposed
        if gain < _CONVERGED:
            break
    if not _factor(K, W, L):
        return -inf
    for i in range(n):
        value -= log(L[i, i])
    return value


@njit(cache=True)
def prior_covariance(theta, counts, K):
    """Fill K (n, n), both triangles."""
    d = counts.X.shape[1]
    n = counts.X.shape[0]
    inverse_l = np.exp(-theta[:d])
    s2 = exp(theta[d])
    data_covariance(counts.X, np.zeros(n), inverse_l, s2, 0.0, counts.ratio, counts.mean_variance, counts.kernel, K)
    for i in range(n):
        for k in range(i):
            K[k, i] = K[i, k]


@njit(cache=True)
def compared_covariance(K, pairs):
    """Return the covariance (p, p) of the differences over root 2 of pairs (p, 2), given that of f, K (n, n)."""
    p = pairs.shape[0]
    G = np.empty((p, p))
    for i in range(p):
        a, b = pairs[i, 0], pairs[i, 1]
        for k in range(p):
            c, d = pairs[k, 0], pairs[k, 1]
            G[i, k] = 0.5 * (K[a, c] - K[a, d] - K[b, c] + K[b, d])
    return G


@njit(cache=True)
def log_posterior(theta, counts):
    """Return the approximate log evidence plus the log prior of theta, up to a constant."""
    value = 0.0
    for i in range(theta.size):
        if not abs(theta[i]) < _LARGEST:
            return -inf
        z = (theta[i] - counts.prior_mean[i]) / counts.prior_deviation[i]
        value -= 0.5 * z * z
    n = counts.X.shape[0]
    K = np.empty((n, n))
    prior_covariance(theta, counts, K)
    if counts.pairs.shape[0] > 0:
        K = compared_covariance(K, counts.pairs)
    p = K.shape[0]
    return value + laplace(K, counts.successes, counts.trials, np.empty(p), np.empty(p), np.empty((p, p)))

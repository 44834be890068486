"""The density of a local-global process' hyperparameters, and the prior moments of weighted sums (compiled).

Legend as in `model`; w_g, w_l have the standard deviations `WIDE` and `NARROW`.
"""

from math import exp, inf, log, pi, sqrt
from typing import Final

import numpy as np

from surehold.optimization.numerics.cholesky import cholesky
from surehold.optimization.numerics.triangular import solve_lower
from surehold.optimization.surrogates.gaussian_process.kernels import (
    correlation_and_factor,
    correlations,
    transposed,
    triangle,
)
from surehold.store.kernels import njit

__all__ = ["MATERN52", "NARROW", "WIDE", "fill_prior", "fill_shares", "log_posterior"]

WIDE: Final = 10.0  #: of the global process' density around the middle [box widths]
NARROW: Final = 0.05  #: of the local one's around its center
MATERN52: Final = 0  #: number of the kernel
_LARGEST: Final = 60.0


@njit(cache=True)
def _log_odds(x, c):
    """Return log(w_l / w_g) at x (d,)."""
    total = x.size * log(WIDE / NARROW)
    for k in range(x.size):
        total += 0.5 * ((x[k] - 0.5) / WIDE) ** 2 - 0.5 * ((x[k] - c[k]) / NARROW) ** 2
    return total


@njit(cache=True)
def fill_shares(X, c, out):
    """Fill out (2, n) with lam_g and lam_l at X (n, d)."""
    for i in range(X.shape[0]):
        log_odds = _log_odds(X[i], c)
        odds = exp(-abs(log_odds))
        small, large = sqrt(odds / (1.0 + odds)), sqrt(1.0 / (1.0 + odds))
        out[0, i], out[1, i] = (large, small) if log_odds < 0.0 else (small, large)


@njit(cache=True)
def fill_prior(points, tilt, weights, inverse_l, center, variance, slope):
    """Fill variance (q,) and, where it has room, slope (q, d) with those of weighted sums at points (q, s, d); s2 = 1.

    tilt (q, s, d) are the derivatives of the points' coordinates by the query's.
    """
    q, s, d = points.shape
    C, F = np.empty((s, s)), np.empty((s, s))
    shares = np.empty((2, s))
    for i in range(q):
        P = points[i]
        fill_shares(P, center, shares)
        variance[i] = 0.0
        for j in range(2):
            correlation_and_factor(MATERN52, P, P, inverse_l[j], C, F)
            sign = 0.5 if j == 1 else -0.5
            for a in range(s):
                for b in range(s):
                    both = weights[a] * weights[b] * shares[j, a] * shares[j, b]
                    variance[i] += both * C[a, b]
                    if slope.shape[0] > 0:
                        other = shares[1 - j, a] * shares[1 - j, a]
                        for k in range(d):
                            log_odds = (P[a, k] - 0.5) / WIDE**2 - (P[a, k] - center[k]) / NARROW**2
                            step = (P[a, k] - P[b, k]) * inverse_l[j, k] ** 2
                            change = sign * other * log_odds * C[a, b] - F[a, b] * step
                            slope[i, k] += 2.0 * both * change * tilt[i, a, k]


@njit(cache=True)
def log_posterior(theta, evidence):
    """Return the log posterior density of theta (3 d + 1,), up to a constant."""
    n, d = evidence.X.shape
    value = 0.0
    for i in range(theta.size):
        if not abs(theta[i]) < _LARGEST:
            return -inf
        if i > 2 * d:
            if theta[i] < 0.0 or theta[i] > 1.0:
                return -inf
        else:
            value -= 0.5 * ((theta[i] - evidence.prior_mean[i]) / evidence.prior_deviation[i]) ** 2
    c = theta[2 * d + 1 :]
    s2 = exp(theta[2 * d])
    Z = transposed(evidence.X)
    starts = triangle(n)
    wide, local = np.empty(starts[n]), np.empty(starts[n])
    correlations(evidence.kernel, evidence.X, Z, np.exp(-theta[:d]), starts, wide, wide[:0])
    correlations(evidence.kernel, evidence.X, Z, np.exp(-theta[d : 2 * d]), starts, local, local[:0])
    A = np.empty((n, n))
    shares = np.empty((2, n))
    fill_shares(evidence.X, c, shares)
    for i in range(n):
        for j in range(i):
            pair = starts[i] + j
            A[i, j] = s2 * (shares[0, i] * shares[0, j] * wide[pair] + shares[1, i] * shares[1, j] * local[pair])
        A[i, i] = s2 * (1.0 + evidence.ratio) + evidence.noise[i]
    if not cholesky(A):
        return -inf
    z = evidence.y.copy()
    solve_lower(A, z)
    for i in range(n):
        value -= 0.5 * z[i] * z[i] + log(A[i, i]) + 0.5 * log(2.0 * pi)
    return value

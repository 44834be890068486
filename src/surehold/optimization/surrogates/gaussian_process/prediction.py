"""Means, variances and draws of Gaussian processes at new points, one process a particle (compiled).

Legend (the thesis' symbols in brackets)
    X, y       trials: inputs (n, d) in the unit cube, outputs (n,)
    theta_j    particle j of m: log length-scales, log signal variance, log noise variance    [theta_1..theta_m]
    k_j        covariance of the query with X under particle j, (n,)
    A_j        covariance of the data under particle j, (n, n) = L_j L_j'
    mean_j     k_j' A_j^-1 y                                                                   thesis (3.5)
    variance_j k_j(x, x) - k_j' A_j^-1 k_j                                                     thesis (3.6)

A weighted sum of function values, sum_i w_i f(x + xi_i), is itself Gaussian under each particle: its covariance with
the data is sum_i w_i k_j(x + xi_i, X) and its prior variance sum_ij w_i w_j k_j(xi_i, xi_j). With one offset of 0 that
is f(x) itself, so one compiled function serves both. The prior variance hangs on the perturbations alone: whoever asks
for many queries computes it once.
"""

import numpy as np

from surehold.optimization.numerics.cholesky import cholesky
from surehold.optimization.numerics.products import product
from surehold.optimization.numerics.triangular import (
    invert_lower,
    solve_lower,
    solve_lower_transposed,
    times_lower,
    times_lower_transposed,
)
from surehold.optimization.surrogates.gaussian_process.kernels import (
    along,
    correlations,
    cross_correlation,
    rectangle,
    transposed,
    triangle,
)
from surehold.optimization.surrogates.gaussian_process.likelihood import data_covariance
from surehold.store.kernels import njit

__all__ = ["add", "average", "factorize", "means", "prior_variance", "sample", "slopes_along"]

_LARGEST_REPAIR = 1e-2  # nugget ratio beyond which a factorization is given up
_ALIKE = 1e-12  # box widths between perturbations that differ by rounding only
_TOGETHER = 4096  # correlations, about, that go through the exponential together: a core's nearest memory holds them
_REPAIRS = 12  # nuggets that are tried for a draw, each ten times the one before: NaN is never factorized


@njit(cache=True)
def factorize(X, Y, noise, inverse_l, s2, v, ratio, mean_variance, kernel, inverse_L, alpha):
    """Fill inverse_L (m, n, n) and alpha (m, n) = A^-1 y_j; return how many nuggets were enlarged, -1 on failure."""
    m, n = Y.shape
    repaired = 0
    A = np.empty((n, n))
    for j in range(m):
        nugget = ratio
        while True:
            data_covariance(X, noise, inverse_l[j], s2[j], v[j], nugget, mean_variance, kernel, A)
            if cholesky(A):
                break
            nugget = max(10.0 * nugget, 1e-12)
            if nugget > _LARGEST_REPAIR:
                return -1
        if nugget > ratio:
            repaired += 1
        for i in range(n):  # an assignment of arrays takes two seconds to compile
            alpha[j, i] = Y[j, i]
        solve_lower(A, alpha[j])
        solve_lower_transposed(A, alpha[j])
        invert_lower(A, inverse_L[j])
    return repaired


@njit(cache=True, fastmath={"contract"})
def add(rows, factors, sums):
    """Add factors (s,) times rows (s, n) to sums (n,), one row after the other."""
    s = factors.size
    whole = s - s % 4
    for w in range(0, whole, 4):  # four rows at a time load and store the sums a quarter as often
        t, u, v, z = factors[w : w + 4]
        for a in range(sums.size):
            sums[a] = (((sums[a] + t * rows[w, a]) + u * rows[w + 1, a]) + v * rows[w + 2, a]) + z * rows[w + 3, a]
    for w in range(whole, s):
        t = factors[w]
        for a in range(sums.size):
            sums[a] += t * rows[w, a]


@njit(cache=True, fastmath={"reassoc", "contract"})
def slopes_along(factor, z, row, first, second):
    """Return the sums over trials a of -g_a (z - row_a) times first (n,), and times second (n,).

    factor (n,) are the factors g of a dimension, z is that coordinate of the point, row (n,) that of the trials.
    """
    t = u = 0.0
    for a in range(factor.size):
        step = row[a] - z
        slope = factor[a] * step
        t += slope * first[a]
        u += slope * second[a]
    return t, u


@njit(cache=True)
def prior_variance(offsets, slopes, weights, inverse_l, s2, mean_variance, kernel, gradient):
    """Return the prior variance (m, b) of the weighted sums and its gradient (m, b, d), for offsets, slopes (b, s, d).

    Of each pair of perturbations one order is computed: they are as many as s (s + 1) / 2.
    """
    m = inverse_l.shape[0]
    b, s, d = offsets.shape
    variance = np.empty((m, b))
    variance_gradient = np.zeros((m, b if gradient else 0, d))
    starts = triangle(s)
    own = np.empty(starts[s])
    factor = np.empty(starts[s] if gradient else 0)
    room = np.empty(factor.size)
    for i in range(b):
        xi = offsets[i]
        Z = transposed(xi)
        for j in range(m):
            correlations(kernel, xi, Z, inverse_l[j], starts, own, factor)
            prior = 0.0
            for w in range(s):
                for o in range(s):
                    c = own[starts[max(w, o)] + min(w, o)]
                    prior += weights[w] * weights[o] * (s2[j] * c + mean_variance)
            variance[j, i] = prior
            if gradient:
                for k in range(d):
                    g = along(kernel, xi, Z, inverse_l[j], k, starts, factor, room)
                    t = 0.0
                    for w in range(s):
                        for o in range(w):
                            step = (xi[w, k] - xi[o, k]) * (slopes[i, w, k] - slopes[i, o, k])
                            t -= 2.0 * weights[w] * weights[o] * g[starts[w] + o] * step
                    variance_gradient[j, i, k] = s2[j] * t * inverse_l[j, k] ** 2
    return variance, variance_gradient


@njit(cache=True)
def _queries_together(q, size):
    """Return how many of q queries, each of `size` correlations, go through the exponential together: one or more."""
    return max(1, min(q, _TOGETHER // max(1, size)))


@njit(cache=True)
def average(Q, offsets, slopes, weights, prior, X, inverse_l, s2, mean_variance, kernel, inverse_L, alpha, gradient):
    """Return mean, variance (m, q) and their gradients (m, q, d) of the weighted sums at Q (q, d).

    offsets (b, s, d): the same perturbations for every query (b = 1) or its own for each (b = q); slopes (b, s, d):
    derivative of each coordinate of query + offset by that coordinate of the query; prior: `prior_variance` of these.
    """
    m, n = alpha.shape
    q, d = Q.shape
    s = weights.size
    last = offsets.shape[0] - 1
    points = np.empty((q * s, d))
    for i in range(q):
        for w in range(s):
            for k in range(d):
                points[i * s + w, k] = Q[i, k] + offsets[min(i, last), w, k]
    Z = transposed(X)
    mean = np.empty((m, q))
    variance = np.empty((m, q))
    mean_gradient = np.zeros((m, q if gradient else 0, d))
    variance_gradient = np.zeros((m, q if gradient else 0, d))
    size = s * n
    together = _queries_together(q, size)
    starts = rectangle(together * s, n)
    C = np.empty(together * size)
    F = np.empty(q * size if gradient else 0)
    K, V = np.empty((q, n)), np.empty((q, n))
    W = np.empty((q if gradient else 0, n))
    shift = mean_variance * weights.sum()
    for j in range(m):
        for i in range(q):
            variance[j, i] = prior[0][j, min(i, last)]
            if gradient:
                for k in range(d):
                    variance_gradient[j, i, k] = prior[1][j, min(i, last), k]
        K[:] = shift
        factors = s2[j] * weights
        for first in range(0, q, together):
            end = min(first + together, q)
            P, part, radial = points[first * s : end * s], C[: (end - first) * size], F[first * size : end * size]
            correlations(kernel, P, Z, inverse_l[j], starts, part, radial)
            rows = part.reshape((end - first, s, n))
            for i in range(first, end):
                add(rows[i - first], factors, K[i])
        times_lower(inverse_L[j], K, V)
        for i in range(q):
            mean[j, i] = product(alpha[j], K[i], n)
            variance[j, i] -= product(V[i], V[i], n)
        if gradient:
            times_lower_transposed(inverse_L[j], V, W)
            for first in range(0, q, together):
                end = min(first + together, q)
                P, part, radial = points[first * s : end * s], C[: (end - first) * size], F[first * size : end * size]
                for k in range(d):
                    g = along(kernel, P, Z, inverse_l[j], k, starts, radial, part).reshape((end - first, s, n))
                    for i in range(first, end):
                        for w in range(s):
                            t, u = slopes_along(g[i - first, w], points[i * s + w, k], Z[k], alpha[j], W[i])
                            rate = s2[j] * inverse_l[j, k] ** 2 * weights[w] * slopes[min(i, last), w, k]
                            mean_gradient[j, i, k] += rate * t
                            variance_gradient[j, i, k] -= 2.0 * rate * u
    return mean, np.maximum(variance, 0.0), mean_gradient, variance_gradient


@njit(cache=True)
def means(Q, X, inverse_l, s2, mean_variance, kernel, alpha):
    """Return the means (m, q) at Q (q, d): a variance takes n times as long."""
    m, n = alpha.shape
    Z = transposed(X)
    q = len(Q)
    result = np.empty((m, q))
    together = _queries_together(q, n)
    starts = rectangle(together, n)
    C = np.empty(together * n)
    for j in range(m):
        level = mean_variance * alpha[j].sum()
        for first in range(0, q, together):
            end = min(first + together, q)
            part = C[: (end - first) * n]
            correlations(kernel, Q[first:end], Z, inverse_l[j], starts, part, part[:0])
            rows = part.reshape((end - first, n))
            for i in range(first, end):
                result[j, i] = level + s2[j] * product(alpha[j], rows[i - first], n)
    return result


@njit(cache=True)
def sample(P, normals, X, inverse_l, s2, mean_variance, kernel, inverse_L, alpha):
    """Return joint draws (m, q, b, s) of f at the points P (q, s, d), from standard normals (b, s).

    NaN where the points' covariance cannot be factorized. Before any trial, points that lie to each other as those of
    the first query do have its covariance.
    """
    m, n = alpha.shape
    q, s, d = P.shape
    draws = np.empty((m, q, normals.shape[0], s))
    if q == 0:
        return draws
    alike = np.empty(q, dtype=np.bool_)
    for i in range(q):
        apart = 0.0
        for w in range(s):
            for k in range(d):
                apart = max(apart, abs((P[i, w, k] - P[i, 0, k]) - (P[0, w, k] - P[0, 0, k])))
        alike[i] = apart < _ALIKE
    K = np.empty((n, s))
    first = np.empty((s, s))
    C = np.empty((s, s))
    for j in range(m):
        cross_correlation(kernel, P[0], P[0], inverse_l[j], first)
        for i in range(q):
            cross_correlation(kernel, X, P[i], inverse_l[j], K)
            for a in range(n):
                for w in range(s):
                    K[a, w] = s2[j] * K[a, w] + mean_variance
            V = np.dot(inverse_L[j], K)
            if alike[i]:
                C[:] = first
            else:
                cross_correlation(kernel, P[i], P[i], inverse_l[j], C)
            for w in range(s):
                for o in range(s):
                    C[w, o] = s2[j] * C[w, o] + mean_variance
            C -= np.dot(V.T, V)
            nugget = 1e-10 * (s2[j] + mean_variance)
            root = C.copy()
            for _ in range(_REPAIRS):
                for w in range(s):
                    for o in range(w + 1):
                        root[w, o] = C[w, o]
                    root[w, w] += nugget
                if cholesky(root):
                    break
                nugget *= 10.0
            else:
                root[:] = np.nan
            for w in range(s):
                root[w, w + 1 :] = 0.0
            draws[j, i] = np.dot(alpha[j], K) + np.dot(normals, root.T)
    return draws

"""Averages over points that are answered from their neighborhoods, not from all trials (compiled).

Legend
    A_g     covariance of the trials of neighborhood g, under one particle; A that of the trials of any of them
    w_i     weight of point p_i of an average, which neighborhood g(i) answers
    K_g     sum of w_i k(p_i, .) over the points of g, at the trials of g
    c       sum of w_i k(p_i, .) over all points, at the trials of any neighborhood
    W       weights of the trials: the sum over g of A_g^-1 K_g, each at the places of the trials of g

The mean is W' y. The variance is that of the error of just this estimate, p - 2 W' c + W' A W with the prior variance
p: correlations between neighborhoods are in it, and it is never below the one given all trials, for no estimate errs
less than that from all of them. With one neighborhood W = A^-1 c, and it is p - c' A^-1 c as usual.
"""

import numpy as np

from surehold.optimization.numerics.products import product
from surehold.optimization.numerics.triangular import times_lower, times_lower_transposed
from surehold.optimization.surrogates.gaussian_process.kernels import (
    along,
    correlations,
    rectangle,
    transposed,
    triangle,
)
from surehold.optimization.surrogates.gaussian_process.neighborhoods import gathered
from surehold.optimization.surrogates.gaussian_process.prediction import add, average, factorize, slopes_along
from surehold.store.kernels import njit

__all__ = ["average_by_groups", "average_by_neighbors"]


@njit(cache=True)
def average_by_neighbors(
    Q,
    offsets,
    slopes,
    weights,
    prior,
    X,
    Y,
    noise,
    inverse_l,
    s2,
    v,
    ratio,
    mean_variance,
    kernel,
    rows,
    counts,
    gradient,
):
    """Return what `prediction.average` does, each query given the trials of its row alone; NaN on failure."""
    m = Y.shape[0]
    q, d = Q.shape
    mean = np.empty((m, q))
    variance = np.empty((m, q))
    mean_gradient = np.empty((m, q if gradient else 0, d))
    variance_gradient = np.empty((m, q if gradient else 0, d))
    last = offsets.shape[0] - 1
    for i in range(q):
        k = counts[i]
        near, values, loud = gathered(rows[i, :k], X, Y, noise)
        inverse_L = np.empty((m, k, k))
        alpha = np.empty((m, k))
        if factorize(near, values, loud, inverse_l, s2, v, ratio, mean_variance, kernel, inverse_L, alpha) < 0:
            mean[:] = np.nan
            return mean, variance, mean_gradient, variance_gradient
        b = min(i, last)
        one_mean, one_variance, by_mean, by_variance = average(
            Q[i : i + 1],
            offsets[b : b + 1],
            slopes[b : b + 1],
            weights,
            (prior[0][:, b : b + 1], prior[1][:, b : b + 1]),
            near,
            inverse_l,
            s2,
            mean_variance,
            kernel,
            inverse_L,
            alpha,
            gradient,
        )
        for j in range(m):
            mean[j, i] = one_mean[j, 0]
            variance[j, i] = one_variance[j, 0]
            if gradient:
                for c in range(d):
                    mean_gradient[j, i, c] = by_mean[j, 0, c]
                    variance_gradient[j, i, c] = by_variance[j, 0, c]
    return mean, variance, mean_gradient, variance_gradient


@njit(cache=True, fastmath={"reassoc", "contract"})
def _symmetric(row, a, s2, shift, W, product_with):
    """Add row and column a of the covariance s2 row (a,) + shift, without its diagonal, times W to product_with."""
    t = 0.0
    for b in range(a):
        c = s2 * row[b] + shift
        t += c * W[b]
        product_with[b] += c * W[a]
    product_with[a] += t


@njit(cache=True)
def _inverse_times(inverse_L, k, K, V, out):
    """Fill the first k of `out` (1, n) with A_g^-1 times the first k of K (1, n); inverse_L (k k,) is of A_g."""
    T = inverse_L[: k * k].reshape((k, k))
    times_lower(T, K[:, :k].copy(), V)
    times_lower_transposed(T, V, out)


@njit(cache=True)
def average_by_groups(
    Q,
    offsets,
    slopes,
    weights,
    prior,
    X,
    Y,
    noise,
    inverse_l,
    s2,
    v,
    ratio,
    mean_variance,
    kernel,
    rows,
    counts,
    groups,
    anchors,
    others,
    gradient,
):
    """Return what `average_by_neighbors` does, points being answered by the neighborhoods of their groups.

    groups (q, s) and anchors (q, g - 1) are `Shares`; others: rows, counts, slots, inverse factors and alpha of
    `Neighborhoods`.
    """
    their_rows, their_counts, slots, inverse_Ls, alphas = others
    m, n = Y.shape
    q, d = Q.shape
    s = weights.size
    width = max(rows.shape[1], their_rows.shape[1])
    most = 1 + anchors.shape[1]
    mean = np.empty((m, q))
    variance = np.empty((m, q))
    mean_gradient = np.zeros((m, q if gradient else 0, d))
    variance_gradient = np.zeros((m, q if gradient else 0, d))
    last = offsets.shape[0] - 1
    place = np.full(n, -1)
    trials = np.empty(most * width, dtype=np.int64)
    index = np.empty((most, width), dtype=np.int64)
    sizes = np.empty(most, dtype=np.int64)
    points = np.empty((s, d))
    shift = mean_variance * weights.sum()
    for i in range(q):
        b = min(i, last)
        for w in range(s):
            for k in range(d):
                points[w, k] = Q[i, k] + offsets[b, w, k]
        g = 0
        size = 0
        while g < most and (g == 0 or anchors[i, g - 1] >= 0):
            row = rows[i] if g == 0 else their_rows[anchors[i, g - 1]]
            sizes[g] = counts[i] if g == 0 else their_counts[anchors[i, g - 1]]
            for a in range(sizes[g]):
                if place[row[a]] < 0:
                    place[row[a]] = size
                    trials[size] = row[a]
                    size += 1
                index[g, a] = place[row[a]]
            g += 1
        for a in range(size):
            place[trials[a]] = -1
        own_size = counts[i]
        near, values, loud = gathered(rows[i, :own_size], X, Y, noise)
        inverse_L = np.empty((m, own_size, own_size))
        alpha = np.empty((m, own_size))
        if factorize(near, values, loud, inverse_l, s2, v, ratio, mean_variance, kernel, inverse_L, alpha) < 0:
            mean[:] = np.nan
            return mean, variance, mean_gradient, variance_gradient
        U, _, heard = gathered(trials[:size], X, Y[:0], noise)
        Z = transposed(U)
        starts, triangular = rectangle(s, size), triangle(size)
        C, pairs = np.empty(s * size), np.empty(triangular[size])
        F = np.empty(s * size if gradient else 0)
        rows_of_points = C.reshape((s, size))
        K = np.empty((g, 1, width))
        c_all, W, AW = np.empty(size), np.empty(size), np.empty(size)
        first = np.empty((g, size))
        second = np.empty((g, size))
        for j in range(m):
            K[:] = 0.0
            c_all[:] = shift
            correlations(kernel, points, Z, inverse_l[j], starts, C, F)
            add(rows_of_points, s2[j] * weights, c_all)
            for w in range(s):
                h = groups[i, w]
                for a in range(sizes[h]):
                    K[h, 0, a] += weights[w] * (s2[j] * rows_of_points[w, index[h, a]] + mean_variance)
            W[:] = 0.0
            total = 0.0
            for h in range(g):
                k = sizes[h]
                slot = 0 if h == 0 else slots[anchors[i, h - 1]]
                T = inverse_L[j].reshape(k * k) if h == 0 else inverse_Ls[slot, j]
                solution = alpha[j] if h == 0 else alphas[slot, j]
                V, out = np.empty((1, k)), np.empty((1, k))
                _inverse_times(T, k, K[h], V, out)
                total += product(solution, K[h, 0], k)
                for a in range(k):
                    W[index[h, a]] += out[0, a]
                if gradient:
                    first[h, :] = 0.0
                    for a in range(k):
                        first[h, index[h, a]] = solution[a]
            mean[j, i] = total
            for a in range(size):
                AW[a] = (s2[j] * (1.0 + ratio) + mean_variance + heard[a] + v[j]) * W[a]
            correlations(kernel, U, Z, inverse_l[j], triangular, pairs, pairs[:0])
            for a in range(size):
                _symmetric(pairs[triangular[a] :], a, s2[j], mean_variance, W, AW)
            variance[j, i] = prior[0][j, b] - 2.0 * product(W, c_all, size) + product(W, AW, size)
            if gradient:
                for h in range(g):
                    k = sizes[h]
                    for a in range(k):  # of the weights, too, the points decide: what is not explained yet counts
                        K[h, 0, a] = c_all[index[h, a]] - AW[index[h, a]]
                    T = inverse_L[j].reshape(k * k) if h == 0 else inverse_Ls[slots[anchors[i, h - 1]], j]
                    V, out = np.empty((1, k)), np.empty((1, k))
                    _inverse_times(T, k, K[h], V, out)
                    for a in range(size):
                        second[h, a] = W[a]
                    for a in range(k):
                        second[h, index[h, a]] += out[0, a]
                for k in range(d):
                    variance_gradient[j, i, k] = prior[1][j, b, k]
                for k in range(d):
                    factors = along(kernel, points, Z, inverse_l[j], k, starts, F, C).reshape((s, size))
                    for w in range(s):
                        h = groups[i, w]
                        t, u = slopes_along(factors[w], points[w, k], Z[k], first[h], second[h])
                        rate = s2[j] * inverse_l[j, k] ** 2 * weights[w] * slopes[b, w, k]
                        mean_gradient[j, i, k] += rate * t
                        variance_gradient[j, i, k] -= 2.0 * rate * u
    return mean, np.maximum(variance, 0.0), mean_gradient, variance_gradient

"""Means and variances of the independent Gaussian processes in the leaves of a tree, all leaves in one call (compiled).

Legend: l leaves with m particles each; s points of a quadrature around each of q queries. Every point is predicted by
the leaf that owns it. Leaves are independent, so the parts of a weighted sum of function values that fall into
different leaves add up, their means and their variances alike.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from surehold.optimization.gaussian_process_posterior import GaussianProcessPosterior
from surehold.optimization.prediction import average

__all__ = ["LeafTable", "average_in_leaves"]


class LeafTable(NamedTuple):
    """What predictions need of all leaves, one after the other in plain arrays."""

    first: NDArray[np.int64]
    """number of the first trial of each leaf, and the number of all: (l + 1,)"""
    X: NDArray[np.float64]
    """trials of the leaves, (N, d)"""
    inverse_l: NDArray[np.float64]
    """(l, m, d)"""
    s2: NDArray[np.float64]
    """(l, m)"""
    factors: NDArray[np.float64]
    """inverse_L (m, n, n) of leaf after leaf"""
    alpha: NDArray[np.float64]
    """alpha (m, n) of leaf after leaf"""
    outputs: NDArray[np.float64]
    """shift and scale of the outputs, and its square, (l, 3)"""
    mean_variance: float
    """prior variance of the constant mean, in standardized outputs"""
    kernel: int

    @classmethod
    def of(cls, leaves: Sequence[GaussianProcessPosterior]) -> "LeafTable":
        """Return the table of the leaves of one tree, whose kernel and mean are the same."""
        sizes = [len(leaf.evidence.X) for leaf in leaves]
        return cls(
            np.cumsum([0, *sizes]),
            np.concatenate([leaf.evidence.X for leaf in leaves]),
            np.array([leaf.hyperparameters.inverse_l for leaf in leaves]),
            np.array([leaf.hyperparameters.s2 for leaf in leaves]),
            np.concatenate([leaf.factors.inverse_L.ravel() for leaf in leaves]),
            np.concatenate([leaf.factors.alpha.ravel() for leaf in leaves]),
            np.array([(leaf.outputs.shift, leaf.outputs.scale, leaf.outputs.square) for leaf in leaves]),
            leaves[0].evidence.mean_variance,
            leaves[0].evidence.kernel,
        )


@njit(cache=True)
def _add_part(rows, columns, leaf, Q, offsets, slopes, weights, table, gradient, sums):
    """Add to `sums` what one leaf contributes to queries `rows`, of which it owns the perturbed points `columns`."""
    first, X, inverse_l, s2, factors, alpha, outputs, mean_variance, kernel = table
    mean, variance, by_mean, by_variance = sums
    m, d = inverse_l.shape[1:]
    q, s = rows.size, columns.size
    b = 1 if len(offsets) == 1 else q
    queries, share = np.empty((q, d)), np.empty(s)
    xi, tilt = np.empty((b, s, d)), np.empty((b, s, d))
    for k in range(d):
        for i in range(q):
            queries[i, k] = Q[rows[i], k]
        for i in range(b):
            source = 0 if len(offsets) == 1 else rows[i]
            for w in range(s):
                xi[i, w, k] = offsets[source, columns[w], k]
                tilt[i, w, k] = slopes[source, columns[w], k]
    for w in range(s):
        share[w] = weights[columns[w]]
    n = first[leaf + 1] - first[leaf]
    begin = 0
    for other in range(leaf):
        begin += m * (first[other + 1] - first[other]) ** 2
    part = average(
        queries,
        xi,
        tilt,
        share,
        X[first[leaf] : first[leaf + 1]],
        inverse_l[leaf],
        s2[leaf],
        mean_variance,
        kernel,
        factors[begin : begin + m * n * n].reshape((m, n, n)),
        alpha[m * first[leaf] : m * first[leaf + 1]].reshape((m, n)),
        gradient,
    )
    shift, scale, square = outputs[leaf, 0] * share.sum(), outputs[leaf, 1], outputs[leaf, 2]
    for j in range(m):
        for i in range(q):
            mean[j, rows[i]] += shift + scale * part[0][j, i]
            variance[j, rows[i]] += square * part[1][j, i]
            if gradient:
                for k in range(d):
                    by_mean[j, rows[i], k] += scale * part[2][j, i, k]
                    by_variance[j, rows[i], k] += square * part[3][j, i, k]


@njit(cache=True)
def average_in_leaves(Q, offsets, slopes, weights, home, table, gradient):
    """Return mean, variance (m, q) and their gradients (m, q, d) of the weighted sums at Q (q, d), in outputs' units.

    offsets, slopes (b, s, d) as in `prediction.average`; home (q, s): the leaf that owns each perturbed point; table: a
    `LeafTable`.
    """
    q, s = home.shape
    leaves, m, d = table[2].shape
    sums = np.zeros((m, q)), np.zeros((m, q)), np.zeros((m, q, d)), np.zeros((m, q, d))
    whole = np.ones(q, np.bool_)  # all of a query's points lie in one leaf
    starts = np.zeros(leaves + 2, np.int64)
    for i in range(q):
        for w in range(1, s):
            whole[i] &= home[i, w] == home[i, 0]
        if whole[i]:
            starts[home[i, 0] + 2] += 1
    for leaf in range(leaves):
        starts[leaf + 2] += starts[leaf + 1]
    rows = np.empty(q, np.int64)  # the whole queries, those of a leaf together
    for i in range(q):
        if whole[i]:
            rows[starts[home[i, 0] + 1]] = i
            starts[home[i, 0] + 1] += 1
    columns = np.arange(s)
    for leaf in range(leaves):
        if starts[leaf + 1] > starts[leaf]:
            members = rows[starts[leaf] : starts[leaf + 1]]
            _add_part(members, columns, leaf, Q, offsets, slopes, weights, table, gradient, sums)
    for i in range(q):
        if whole[i]:
            continue
        rows[0] = i
        for w in range(s):
            owned = 0
            for other in range(s):
                if home[i, other] == home[i, w]:
                    columns[owned] = other
                    owned += 1
            if columns[0] == w:  # once a leaf
                _add_part(rows[:1], columns[:owned], home[i, w], Q, offsets, slopes, weights, table, gradient, sums)
    return sums

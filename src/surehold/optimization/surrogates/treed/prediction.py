"""Means and variances of the independent Gaussian processes in the leaves of a tree, all leaves in one call (compiled).

Legend: l leaves with m particles each; s points of a quadrature around each of q queries. Every point is predicted by
the leaf that owns it. Leaves are independent, so the parts of a weighted sum of function values that fall into
different leaves add up, their means and their variances alike.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.optimization.surrogates.gaussian_process.prediction import average, prior_variance
from surehold.store.kernels import njit

__all__ = ["LeafTable", "average_in_leaves"]


class LeafTable(NamedTuple):
    """What predictions need of all leaves, one after the other in plain arrays."""

    first: NDArray[np.int64]
    """number of the first trial of each leaf, and the number of all: (l + 1,)"""
    X: NDArray[np.float64]
    """trials of the leaves, (N, d)"""
    inverse_l: NDArray[np.float64]
    """(l, m, d), and what else the kernel's scales hold"""
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
def _parts(home, leaves):
    """Return the parts of weighted sums that one leaf contributes: leaf, begins and ends of rows and of columns (p, 5).

    home (q, s): the leaf that owns each perturbed point. Queries whose points all lie in one leaf make one part per
    leaf, other queries one part for each leaf that they touch. Also returned are the rows and columns themselves.
    """
    q, s = home.shape
    parts = np.empty((leaves + q * s, 5), np.int64)
    rows, columns = np.empty(2 * q, np.int64), np.empty((q + 2) * s, np.int64)
    count, row, column = 0, 0, s
    for w in range(s):
        columns[w] = w
    split = np.empty(q, np.bool_)
    for i in range(q):
        split[i] = False
        for w in range(1, s):
            if home[i, w] != home[i, 0]:
                split[i] = True
    for leaf in range(leaves):
        begin = row
        for i in range(q):
            if not split[i] and home[i, 0] == leaf:
                rows[row] = i
                row += 1
        if row > begin:
            _put(parts, count, leaf, begin, row, 0, s)
            count += 1
    for i in range(q):
        if not split[i]:
            continue
        rows[row] = i
        row += 1
        for w in range(s):
            begin = column
            for other in range(s):
                if home[i, other] == home[i, w]:
                    columns[column] = other
                    column += 1
            if columns[begin] == w:
                _put(parts, count, home[i, w], row - 1, row, begin, column)
                count += 1
            else:  # this leaf has its part already
                column = begin
    return parts[:count], rows, columns


@njit(cache=True)
def _put(parts, count, leaf, row, rows, column, columns):
    parts[count, 0], parts[count, 1], parts[count, 2] = leaf, row, rows
    parts[count, 3], parts[count, 4] = column, columns


@njit(cache=True)
def average_in_leaves(Q, offsets, slopes, weights, home, table, gradient):
    """Return mean, variance (m, q) and their gradients (m, q, d) of the weighted sums at Q (q, d), in outputs' units.

    offsets, slopes (b, s, d) as in `prediction.average`; home (q, s): the leaf that owns each perturbed point; table: a
    `LeafTable`.
    """
    first, X, inverse_l, s2, factors, alpha, outputs, mean_variance, kernel = table
    leaves, m, _ = inverse_l.shape
    d = X.shape[1]
    total = len(Q)
    mean, variance = np.zeros((m, total)), np.zeros((m, total))
    by_mean, by_variance = np.zeros((m, total, d)), np.zeros((m, total, d))
    begins = np.zeros(leaves + 1, np.int64)  # of the leaves' factors
    for leaf in range(leaves):
        begins[leaf + 1] = begins[leaf] + m * (first[leaf + 1] - first[leaf]) ** 2
    parts, all_rows, all_columns = _parts(home, leaves)
    for p in range(len(parts)):
        leaf = parts[p, 0]
        rows, columns = all_rows[parts[p, 1] : parts[p, 2]], all_columns[parts[p, 3] : parts[p, 4]]
        q, s, n = rows.size, columns.size, first[leaf + 1] - first[leaf]
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
        owned = 0.0
        for w in range(s):
            share[w] = weights[columns[w]]
            owned += share[w]
        shift, scale, square = owned * outputs[leaf, 0], outputs[leaf, 1], outputs[leaf, 2]
        part = average(
            queries,
            xi,
            tilt,
            share,
            prior_variance(xi, tilt, share, inverse_l[leaf], s2[leaf], mean_variance, kernel, gradient),
            X[first[leaf] : first[leaf + 1]],
            inverse_l[leaf],
            s2[leaf],
            mean_variance,
            kernel,
            factors[begins[leaf] : begins[leaf + 1]].reshape((m, n, n)),
            alpha[m * first[leaf] : m * first[leaf + 1]].reshape((m, n)),
            gradient,
        )
        for j in range(m):
            for i in range(q):
                mean[j, rows[i]] += shift + scale * part[0][j, i]
                variance[j, rows[i]] += square * part[1][j, i]
                if gradient:
                    for k in range(d):
                        by_mean[j, rows[i], k] += scale * part[2][j, i, k]
                        by_variance[j, rows[i], k] += square * part[3][j, i, k]
    return mean, variance, by_mean, by_variance

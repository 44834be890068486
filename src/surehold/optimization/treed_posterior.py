"""A treed Gaussian process conditioned on trials: independent processes in the leaves of a tree.

Legend
    l   leaves, each with a Gaussian process of its own; m particles in every one
    s   points of a quadrature around each of q queries
Particle j of the whole is particle j of every leaf. Leaves are independent, so the parts of a weighted sum of function
values that fall into different leaves add up, their means and their variances alike.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.gaussian_process_posterior import GaussianProcessPosterior
from surehold.optimization.partition import Partition
from surehold.optimization.surrogate import FitDiagnostics, Moments, PartitionSummary, Regions

__all__ = ["AveragedTrees", "TreedPosterior"]


class TreedPosterior:
    """Gaussian processes in the leaves of a tree. Built by `TreedGaussianProcess.condition`."""

    def __init__(self, partition: Partition, leaves: tuple[GaussianProcessPosterior, ...], n: int):
        self.partition: Final = partition
        self.leaves: Final = leaves
        self.regions: Final = Regions(partition.lower, partition.upper)
        split = partition.nodes[0].split
        self.diagnostics: Final = FitDiagnostics(
            n,
            sum(leaf.diagnostics.evaluations for leaf in leaves),
            sum(leaf.diagnostics.repaired for leaf in leaves),
            all(leaf.diagnostics.flat for leaf in leaves),
            PartitionSummary(len(leaves), partition.depth, None if split is None else (split[0], split[1])),
        )

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(query + offsets[i]) for queries (q, d).

        Each perturbed point is predicted by the leaf that owns it. offsets are (s, d), or (q, s, d) where each query
        has its own; slopes, of the same shape and 1 by default, are the derivatives of query + offset by the query,
        coordinate by coordinate.
        """
        if len(self.leaves) == 1:
            return self.leaves[0].average(queries, offsets, weights, gradient, slopes)
        q, d = queries.shape
        points = queries[:, None, :] + offsets
        m = len(self.leaves[0].hyperparameters.theta)
        mean, variance = np.zeros((m, q)), np.zeros((m, q))
        by_mean, by_variance = np.zeros((m, q, d)), np.zeros((m, q, d))
        for rows, leaf, columns in self._pieces(points):
            if len(rows) == q and len(columns) == len(weights):  # all in one leaf
                return self.leaves[leaf].average(queries, offsets, weights, gradient, slopes)
            own = offsets[columns] if offsets.ndim == 2 else offsets[rows][:, columns]
            tilt = slopes
            if slopes is not None:
                tilt = slopes[columns] if slopes.ndim == 2 else slopes[rows][:, columns]
            part = self.leaves[leaf].average(queries[rows], own, weights[columns], gradient, tilt)
            mean[:, rows] += part.mean
            variance[:, rows] += part.variance
            if part.mean_gradient is not None and part.variance_gradient is not None:
                by_mean[:, rows] += part.mean_gradient
                by_variance[:, rows] += part.variance_gradient
        return Moments(mean, variance, by_mean if gradient else None, by_variance if gradient else None)

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f at queries (q, d)."""
        return self.average(queries, np.zeros((1, queries.shape[1])), np.ones(1), gradient)

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s)."""
        m = len(self.leaves[0].hyperparameters.theta)
        draws = np.empty((m, len(points), *normals.shape))
        for rows, leaf, columns in self._pieces(points):
            part = self.leaves[leaf].sample(points[rows][:, columns], normals[:, columns])
            draws[np.ix_(np.arange(m), rows, np.arange(len(normals)), columns)] = part
        return draws

    def thinned(self, count: int, first: int = 0) -> "TreedPosterior":
        """Return the posterior of about `count` of the particles, from number `first` on: a cheaper approximation."""
        return TreedPosterior(
            self.partition, tuple(leaf.thinned(count, first) for leaf in self.leaves), self.diagnostics.observations
        )

    def with_pending(self, X: NDArray[np.float64]) -> "TreedPosterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d), in the leaf that owns it.

        The tree stays as it is.
        """
        home = self.partition.route(X)
        leaves = list(self.leaves)
        for leaf in np.unique(home):
            leaves[leaf] = leaves[leaf].with_pending(X[home == leaf])
        return TreedPosterior(self.partition, tuple(leaves), self.diagnostics.observations)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (q,) at X (q, d), known or learnt, in squared outputs."""
        home = self.partition.route(X)
        variance = np.empty(len(X))
        for leaf in np.unique(home):
            variance[home == leaf] = self.leaves[leaf].noise_variance(X[home == leaf])
        return variance

    def _pieces(self, points: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.intp], int, NDArray[np.intp]]]:
        """Take points (q, s, d) apart: queries (rows) of which the same points (columns) fall into the same leaf."""
        q, s, d = points.shape
        home = self.partition.route(points.reshape(-1, d)).reshape(q, s)
        if (home == home[:, :1]).all():  # no query is split, as ever where inputs are exact
            every = np.arange(s)
            for leaf in np.unique(home[:, 0]):
                yield np.flatnonzero(home[:, 0] == leaf), int(leaf), every
            return
        together = home[:, :, None] == home[:, None, :]  # (q, s, s)
        rows, first = np.nonzero(together.argmax(axis=2) == np.arange(s))  # a query's first point in each of its leaves
        masks, leaves = together[rows, first], home[rows, first]
        keys = np.column_stack([np.packbits(masks, axis=1), leaves[:, None].view(np.uint8).reshape(-1, 8)])
        order = np.lexsort(keys.T)
        new = np.any(keys[order[1:]] != keys[order[:-1]], axis=1)
        for piece in np.split(order, np.flatnonzero(new) + 1):  # the sort is stable: rows ascend
            yield rows[piece], int(leaves[piece[0]]), np.flatnonzero(masks[piece[0]])


class AveragedTrees:
    """Several treed posteriors, equally likely: the jumps at the borders of one tree are softened by the others."""

    def __init__(self, trees: tuple[TreedPosterior, ...]):
        self.trees: Final = trees
        self.regions: Final = trees[0].regions  # of the tree that is not randomized; the others jump elsewhere, by less
        parts = [tree.diagnostics for tree in trees]
        self.diagnostics: Final = parts[0]._replace(
            evaluations=sum(part.evaluations for part in parts), repaired=sum(part.repaired for part in parts)
        )

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(query + offsets[i]), the particles of tree after tree.

        Arguments as in `TreedPosterior.average`.
        """
        parts = [tree.average(queries, offsets, weights, gradient, slopes) for tree in self.trees]
        mean = np.concatenate([part.mean for part in parts])
        variance = np.concatenate([part.variance for part in parts])
        if not gradient:
            return Moments(mean, variance, None, None)
        by_mean, by_variance = (np.concatenate([np.asarray(part[i]) for part in parts]) for i in (2, 3))
        return Moments(mean, variance, by_mean, by_variance)

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f at queries (q, d)."""
        return self.average(queries, np.zeros((1, queries.shape[1])), np.ones(1), gradient)

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s)."""
        return np.concatenate([tree.sample(points, normals) for tree in self.trees])

    def thinned(self, count: int, first: int = 0) -> "AveragedTrees":
        """Return the posterior of about `count` of the particles of every tree, from number `first` on."""
        return AveragedTrees(tuple(tree.thinned(count, first) for tree in self.trees))

    def with_pending(self, X: NDArray[np.float64]) -> "AveragedTrees":
        """Return the posterior as if each particle's own mean had been observed at X (k, d)."""
        return AveragedTrees(tuple(tree.with_pending(X) for tree in self.trees))

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (q,) at X (q, d), known or learnt, in squared outputs."""
        return np.mean([tree.noise_variance(X) for tree in self.trees], axis=0)

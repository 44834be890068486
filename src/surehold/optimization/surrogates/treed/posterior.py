"""A treed Gaussian process conditioned on trials: independent processes in the leaves of a tree.

Legend
    l   leaves, each with a Gaussian process of its own; m particles in every one
    s   points of a quadrature around each of q queries
Particle j of the whole is particle j of every leaf.
"""

from collections.abc import Iterator
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, PartitionSummary, Regions
from surehold.optimization.surrogates.treed.partition import Partition
from surehold.optimization.surrogates.treed.prediction import LeafTable, average_in_leaves

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

    @cached_property
    def _table(self) -> LeafTable:
        return LeafTable.of(self.leaves)

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
        q, d = queries.shape
        shape = (-1, *offsets.shape[-2:])
        home = self.partition.route((queries[:, None, :] + offsets).reshape(-1, d)).reshape(q, -1)
        mean, variance, by_mean, by_variance = average_in_leaves(
            np.ascontiguousarray(queries),
            np.ascontiguousarray(offsets).reshape(shape),
            np.ascontiguousarray(np.ones_like(offsets) if slopes is None else slopes).reshape(shape),
            np.ascontiguousarray(weights),
            home,
            self._table,
            gradient,
        )
        return Moments(mean, variance, by_mean if gradient else None, by_variance if gradient else None)

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f at queries (q, d)."""
        return self.average(queries, np.zeros((1, queries.shape[1])), np.ones(1), gradient)

    def means(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the means (m, q) at queries (q, d), each of the leaf that owns it."""
        home = self.partition.route(queries)
        result = np.empty((len(self.leaves[0].hyperparameters.theta), len(queries)))
        for leaf in np.unique(home):
            result[:, home == leaf] = self.leaves[leaf].means(queries[home == leaf])
        return result

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

    def left_out(self) -> Moments:
        """Return means and variances (m, n) of each trial's value given all others in its leaf.

        The tree stays as it is. A trial on a border is left out of the first leaf that has it.
        """
        m, n = len(self.leaves[0].hyperparameters.theta), self.diagnostics.observations
        mean, variance = np.empty((m, n)), np.empty((m, n))
        for leaf, node in reversed(list(zip(self.leaves, self.partition.leaves, strict=True))):
            part, own = leaf.left_out(), self.partition.nodes[node].members
            mean[:, own], variance[:, own] = part.mean, part.variance
        return Moments(mean, variance, None, None)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (m, q) at X (q, d), known or learnt, in squared outputs."""
        home = self.partition.route(X)
        variance = np.empty((len(self.leaves[0].hyperparameters.theta), len(X)))
        for leaf in np.unique(home):
            variance[:, home == leaf] = self.leaves[leaf].noise_variance(X[home == leaf])
        return variance

    def _pieces(self, points: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.intp], int, NDArray[np.intp]]]:
        """Take points (q, s, d) apart: queries (rows) of which the same points (columns) fall into the same leaf."""
        q, s, d = points.shape
        home = self.partition.route(points.reshape(-1, d)).reshape(q, s)
        whole = (home == home[:, :1]).all(axis=1)
        for leaf in np.unique(home[whole, 0]):
            yield np.flatnonzero(whole & (home[:, 0] == leaf)), int(leaf), np.arange(s)
        for row in np.flatnonzero(~whole):
            for leaf in np.unique(home[row]):
                yield np.array([row]), int(leaf), np.flatnonzero(home[row] == leaf)


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

    def means(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the means (m, q) at queries (q, d)."""
        return np.concatenate([tree.means(queries) for tree in self.trees])

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s)."""
        return np.concatenate([tree.sample(points, normals) for tree in self.trees])

    def thinned(self, count: int, first: int = 0) -> "AveragedTrees":
        """Return the posterior of about `count` of the particles of every tree, from number `first` on.

        A single one is that of one tree, and every tree has its turn: whoever draws one function draws one of all.
        """
        if count == 1:
            turn, tree = divmod(first, len(self.trees))
            return AveragedTrees((self.trees[tree].thinned(1, turn),))
        return AveragedTrees(tuple(tree.thinned(count, first) for tree in self.trees))

    def with_pending(self, X: NDArray[np.float64]) -> "AveragedTrees":
        """Return the posterior as if each particle's own mean had been observed at X (k, d)."""
        return AveragedTrees(tuple(tree.with_pending(X) for tree in self.trees))

    def left_out(self) -> Moments:
        """Return means and variances (m, n) of each trial's value given all others in its leaf."""
        parts = [tree.left_out() for tree in self.trees]
        return Moments(
            np.concatenate([part.mean for part in parts]), np.concatenate([part.variance for part in parts]), None, None
        )

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (m, q) at X (q, d), known or learnt, in squared outputs."""
        return np.concatenate([tree.noise_variance(X) for tree in self.trees])

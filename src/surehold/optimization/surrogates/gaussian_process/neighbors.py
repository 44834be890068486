"""A Gaussian process on many trials: every query is answered from the trials that say most about it.

Legend
    n    trials, k << n those that one query is answered from
    m    particles of the hyperparameters, learnt from a part of the trials

Conditioning on the nearest trials alone leaves out little, for these screen the others (Vecchia 1988; Stein 2002). A
few farther ones belong to them, or the prediction would depend on a small place only (Stein, Chi and Welty 2004): the
nearest of all trials, of every eighth, and of every 64th. Time and memory of a query do not grow with n.

Points of an average that lie beyond the trials near its query are answered from others, near them (`neighborhoods`).
"""

from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import MOST_TIMES_NEIGHBORS, NEIGHBORS, NEIGHBORS_VARIABLES, WITHIN_REACH
from surehold.errors import SureholdError
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence
from surehold.optimization.surrogates.gaussian_process.neighbor_averages import (
    average_by_groups,
    average_by_neighbors,
)
from surehold.optimization.surrogates.gaussian_process.neighborhoods import Neighborhoods, unfactorized
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization
from surehold.optimization.surrogates.gaussian_process.posterior import Hyperparameters
from surehold.optimization.surrogates.gaussian_process.prediction import factorize, prior_variance, sample
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, Regions

__all__ = ["NeighborPosterior"]

_COARSER: Final = 8  # every so manieth trial is in the next coarser set
_SAMPLED: Final = 384  # trials, about, that joint draws are conditioned on
_BLOCK: Final = 32  # queries whose neighborhoods are kept all together
_SMALLEST: Final = 1e-150  # reach of trials that all lie at one place


class NeighborPosterior:
    """A Gaussian process conditioned on many trials; arguments as of `GaussianProcessPosterior`."""

    def __init__(
        self,
        evidence: Evidence,
        theta: NDArray[np.float64],
        outputs: Standardization,
        cost: int,
        Y: NDArray[np.float64] | None = None,
    ):
        from scipy.spatial import KDTree

        m, (n, d) = len(theta), evidence.X.shape
        self.evidence: Final = evidence
        self.outputs: Final = outputs
        self.hyperparameters: Final = Hyperparameters.of(theta, evidence)
        self._Y: Final = np.ascontiguousarray(np.broadcast_to(evidence.y, (m, n)) if Y is None else Y)
        self._scale: Final = np.exp(-theta[:, :d].mean(axis=0))
        parts = [np.arange(n)[:: _COARSER**level] for level in range(3)]
        self._trees: Final = [(part, KDTree(evidence.X[part] * self._scale)) for part in parts]
        times = min(max(d / NEIGHBORS_VARIABLES, 1.0), MOST_TIMES_NEIGHBORS)
        self._counts: Final = [round(times * count) for count in NEIGHBORS]
        self.diagnostics: Final = FitDiagnostics(n, cost, 0, outputs.flat)
        self.regions: Final = Regions.whole(d, self.hyperparameters.separable)

    def nearest(self, queries: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Return the trials (q, k) that queries (q, d) are answered from, in rising order, and how many each has (q,).

        A row with fewer is filled up with its last one. Third is the scaled distance (q,) of the farthest one of those
        that are the nearest of all trials.
        """
        found, reach = [], np.empty(0)
        for (part, tree), count in zip(self._trees, self._counts, strict=True):
            distances, rows = tree.query(queries * self._scale, k=np.arange(1, min(count, len(part)) + 1))  # pyright: ignore[reportArgumentType]
            reach = reach if found else distances[:, -1]
            found.append(part[rows])
        rows = np.sort(np.concatenate(found, axis=1), axis=1)
        first = np.concatenate([np.ones((len(rows), 1), dtype=bool), rows[:, 1:] != rows[:, :-1]], axis=1)
        counts = first.sum(axis=1)
        order = np.argsort(~first, axis=1, kind="stable")
        rows = np.ascontiguousarray(np.take_along_axis(rows, order, axis=1), dtype=np.int64)
        return rows, counts.astype(np.int64), np.maximum(reach, _SMALLEST)

    @cached_property
    def _neighborhoods(self) -> Neighborhoods:
        anchors = np.asarray(self._trees[1][0], dtype=np.int64)
        return Neighborhoods(self.evidence, self._Y, self.hyperparameters, anchors, self._scale, self.nearest)

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(query + offsets[i]); see `GaussianProcessPosterior.average`.

        The mean is a weighted sum of the trials near its points; the variance is that of its error, which is never
        below the one given all trials.
        """
        queries, (q, d) = np.ascontiguousarray(queries), queries.shape
        shape = (-1, *offsets.shape[-2:])
        steps = (
            np.ascontiguousarray(offsets).reshape(shape),
            np.ascontiguousarray(np.ones_like(offsets) if slopes is None else slopes).reshape(shape),
        )
        weights = np.ascontiguousarray(weights)
        own, evidence = self.hyperparameters, self.evidence
        prior = prior_variance(
            *steps, weights, own.inverse_l, own.s2, evidence.mean_variance, evidence.kernel, gradient
        )
        m, derivatives = len(self._Y), q if gradient else 0
        moments = np.empty((m, q)), np.empty((m, q)), np.empty((m, derivatives, d)), np.empty((m, derivatives, d))
        rows, counts, reach = self.nearest(queries)
        distances = np.sqrt(np.square(steps[0] * self._scale).sum(axis=2))  # (1 or q, s)
        wide = (distances > WITHIN_REACH * reach[:, None]).any(axis=1)
        for part in (np.flatnonzero(~wide), *_blocks(np.flatnonzero(wide))):
            if not len(part):
                continue
            each = part if len(steps[0]) == q else np.array([0])
            some = steps[0][each], steps[1][each]
            arguments = (
                queries[part],
                *some,
                weights,
                (prior[0][:, each].copy(), prior[1][:, each if gradient else slice(0)].copy()),
                evidence.X,
                self._Y,
                evidence.noise,
                own.inverse_l,
                own.s2,
                own.v,
                evidence.ratio,
                evidence.mean_variance,
                evidence.kernel,
                rows[part],
                counts[part],
            )
            if wide[part[0]]:
                around = self._neighborhoods
                shares = around.shares(queries[part], queries[part][:, None, :] + some[0], reach[part])
                found = average_by_groups(*arguments, *shares, around.prepared(shares.anchors), gradient)
            else:
                found = average_by_neighbors(*arguments, gradient)
            if np.isnan(found[0]).any():
                raise unfactorized()
            for whole, one in zip(moments[: 4 if gradient else 2], found, strict=False):
                whole[:, part] = one
        mean, variance, mean_gradient, variance_gradient = moments
        scale = self.outputs.scale
        return Moments(
            self.outputs.shift * weights.sum() + scale * mean,
            self.outputs.square * variance,
            scale * mean_gradient if gradient else None,
            self.outputs.square * variance_gradient if gradient else None,
        )

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f at queries (q, d)."""
        return self.average(queries, np.zeros((1, queries.shape[1])), np.ones(1), gradient)

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s).

        The points of a query are drawn given the nearest trials of each of them.
        """
        m, (q, s, _) = len(self._Y), points.shape
        draws = np.empty((m, q, *normals.shape))
        for i in range(q):
            rows = np.unique(self.nearest(points[i])[0][:, :: max(1, s * sum(self._counts) // _SAMPLED)])
            X, Y, noise = self.evidence.X[rows], np.ascontiguousarray(self._Y[:, rows]), self.evidence.noise[rows]
            inverse_L, alpha = np.empty((m, len(rows), len(rows))), np.empty((m, len(rows)))
            own = self.hyperparameters
            evidence = self.evidence
            shared = evidence.mean_variance, evidence.kernel
            kernel = own.inverse_l, own.s2, own.v, evidence.ratio, *shared
            if factorize(X, Y, noise, *kernel, inverse_L, alpha) < 0:
                raise unfactorized()
            part = np.ascontiguousarray(points[i : i + 1])
            draws[:, i : i + 1] = sample(
                part, np.ascontiguousarray(normals), X, own.inverse_l, own.s2, *shared, inverse_L, alpha
            )
        if np.isnan(draws).any():
            raise SureholdError("nothing can be drawn: the covariance of the points could not be factorized.")
        return self.outputs.shift + self.outputs.scale * draws

    def thinned(self, count: int, first: int = 0) -> "NeighborPosterior":
        """Return the posterior of about `count` of the particles, from number `first` on: a cheaper approximation."""
        step = max(1, len(self._Y) // count)
        every = slice(first % step, None, step)
        theta = self.hyperparameters.theta[every]
        return NeighborPosterior(self.evidence, theta, self.outputs, self.diagnostics.evaluations, self._Y[every])

    def with_pending(self, X: NDArray[np.float64]) -> "NeighborPosterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d): only variances shrink."""
        believed = self.outputs.apply(self.moments(X).mean)  # (m, k)
        known = np.full(len(X), self.evidence.noise.mean())
        extended = self.evidence._replace(
            X=np.concatenate([self.evidence.X, X]),
            y=np.concatenate([self.evidence.y, believed.mean(axis=0)]),
            noise=np.concatenate([self.evidence.noise, known]),
            offsets=np.array([0, len(self.evidence.X) + len(X)]),
        )
        Y = np.concatenate([self._Y, believed], axis=1)
        theta = self.hyperparameters.theta
        return NeighborPosterior(extended, theta, self.outputs, self.diagnostics.evaluations, Y)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (m, q) at X (q, d), known or learnt, in squared outputs."""
        known = np.full(len(X), self.evidence.noise.mean())
        return self.outputs.square * (known + self.hyperparameters.v[:, None])

    @property
    def length_scales(self) -> NDArray[np.float64]:
        """Length-scales of the particles, (m, d), in widths of the unit cube."""
        return 1.0 / self.hyperparameters.inverse_l[:, : self.evidence.X.shape[1]]


def _blocks(numbers: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return numbers (q,) in blocks whose neighborhoods are few enough to be kept all together."""
    return [numbers[start : start + _BLOCK] for start in range(0, len(numbers), _BLOCK)]

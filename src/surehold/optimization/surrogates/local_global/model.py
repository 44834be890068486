"""A local and a global process in one: rough around a center that is learnt, smooth elsewhere.

Legend
    c        center of the local process, in the unit cube, (d,)
    w_g, w_l densities of wide and narrow normals, of standard deviations 10 around the middle and 0.05 around c
    lam      l_j(x) = sqrt(w_j(x) / (w_g(x) + w_l(x))), the share of process j at x
    l_g, l_l length-scales of the two processes, (d,) each
    theta    log l_g, log l_l, log s2, c: (3 d + 1,)

    k(x, x') = s2 (l_g(x) l_g(x') c_g(x, x') + l_l(x) l_l(x') c_l(x, x'))
Martinez-Cantin 2018 ("Funneled Bayesian optimization for design, tuning and control of autonomous systems"). Plain
arrays and NumPy; only the density of the hyperparameters is compiled (density.py).
"""

from collections.abc import Iterator
from math import exp, log
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import LOCAL_GLOBAL_BURN_IN, NUGGET, PARTICLES, SURPRISE
from surehold.optimization.samplers.slice import SliceSamples, slice_sample
from surehold.optimization.surrogates.gaussian_process.kernels import correlation_and_factor
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization
from surehold.optimization.surrogates.gaussian_process.posterior import left_out, surprise
from surehold.optimization.surrogates.local_global.density import (
    MATERN52,
    NARROW,
    WIDE,
    fill_prior,
    fill_shares,
    log_posterior,
)
from surehold.optimization.surrogates.memory import Remembered, fingerprint, learnt_from
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, Posterior, Regions

__all__ = ["LocalGlobalProcess"]


class _Particle(NamedTuple):
    """One setting of the hyperparameters and the data's covariance under it."""

    inverse_l: NDArray[np.float64]
    """(2, d): global, local"""
    s2: float
    center: NDArray[np.float64]
    inverse_L: NDArray[np.float64]
    """(n, n)"""
    alpha: NDArray[np.float64]
    """(n,)"""
    y: NDArray[np.float64]
    """standardized outputs that this particle has seen, (n,)"""

    def covariance(
        self, P: NDArray[np.float64], Q: NDArray[np.float64], gradient: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return k(P, Q) (p, q) and, where asked for, its derivatives by P, (d, p, q)."""
        d = P.shape[1]
        total, slope = np.zeros((len(P), len(Q))), np.zeros((d if gradient else 0, len(P), len(Q)))
        C, F = np.empty_like(total), np.empty_like(total)
        at_p, at_q = self._shares(P), self._shares(Q)
        log_odds_slope = (P - 0.5).T / WIDE**2 - (P - self.center[:, None].T).T / NARROW**2  # (d, p)
        for j, sign in ((0, -1.0), (1, 1.0)):
            correlation_and_factor(MATERN52, P, Q, self.inverse_l[j], C, F)
            both = at_p[j][:, None] * at_q[j]
            total += both * C
            if gradient:  # d lam_j = +- lam_j lam_other^2 d log_odds / 2
                change = 0.5 * sign * at_p[1 - j] ** 2 * log_odds_slope  # (d, p)
                steps = (P[:, None, :] - Q).transpose(2, 0, 1) * self.inverse_l[j][:, None, None] ** 2
                slope += both * (change[:, :, None] * C - F * steps)
        return self.s2 * total, self.s2 * slope

    def prior(
        self, points: NDArray[np.float64], tilt: NDArray[np.float64], weights: NDArray[np.float64], gradient: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the prior variance (q,) of weighted sums of f at points (q, s, d), and its derivatives (q, d)."""
        q, s, d = points.shape
        variance, slope = np.full(q, self.s2 * weights.sum() ** 2), np.zeros((q if gradient else 0, d))
        if s > 1:
            fill_prior(
                np.ascontiguousarray(points),
                np.ascontiguousarray(tilt),
                np.ascontiguousarray(weights),
                self.inverse_l,
                self.center,
                variance,
                slope,
            )
            variance *= self.s2
            slope *= self.s2
        return variance, slope

    def _shares(self, P: NDArray[np.float64]) -> NDArray[np.float64]:
        shares = np.empty((2, len(P)))
        fill_shares(P, self.center, shares)
        return shares


class LocalGlobalPosterior:
    """The process conditioned on trials. Built by `LocalGlobalProcess.condition`."""

    def __init__(self, X: NDArray[np.float64], particles: list[_Particle], outputs: Standardization, cost: int):
        self._X: Final = X
        self._particles: Final = particles
        self._outputs: Final = outputs
        self.diagnostics: FitDiagnostics = FitDiagnostics(len(X), cost, 0, outputs.flat)
        self.regions: Regions = Regions.whole(X.shape[1])

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(query + offsets[i]) for each query."""
        q, d = queries.shape
        points = queries[:, None, :] + offsets  # (q, s, d)
        tilt = np.broadcast_to(1.0 if slopes is None else slopes, points.shape)
        m, s = len(self._particles), points.shape[1]
        mean, variance = np.empty((m, q)), np.empty((m, q))
        by_mean, by_variance = np.empty((m, q, d)), np.empty((m, q, d))
        for j, particle in enumerate(self._particles):
            K, slope = particle.covariance(points.reshape(-1, d), self._X, gradient)
            K = np.einsum("qsn,s->qn", K.reshape(q, s, -1), weights)
            V = K @ particle.inverse_L.T
            mean[j], variance[j] = K @ particle.alpha, -np.square(V).sum(axis=1)
            if gradient:
                D = np.einsum("dqsn,s,qsd->qdn", slope.reshape(d, q, s, -1), weights, tilt)
                by_mean[j] = D @ particle.alpha
                by_variance[j] = -2.0 * np.einsum("qdn,qn->qd", D, V @ particle.inverse_L)
            prior, prior_slope = particle.prior(points, tilt, weights, gradient)
            variance[j] += prior
            if gradient:
                by_variance[j] += prior_slope
        scale = self._outputs.scale
        return Moments(
            self._outputs.shift * weights.sum() + scale * mean,
            self._outputs.square * np.maximum(variance, 0.0),
            scale * by_mean if gradient else None,
            self._outputs.square * by_variance if gradient else None,
        )

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f at queries (q, d)."""
        return self.average(queries, np.zeros((1, queries.shape[1])), np.ones(1), gradient)

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s)."""
        q = len(points)
        draws = np.empty((len(self._particles), q, *normals.shape))
        for j, particle in enumerate(self._particles):
            for i in range(q):
                K, _ = particle.covariance(points[i], self._X)
                V = K @ particle.inverse_L.T
                own, _ = particle.covariance(points[i], points[i])
                values, vectors = np.linalg.eigh(own - V @ V.T)
                root = vectors * np.sqrt(np.maximum(values, 0.0))
                draws[j, i] = K @ particle.alpha + normals @ root.T
        return self._outputs.shift + self._outputs.scale * draws

    def thinned(self, count: int, first: int = 0) -> "LocalGlobalPosterior":
        """Return the posterior of about `count` of the particles, from number `first` on: a cheaper approximation."""
        step = max(1, len(self._particles) // count)
        every = self._particles[first % step :: step]
        return LocalGlobalPosterior(self._X, every, self._outputs, self.diagnostics.evaluations)

    def surprise(self, k: int) -> float:
        """Return how much the trials after the first k contradict the particles, in standard deviations."""
        factors = np.array([particle.inverse_L for particle in self._particles])
        return surprise(factors, np.array([particle.y for particle in self._particles]), k)

    def with_pending(self, X: NDArray[np.float64]) -> "LocalGlobalPosterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d)."""
        believed = self._outputs.apply(self.moments(X).mean)
        together = np.concatenate([self._X, X])
        particles = [
            _factorized(p.inverse_l, p.s2, p.center, together, np.append(p.y, b))
            for p, b in zip(self._particles, believed, strict=True)
        ]
        return LocalGlobalPosterior(together, particles, self._outputs, self.diagnostics.evaluations)

    def left_out(self) -> Moments:
        """Return means and variances (m, n) of each trial's value given all others."""
        stacked = [np.array([getattr(p, name) for p in self._particles]) for name in ("inverse_L", "alpha", "y")]
        mean, variance = left_out(*stacked)
        outputs = self._outputs
        return Moments(outputs.shift + outputs.scale * mean, outputs.square * variance, None, None)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (m, q): 0, for observations are exact."""
        return np.zeros((len(self._particles), len(X)))


class LocalGlobalProcess:
    """The local-plus-global process as a surrogate of the optimizer; observations are exact.

    Parameters
    ----------
    output_range
        (lowest, highest) value to expect, if known.
    """

    def __init__(self, output_range: tuple[float, float] | None = None):
        self._stationary: Final = GaussianProcess(output_range=output_range)
        self._learnt = Remembered[tuple[Standardization, SliceSamples]]()

    @property
    def noisy(self) -> bool:
        """False: observations are exact."""
        return False

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
    ) -> LocalGlobalPosterior:
        """Learn the hyperparameters from X (n, d) in the unit cube and finite y (n,), n >= 1.

        As in `GaussianProcess.condition` they are learnt again only when 1/16 more trials, or a surprise, ask for it.
        """
        n, stream = len(y), int(rng.integers(2**63))
        k = learnt_from(n)
        posterior = self._learnt_from(k, X, y, stream)
        if k < n and (posterior.diagnostics.flat or posterior.surprise(k) > SURPRISE):
            posterior = self._learnt_from(n, X, y, stream)
        return posterior

    def _learnt_from(self, k: int, X: NDArray[np.float64], y: NDArray[np.float64], stream: int) -> LocalGlobalPosterior:
        """Return the posterior given all trials, with hyperparameters that were learnt from the first k of them."""
        key = fingerprint(X[:k], y[:k], None, stream)
        outputs, samples = self._learnt.value(
            key, lambda: self._learn(X[:k], y[:k], np.random.default_rng([stream, k]))
        )
        d = X.shape[1]
        inputs, values = np.ascontiguousarray(X), np.ascontiguousarray(outputs.apply(y))
        particles = [
            _factorized(np.exp(-t[: 2 * d].reshape(2, d)), exp(t[2 * d]), t[2 * d + 1 :], inputs, values)
            for t in samples.states
        ]
        return LocalGlobalPosterior(inputs, particles, outputs, samples.evaluations)

    def _learn(
        self, X: NDArray[np.float64], y: NDArray[np.float64], rng: np.random.Generator
    ) -> tuple[Standardization, SliceSamples]:
        """Sample the hyperparameters given X (n, d) and y (n,).

        The chain starts at the length-scales of a stationary process, a quarter of them for the local one, and at the
        best trial.
        """
        d = X.shape[1]
        plain = self._stationary.condition(X, y, rng).thinned(1)
        prior = plain.evidence
        center = np.full(d, 0.5)
        evidence = prior._replace(
            prior_mean=np.concatenate([prior.prior_mean[:d], prior.prior_mean[:d] - 1.0, prior.prior_mean[d:], center]),
            prior_deviation=np.concatenate([prior.prior_deviation[:d], prior.prior_deviation, np.ones(d)]),
        )
        theta = plain.hyperparameters.theta[0]
        best = np.clip(X[int(np.argmax(y))], 0.0, 1.0)  # a trial may have reached a place outside of the box
        start = np.concatenate([theta[:d], theta[:d] - log(4.0), theta[d : d + 1], best])
        widths = np.append(np.full(2 * d + 1, 1.0), np.full(d, 0.2))
        samples = slice_sample(
            log_posterior, evidence, start, rng, keep=PARTICLES, burn_in=LOCAL_GLOBAL_BURN_IN, widths=widths
        )
        return plain.outputs, samples


def _factorized(
    inverse_l: NDArray[np.float64],
    s2: float,
    center: NDArray[np.float64],
    X: NDArray[np.float64],
    y: NDArray[np.float64],
) -> _Particle:
    from scipy.linalg import solve_triangular

    empty = np.empty((0, 0))
    A, _ = _Particle(np.ascontiguousarray(inverse_l), s2, center, empty, empty, y).covariance(X, X)
    for nugget in _nuggets():
        try:
            L = np.linalg.cholesky(A + nugget * s2 * np.eye(len(X)))
            break
        except np.linalg.LinAlgError:
            continue
    else:
        raise FloatingPointError("the covariance of the trials could not be factorized")
    inverse_L = solve_triangular(L, np.eye(len(X)), lower=True)
    return _Particle(np.ascontiguousarray(inverse_l), s2, center, inverse_L, inverse_L.T @ (inverse_L @ y), y)


def _nuggets() -> Iterator[float]:
    return iter([NUGGET, *(10.0**e for e in range(-9, -1))])

"""The probability of success given trials: a mixture over particles of Gaussian approximations.

Legend
    f         latent Gaussian process, of mean mu and variance v at a query under one particle
    P         Phi(f), the probability of success; its mean is Phi(h), h = mu / sqrt(1 + v)
    T         Owen's function;  E[P^2] = Phi(h) - 2 T(h, 1 / sqrt(1 + 2 v))
    tau       precisions of the sites of expectation propagation, see `propagation`

Given tau, f is the posterior of a regression with noise variances 1 / tau: predictions of the latent function, their
gradients and joint draws are those of `GaussianProcessPosterior`, whose factor is that of K + diag(1 / tau).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, ndtr, ndtri, owens_t
from scipy.stats import qmc

from surehold.defaults import SUCCESS_DRAWS
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization
from surehold.optimization.surrogates.gaussian_process.posterior import Factors, GaussianProcessPosterior
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, Posterior, Regions
from surehold.optimization.surrogates.success.laplace import Counts, compared_covariance, laplace, prior_covariance
from surehold.optimization.surrogates.success.propagation import Sites, propagated

__all__ = ["SuccessPosterior", "probability", "regression", "shares", "sites_of"]

_STEP: Final = 1e-5  # of differences, in widths of the unit cube
_LOG_SQRT_2PI: Final = 0.5 * np.log(2.0 * np.pi)


class SuccessPosterior:
    """The probability of success, conditioned on trials; a `Posterior` of P, with that of f in `latent`.

    `theta` (m, d + 1) are the particles, `pending` (p, d) trials under way, `sites` those of each particle, computed
    where None.
    """

    def __init__(
        self,
        counts: Counts,
        theta: NDArray[np.float64],
        cost: int,
        pending: NDArray[np.float64] | None = None,
        sites: list[Sites] | None = None,
    ):
        d = counts.X.shape[1]
        self.counts: Final = counts
        self._theta: Final = theta
        self._pending: Final = np.empty((0, d)) if pending is None else pending
        self.sites: Final = [sites_of(counts, one) for one in theta] if sites is None else sites
        inverse, alpha = np.stack([one.half for one in self.sites]), np.stack([one.alpha for one in self.sites])
        self.latent: GaussianProcessPosterior = regression(counts, theta, cost, Factors(inverse, alpha, 0))
        if len(self._pending):
            self.latent = self._with(self._pending, cost)
        self.diagnostics: Final = FitDiagnostics(len(counts.X), cost, 0, False)
        self.regions: Final = Regions.whole(d)

    def _with(self, X: NDArray[np.float64], cost: int) -> GaussianProcessPosterior:
        """Return the latent process as if one trial each at X (k, d) had brought what its mean leads to expect."""
        mu = self.latent.moments(X).mean  # (m, k)
        # expected information of one trial, phi^2 / (Phi (1 - Phi))
        information = np.exp(-mu * mu - 2.0 * _LOG_SQRT_2PI - log_ndtr(mu) - log_ndtr(-mu))
        root = np.concatenate([np.stack([one.root for one in self.sites]), np.sqrt(information)], axis=1)
        m, n = root.shape
        k = len(X)
        alpha = np.concatenate([self.latent.factors.alpha, np.zeros((m, k))], axis=1)
        larger = self.counts._replace(
            X=np.ascontiguousarray(np.concatenate([self.counts.X, X])),
            successes=np.concatenate([self.counts.successes, np.zeros(k)]),
            trials=np.concatenate([self.counts.trials, np.zeros(k)]),
        )
        K, inverse = np.empty((n, n)), np.empty((m, n, n))
        for j in range(m):
            prior_covariance(self._theta[j], larger, K)
            B = np.eye(n) + root[j][:, None] * K * root[j]
            inverse[j] = solve_triangular(np.linalg.cholesky(B), np.diag(root[j]), lower=True)
        return regression(larger, self._theta, cost, Factors(inverse, alpha, 0))

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of P at queries (q, d)."""
        f = self.latent.moments(queries, gradient)
        mean, variance, by = probability(f.mean, f.variance)
        if f.mean_gradient is None or f.variance_gradient is None:
            return Moments(mean, variance, None, None)
        slopes = [by[i][..., None] * f.mean_gradient + by[i + 1][..., None] * f.variance_gradient for i in (0, 2)]
        return Moments(mean, variance, slopes[0], slopes[1])

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] P(query + offsets[i]) for queries (q, d).

        The mean is exact for each particle; the variance is that of fixed joint draws, its gradient their difference.
        """
        if len(weights) == 1 and not offsets.any() and slopes is None:
            single = self.moments(queries, gradient)
            w = float(weights[0])
            up = (single.mean_gradient, single.variance_gradient)
            return Moments(
                w * single.mean,
                w * w * single.variance,
                None if up[0] is None else w * up[0],
                None if up[1] is None else w * w * up[1],
            )
        q, d = queries.shape
        s = len(weights)
        points = queries[:, None, :] + offsets
        each = self.moments(points.reshape(-1, d), gradient)
        mean = each.mean.reshape(-1, q, s) @ weights
        variance = self._variance(points, weights)
        if each.mean_gradient is None:
            return Moments(mean, variance, None, None)
        free = np.ones((1, s, d)) if slopes is None else slopes.reshape(-1, s, d)
        by_mean = np.einsum("s,mqsd->mqd", weights, each.mean_gradient.reshape(-1, q, s, d) * free)
        by_variance = np.empty_like(by_mean)
        for k in range(d):
            step = np.zeros_like(points)
            step[..., k] = _STEP * np.broadcast_to(free[..., k], (q, s))
            above, below = (self._variance(points + sign * step, weights) for sign in (1.0, -1.0))
            by_variance[..., k] = (above - below) / (2.0 * _STEP)
        return Moments(mean, variance, by_mean, by_variance)

    def _variance(self, points: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance (m, q) of the weighted probabilities at points (q, s, d)."""
        return (self.sample(points, _normals(len(weights))) @ weights).var(axis=-1)

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of P at points (q, s, d), made from independent standard normals (b, s)."""
        return ndtr(self.latent.sample(points, normals))

    def thinned(self, count: int, first: int = 0) -> "SuccessPosterior":
        """Return the posterior of about `count` of the particles, evenly taken from number `first` on."""
        step = max(1, len(self._theta) // count)
        every = slice(first % step, None, step)
        theta = np.ascontiguousarray(self._theta[every])
        return SuccessPosterior(self.counts, theta, self.diagnostics.evaluations, self._pending, self.sites[every])

    def with_pending(self, X: NDArray[np.float64]) -> "SuccessPosterior":
        """Return the posterior as if one trial each at X (k, d) had brought what is expected: only variances shrink."""
        pending = np.concatenate([self._pending, X])
        return SuccessPosterior(self.counts, self._theta, self.diagnostics.evaluations, pending, self.sites)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance E[P (1 - P)] (m, q) of one outcome of 0 or 1 at X (q, d), P being given."""
        moments = self.moments(X)
        return np.maximum(moments.mean - moments.mean**2 - moments.variance, 0.0)


def sites_of(counts: Counts, theta: NDArray[np.float64]) -> Sites:
    """Return the sites under the hyperparameters theta (d + 1,), from Laplace's approximation on."""
    n, p = len(counts.X), len(counts.successes)
    K, L, a, W = np.empty((n, n)), np.empty((p, p)), np.empty(p), np.empty(p)
    prior_covariance(theta, counts, K)
    if len(counts.pairs):
        K = compared_covariance(K, counts.pairs)
    laplace(K, counts.successes, counts.trials, a, W, L)
    return propagated(K, counts.successes, counts.trials, W, W * (K @ a) + a)


def probability(
    mu: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[NDArray[np.float64], ...]]:
    """Return mean and variance of P, and the derivatives of the mean by mu and v and of the variance by mu and v."""
    wide = 1.0 + v
    h = mu / np.sqrt(wide)
    mean = ndtr(h)
    second = mean - 2.0 * owens_t(h, 1.0 / np.sqrt(1.0 + 2.0 * v))
    density = np.exp(-0.5 * h * h - _LOG_SQRT_2PI) / np.sqrt(wide)  # of N(0, 1 + v) at mu
    narrow = np.sqrt(wide * (1.0 + 2.0 * v))
    g = mu / narrow
    by_mu, by_v = density, -0.5 * mu / wide * density  # d/dv = 1/2 d2/dmu2: the heat equation
    second_by_mu = 2.0 * density * ndtr(g)
    second_by_v = density * (np.exp(-0.5 * g * g - _LOG_SQRT_2PI) / narrow - mu / wide * ndtr(g))
    variance = np.maximum(second - mean * mean, 0.0)
    return mean, variance, (by_mu, by_v, second_by_mu - 2.0 * mean * by_mu, second_by_v - 2.0 * mean * by_v)


def shares(posterior: Posterior, points: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return draws of the mean of P over points (s, d) with weights (s,), those of all particles together."""
    return (posterior.sample(points[None], _normals(len(points))) @ weights).ravel()


def _normals(s: int) -> NDArray[np.float64]:
    if s > 128:
        return np.random.default_rng(0).standard_normal((SUCCESS_DRAWS, s))
    uniform = qmc.Sobol(s, rng=np.random.default_rng(0)).random(SUCCESS_DRAWS)
    return ndtri(np.clip(uniform, 1e-12, 1.0 - 1e-12))


def regression(counts: Counts, theta: NDArray[np.float64], cost: int, factors: Factors) -> GaussianProcessPosterior:
    """Return the latent process as the regression that has these factors."""
    n = len(counts.X)
    evidence = Evidence(
        counts.X,
        np.zeros(n),
        np.zeros(n),
        np.array([0, n]),
        np.ones(1),
        counts.prior_mean,
        counts.prior_deviation,
        1.0,
        counts.ratio,
        counts.mean_variance,
        counts.kernel,
        True,
        False,
    )
    return GaussianProcessPosterior(evidence, theta, Standardization(0.0, 1.0, False), cost, factors=factors)

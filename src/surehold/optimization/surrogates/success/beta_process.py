"""The smoothed beta process: the probability of success from counts near by, without a matrix to factor.

Legend
    s, f, r   successes, failures and executions at each input, (n,);  r = s + f
    K         exp(-1/2 sum_k (x_k - x'_k)^2 / l_k^2), l (d,) the length-scales
    a, b      prior counts;  alpha(x) = a + sum_i K(x, x_i) s_i,  beta(x) = b + sum_i K(x, x_i) f_i,  N = alpha + beta
    P         probability of success at x, of distribution Beta(alpha(x), beta(x)):
              E P = alpha / N,  Var P = E P (1 - E P) / (N + 1)

Montesano and Lopes 2012; the continuous correlated beta process of Goetschalckx et al. 2011. It says nothing of P at
several places together, which an average over the input noise needs: their correlation is taken for K (joint draws are
those of a Gaussian copula), so that places which share their evidence agree.
"""

from math import log, sqrt
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.spatial.distance import cdist
from scipy.special import betaincinv, ndtr

from surehold.defaults import BETA_PRIOR, LENGTH_SCALE_DEVIATION, LENGTH_SCALE_MEDIAN, MANY_LEARNT
from surehold.errors import InputError
from surehold.optimization.surrogates.memory import Remembered, fingerprint, learnt_from
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, Posterior, Regions

__all__ = ["BetaPosterior", "BetaProcess", "left_out_likelihood"]

_AT_ONCE: Final = 2_000_000  # entries of K at a time
_RANGE: Final = (log(0.01), log(10.0))  # of length-scales, in box widths
_JITTER: Final = 1e-8


class BetaPosterior:
    """The probability of success near counted trials; a `Posterior` of P with one particle.

    `X` (n, d) inputs in the unit cube, `successes` and `failures` (n,), not negative, `scales` (d,) in box widths,
    `prior` the counts (a, b) before any trial.
    """

    def __init__(
        self,
        X: NDArray[np.float64],
        successes: NDArray[np.float64],
        failures: NDArray[np.float64],
        scales: NDArray[np.float64],
        prior: tuple[float, float],
        cost: int = 0,
    ):
        self.length_scales: Final = scales
        self._X: Final = X / scales
        self._counts: Final = np.stack([successes, failures], axis=1)  # (n, 2)
        self._prior: Final = np.array(prior)
        self.diagnostics: Final = FitDiagnostics(len(X), cost, 0, False)
        self.regions: Final = Regions.whole(X.shape[1])

    def counts(
        self, queries: NDArray[np.float64], gradient: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Return alpha and beta (q, 2) at queries (q, d), and their gradients (q, 2, d)."""
        Q = queries / self.length_scales
        found = np.empty((len(Q), 2))
        slopes = np.empty((len(Q), 2, Q.shape[1])) if gradient else None
        step = max(1, _AT_ONCE // max(len(self._X), 1))
        for start in range(0, len(Q), step):
            part = slice(start, start + step)
            K = np.exp(-0.5 * cdist(Q[part], self._X, "sqeuclidean"))
            near = K @ self._counts
            found[part] = self._prior + near
            if slopes is not None:
                for c in range(2):
                    toward = (K * self._counts[:, c]) @ self._X - near[:, c, None] * Q[part]
                    slopes[part, c] = toward / self.length_scales
        return found, slopes

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of P at queries (q, d)."""
        counts, slopes = self.counts(queries, gradient)
        total = counts.sum(axis=1)
        mean = counts[:, 0] / total
        variance = mean * (1.0 - mean) / (total + 1.0)
        if slopes is None:
            return Moments(mean[None], variance[None], None, None)
        of_total = slopes.sum(axis=1)
        of_mean = (slopes[:, 0] - mean[:, None] * of_total) / total[:, None]
        of_variance = ((1.0 - 2.0 * mean)[:, None] * of_mean - variance[:, None] * of_total) / (total + 1.0)[:, None]
        return Moments(mean[None], variance[None], of_mean[None], of_variance[None])

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] P(query + offsets[i]) for queries (q, d)."""
        q, d = queries.shape
        s = len(weights)
        at = np.broadcast_to(offsets, (q, s, d))
        each = self.moments((queries[:, None, :] + at).reshape(-1, d), gradient)
        deviation = np.sqrt(each.variance.reshape(q, s))
        scaled = deviation * weights  # (q, s)
        C = self._correlation(offsets)  # (s, s) or (q, s, s)
        agreeing = np.einsum("...st,qt->qs", C, scaled) if C.ndim == 2 else np.einsum("qst,qt->qs", C, scaled)
        mean = each.mean.reshape(q, s) @ weights
        variance = np.maximum((scaled * agreeing).sum(axis=1), 0.0)
        if each.mean_gradient is None or each.variance_gradient is None:
            return Moments(mean[None], variance[None], None, None)
        free = np.broadcast_to(1.0 if slopes is None else slopes, (q, s, d))
        of_mean = np.einsum("s,qsd->qd", weights, each.mean_gradient.reshape(q, s, d) * free)
        of_deviation = each.variance_gradient.reshape(q, s, d) * free / (2.0 * deviation[..., None])
        of_variance = 2.0 * np.einsum("qs,qsd->qd", weights * agreeing, of_deviation)
        if slopes is not None:  # a point held at a border does not follow the query: C changes
            whole = np.broadcast_to(C, (q, s, s)) * scaled[:, :, None] * scaled[:, None, :]
            rows = whole.sum(axis=2)[..., None]
            apart = 2.0 * ((rows * at * free).sum(axis=1) - np.einsum("qst,qsd,qtd->qd", whole, at, free))
            of_variance -= apart / self.length_scales**2
        return Moments(mean[None], variance[None], of_mean[None], of_variance[None])

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (1, q, b, s) of P at points (q, s, d), made from independent standard normals (b, s)."""
        q, s, d = points.shape
        root = np.linalg.cholesky(self._correlation(points) + _JITTER * np.eye(s)) / sqrt(1.0 + _JITTER)
        alpha, beta = np.moveaxis(self.counts(points.reshape(-1, d))[0].reshape(q, 1, s, 2), -1, 0)
        return betaincinv(alpha, beta, ndtr(np.einsum("qst,bt->qbs", root, normals)))[None]

    def _correlation(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return K (..., s, s) of points (..., s, d)."""
        z = points / self.length_scales
        return np.exp(-0.5 * np.square(z[..., :, None, :] - z[..., None, :, :]).sum(axis=-1))

    def thinned(self, count: int, first: int = 0) -> "BetaPosterior":
        """Return this posterior, which has one particle."""
        return self

    def with_pending(self, X: NDArray[np.float64]) -> "BetaPosterior":
        """Return the posterior as if one execution each at X (k, d) had brought the share that is expected."""
        expected = self.moments(X).mean[0]
        successes, failures = np.concatenate([self._counts, np.stack([expected, 1.0 - expected], axis=1)]).T
        places = np.concatenate([self._X * self.length_scales, X])
        prior = float(self._prior[0]), float(self._prior[1])
        return BetaPosterior(places, successes, failures, self.length_scales, prior, self.diagnostics.evaluations)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance E[P (1 - P)] (1, q) of one outcome of 0 or 1 at X (q, d), P being given."""
        moments = self.moments(X)
        return np.maximum(moments.mean - moments.mean**2 - moments.variance, 0.0)


class BetaProcess:
    """Probabilities of success by counting near by; for many trials, of which a Gaussian process is dear.

    A query costs O(n). Nothing is extrapolated: far from all trials P is the prior again.

    Parameters
    ----------
    prior
        Counts (a, b) of successes and failures before any trial, positive; (1, 1) is the uniform distribution.
    length_scales
        Fixed length-scales (d,) in box widths. None (default): the most probable ones, by the likelihood of each place
        given all others (with a prior of the same weight about the share of all trials) and the prior of
        `GaussianProcess`; of many places as many as 200 are left out in turn.

    Raises
    ------
    InputError
        If a prior count or a length-scale is not positive.
    """

    def __init__(self, prior: tuple[float, float] = BETA_PRIOR, *, length_scales: ArrayLike | None = None):
        counts = np.asarray(prior, dtype=np.float64)
        if counts.shape != (2,) or not np.all((counts > 0.0) & np.isfinite(counts)):
            raise InputError(
                f"prior is {prior!r}; give two positive counts, of successes and failures, such as (1, 1)."
            )
        self._prior: Final = float(counts[0]), float(counts[1])
        self._scales: Final = None if length_scales is None else np.asarray(length_scales, dtype=np.float64)
        if self._scales is not None and not np.all((self._scales > 0.0) & np.isfinite(self._scales)):
            raise InputError(f"length_scales are {length_scales!r}; give a positive number of box widths each.")
        self._learnt = Remembered[tuple[NDArray[np.float64], int]]()

    @property
    def noisy(self) -> bool:
        """Observations carry noise: True."""
        return True

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
        trials: NDArray[np.float64] | None = None,
    ) -> BetaPosterior:
        """Learn from X (n, d) in the unit cube and shares of success y (n,) of `trials` (n,), 1 each by default.

        Length-scales are learnt anew after every sixteenth part of the trials, as those of `GaussianProcess`.
        """
        of = np.ones(len(y)) if trials is None else np.asarray(trials, dtype=np.float64)
        places, successes, failures = _together(X, y * of, of)
        if self._scales is not None:
            return BetaPosterior(places, successes, failures, self._scales, self._prior)
        k = learnt_from(len(y))
        key = fingerprint(X[:k], y[:k], of[:k])
        scales, cost = self._learnt.value(key, lambda: self._learn(*_together(X[:k], (y * of)[:k], of[:k])))
        return BetaPosterior(places, successes, failures, scales, self._prior, cost)

    def _learn(
        self, X: NDArray[np.float64], successes: NDArray[np.float64], failures: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], int]:
        """Return the most probable length-scales (d,), and how often their density was evaluated."""
        d = X.shape[1]
        rows = np.unique(np.linspace(0, len(X) - 1, min(len(X), MANY_LEARNT)).round().astype(np.intp))
        middle = log(LENGTH_SCALE_MEDIAN * sqrt(d))
        # About the share of all trials: about 1/2, wide kernels would be likelier only because more counts outweigh it.
        a, b = self._prior
        share = (a + successes.sum()) / (a + b + successes.sum() + failures.sum())
        prior = (a + b) * share, (a + b) * (1.0 - share)

        def loss(logs: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
            value, slope = left_out_likelihood(np.exp(logs), X, successes, failures, prior, rows)
            z = (logs - middle) / LENGTH_SCALE_DEVIATION
            return float(0.5 * z @ z - value), z / LENGTH_SCALE_DEVIATION - slope

        starts = (np.full(d, middle), np.full(d, middle - LENGTH_SCALE_DEVIATION))
        found = [minimize(loss, start, jac=True, method="L-BFGS-B", bounds=[_RANGE] * d) for start in starts]
        best = min(found, key=lambda end: float(end.fun))
        return np.exp(best.x), sum(int(end.nfev) for end in found)


def left_out_likelihood(
    scales: NDArray[np.float64],
    X: NDArray[np.float64],
    successes: NDArray[np.float64],
    failures: NDArray[np.float64],
    prior: tuple[float, float],
    rows: NDArray[np.intp],
) -> tuple[float, NDArray[np.float64]]:
    """Return the log likelihood of the places `rows`, each given all other places; and its gradient by log l (d,).

    Of place i it is s_i log p + f_i log(1 - p), p the expected probability there by the other places.
    """
    Z = X / scales
    K = np.exp(-0.5 * cdist(Z[rows], Z, "sqeuclidean"))
    K[np.arange(len(rows)), rows] = 0.0
    alpha, beta = prior[0] + K @ successes, prior[1] + K @ failures
    s, f, total = successes[rows], failures[rows], alpha + beta
    value = s @ np.log(alpha / total) + f @ np.log(beta / total)
    by_all = (s + f) / total
    G = K * (np.outer(s / alpha - by_all, successes) + np.outer(f / beta - by_all, failures))
    squares = G.sum(axis=1) @ Z[rows] ** 2 + G.sum(axis=0) @ Z**2 - 2.0 * np.einsum("rd,rd->d", Z[rows], G @ Z)
    return float(value), squares


def _together(
    X: NDArray[np.float64], successes: NDArray[np.float64], trials: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return places, successes and failures, trials of the same input put together."""
    places, which = np.unique(X, axis=0, return_inverse=True)
    which = which.ravel()
    s, r = (np.bincount(which, n, len(places)).astype(np.float64) for n in (successes, trials))
    return places, s, np.maximum(r - s, 0.0)

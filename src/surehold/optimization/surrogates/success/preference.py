"""Preferences between two inputs as a surrogate: how good an input is, in units of the judgement's own noise.

Legend
    f       utility, a Gaussian process of mean 0; whoever compares a with b prefers a with the probability
            Phi(g), g = (f_a - f_b) / sqrt 2: two utilities, each judged with a normal error of variance 1
    A       (p, n): g = A f for p pairs of n inputs;  A K A' the covariance of g
    H       half of the sites of g: (A K A' + 1 / tau)^-1 = H' H, see `propagation`

Chu and Ghahramani 2005, with the probit code of successes: each pair is a success of g. Given the sites, f is again the
posterior of a regression, whose precision is (H A)' (H A). Only differences of f mean something.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from surehold.optimization.surrogates.gaussian_process.kernels import kernel_number
from surehold.optimization.surrogates.gaussian_process.posterior import Factors, GaussianProcessPosterior
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, Regions
from surehold.optimization.surrogates.success.laplace import Counts
from surehold.optimization.surrogates.success.model import counted, learnt
from surehold.optimization.surrogates.success.posterior import regression, sites_of

__all__ = ["PreferencePosterior", "PreferenceProcess"]


_BELIEVED: Final = 20.0  # judgements that a pending input counts as, so that others keep away from it


class PreferencePosterior:
    """The utility over that of the best input compared, the anchor: a `Posterior` of f(x) - f(anchor).

    Without an anchor the common level of all utilities, of which comparisons say nothing, would count as a chance to
    improve. `theta` (m, d + 1) are the particles, `latent` the posterior of f, computed where None.
    """

    def __init__(
        self,
        counts: Counts,
        theta: NDArray[np.float64],
        cost: int,
        latent: GaussianProcessPosterior | None = None,
        anchor: NDArray[np.float64] | None = None,
    ):
        self._counts: Final = counts
        self._theta: Final = theta
        self.latent: Final[GaussianProcessPosterior] = latent or _utility(counts, theta, cost)
        self.anchor: Final[NDArray[np.float64]] = self._best() if anchor is None else anchor
        self.diagnostics: Final = FitDiagnostics(len(counts.X), cost, 0, False)
        self.regions: Final = Regions.whole(counts.X.shape[1])

    def _best(self) -> NDArray[np.float64]:
        X = self._counts.X
        return X[int(np.argmax(self.latent.moments(X).mean.mean(axis=0)))]

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f(x) - f(anchor) at queries (q, d)."""
        return self.average(queries, np.zeros((1, queries.shape[1])), np.ones(1), gradient)

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] (f(query + offsets[i]) - f(anchor)) for queries (q, d)."""
        shape = (len(queries), len(weights), queries.shape[1])
        free = np.broadcast_to(1.0 if slopes is None else slopes, shape)
        held = (self.anchor - queries)[:, None]
        return self.latent.average(
            queries,
            np.concatenate([np.broadcast_to(offsets, shape), held], axis=1),
            np.append(weights, -weights.sum()),
            gradient,
            np.concatenate([free, np.zeros_like(held)], axis=1),
        )

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) at points (q, s, d), made from independent standard normals (b, s)."""
        anchored = np.concatenate([np.broadcast_to(self.anchor, (len(points), 1, points.shape[2])), points], axis=1)
        first = np.random.default_rng(0).standard_normal((len(normals), 1))
        draws = self.latent.sample(anchored, np.concatenate([first, normals], axis=1))
        return draws[..., 1:] - draws[..., :1]

    def preferred(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
        """Return the probability that one judgement prefers a (d,) to b (d,)."""
        difference = self.latent.average(a[None], np.stack([np.zeros_like(a), b - a]), np.array([1.0, -1.0]))
        return float(ndtr(difference.mean / np.sqrt(2.0 + difference.variance)).mean())

    def thinned(self, count: int, first: int = 0) -> "PreferencePosterior":
        """Return the posterior of about `count` of the particles, evenly taken from number `first` on."""
        latent = self.latent.thinned(count, first)
        cost = self.diagnostics.evaluations
        return PreferencePosterior(self._counts, latent.hyperparameters.theta, cost, latent, self.anchor)

    def with_pending(self, X: NDArray[np.float64]) -> "PreferencePosterior":
        """Return the posterior as if each of X (k, d) had been compared with the anchor, and had done as well."""
        n, k = self._counts.X.shape[0], len(X)
        anchor = int(np.argmin(np.abs(self._counts.X - self.anchor).max(axis=1)))
        more = self._counts._replace(
            X=np.ascontiguousarray(np.concatenate([self._counts.X, X])),
            successes=np.append(self._counts.successes, np.full(k, 0.5 * _BELIEVED)),
            trials=np.append(self._counts.trials, np.full(k, _BELIEVED)),
            pairs=np.concatenate([self._counts.pairs, np.column_stack([np.arange(n, n + k), np.full(k, anchor)])]),
        )
        return PreferencePosterior(more, self._theta, self.diagnostics.evaluations, None, self.anchor)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance (m, q) of the error with which a utility is judged at X (q, d): 1, which is its unit."""
        return np.ones((len(self._theta), len(X)))


class PreferenceProcess:
    """A Gaussian process of utilities, learnt from which of two inputs was preferred; hyperparameters slice-sampled.

    `kernel` as of `GaussianProcess`; `theta` (d + 1,) are fixed log length-scales and log signal variance; None
    (default) learns them, with the priors of `SuccessProcess`.
    """

    def __init__(self, *, kernel: str = "matern52", theta: NDArray[np.float64] | None = None):
        self._kernel: Final = kernel_number(kernel)
        self._theta: Final = theta

    @property
    def noisy(self) -> bool:
        """Observations carry noise: True."""
        return True

    def condition(
        self, X: NDArray[np.float64], pairs: NDArray[np.intp], rng: np.random.Generator
    ) -> PreferencePosterior:
        """Learn from inputs X (n, d) in the unit cube and pairs (p, 2) of their rows, the preferred one first."""
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        compared, which = np.unique(np.column_stack([low, high]), axis=0, return_inverse=True)
        first = (pairs[:, 0] == low).astype(np.float64)
        none = np.zeros(0)
        counts = counted(X[:0], none, none, self._kernel, 0.0)._replace(
            X=np.ascontiguousarray(X, dtype=np.float64),
            successes=np.bincount(which.ravel(), first).astype(np.float64),
            trials=np.bincount(which.ravel()).astype(np.float64),
            pairs=compared.astype(np.int64),
        )
        theta, cost = learnt(counts, rng) if self._theta is None else (self._theta[None], 0)
        return PreferencePosterior(counts, theta, cost)


def _utility(counts: Counts, theta: NDArray[np.float64], cost: int) -> GaussianProcessPosterior:
    """Return the posterior of f under the particles theta (m, d + 1)."""
    n, p = len(counts.X), len(counts.pairs)
    A = np.zeros((p, n))
    A[np.arange(p), counts.pairs[:, 0]] = 0.5**0.5
    A[np.arange(p), counts.pairs[:, 1]] = -(0.5**0.5)
    half, alpha = np.zeros((len(theta), n, n)), np.empty((len(theta), n))
    for j, one in enumerate(theta):
        sites = sites_of(counts, one)
        triangle = np.linalg.qr((sites.half @ A)[:, ::-1], mode="r")  # upper, of the same square, of n rows at most
        half[j, n - len(triangle) :], alpha[j] = np.flip(triangle), A.T @ sites.alpha
    return regression(counts, theta, cost, Factors(half, alpha, 0))

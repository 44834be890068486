"""A Gaussian process conditioned on trials, as a mixture over the particles of its hyperparameters.

Legend: theta (m, p) = particles of log length-scales (d), log signal variance and log noise variance where learnt;
outputs are standardized inside and in their own units outside.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, ndtri

from surehold.errors import SureholdError
from surehold.optimization.surrogates.gaussian_process.kernels import are_sums, shape_size
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization
from surehold.optimization.surrogates.gaussian_process.prediction import (
    average,
    factorize,
    means,
    prior_variance,
    sample,
)
from surehold.optimization.surrogates.memory import Remembered
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, Regions

__all__ = ["GaussianProcessPosterior", "Hyperparameters"]


class Hyperparameters(NamedTuple):
    """The particles, unpacked."""

    theta: NDArray[np.float64]
    """(m, p)"""
    inverse_l: NDArray[np.float64]
    """the kernel's scales: inverse length-scales (m, d), and those of its shape, if it has any"""
    s2: NDArray[np.float64]
    """signal variances in standardized units, (m,)"""
    v: NDArray[np.float64]
    """learnt noise variances in standardized units, (m,)"""
    separable: bool
    """whether half of the particles or more are sums of processes of one variable each"""

    @classmethod
    def of(cls, theta: NDArray[np.float64], evidence: Evidence) -> "Hyperparameters":
        """Return the particles theta (m, p) unpacked, as `likelihood.scales_of` and `unpack` do with one."""
        m, d = len(theta), evidence.X.shape[1]
        inverse_l, position = np.exp(-theta[:, :d]), d + shape_size(evidence.kernel)
        if shape_size(evidence.kernel):
            inverse_l = np.column_stack([inverse_l, np.exp(theta[:, d]), expit(theta[:, d + 1])])
        return cls(
            theta,
            inverse_l,
            np.exp(theta[:, position]) if evidence.learn_signal else np.full(m, evidence.signal_variance),
            np.exp(theta[:, -1]) if evidence.learn_noise else np.zeros(m),
            bool(are_sums(evidence.kernel, inverse_l).mean() >= 0.5),
        )


class Factors(NamedTuple):
    """What every prediction needs of the data's covariance A = L L' under each particle."""

    inverse_L: NDArray[np.float64]
    """(m, n, n), lower triangular with zeros above the diagonal"""
    alpha: NDArray[np.float64]
    """A^-1 y, (m, n)"""
    repaired: int
    """factorizations that needed a larger nugget than asked for"""


class GaussianProcessPosterior:
    """A Gaussian process conditioned on trials, a mixture over the particles of its hyperparameters.

    Built by `GaussianProcess.condition`. `evidence` holds the trials in standardized units, `outputs` the map
    back; `Y` (m, n) are the outputs that each particle has seen, which differ only at pending trials. `log_noise` is
    the logarithm of the observation noise's variance, in standardized units, where it differs from place to place.
    """

    def __init__(
        self,
        evidence: Evidence,
        theta: NDArray[np.float64],
        outputs: Standardization,
        cost: int,
        Y: NDArray[np.float64] | None = None,
        log_noise: "GaussianProcessPosterior | None" = None,
        factors: Factors | None = None,
    ):
        m, (n, d) = len(theta), evidence.X.shape
        self.evidence: Final = evidence
        self.outputs: Final = outputs
        self.log_noise: Final = log_noise
        self.hyperparameters: Final = Hyperparameters.of(theta, evidence)
        self._Y: Final = np.ascontiguousarray(np.broadcast_to(evidence.y, (m, n)) if Y is None else Y)
        self.factors: Final = factors or self._factorized()
        self.diagnostics: Final = FitDiagnostics(n, cost, self.factors.repaired, outputs.flat)
        self.regions: Final = Regions.whole(d, self.hyperparameters.separable)
        self._priors: Final = Remembered[tuple[NDArray[np.float64], NDArray[np.float64]]]()

    def _factorized(self) -> Factors:
        evidence = self.evidence
        m, n = self._Y.shape
        inverse_L, alpha = np.empty((m, n, n)), np.empty((m, n))
        repaired = factorize(
            evidence.X,
            self._Y,
            evidence.noise,
            self.hyperparameters.inverse_l,
            self.hyperparameters.s2,
            self.hyperparameters.v,
            evidence.ratio,
            evidence.mean_variance,
            evidence.kernel,
            inverse_L,
            alpha,
        )
        if repaired < 0:
            raise SureholdError("the covariance of the trials could not be factorized; are outputs of sane size?")
        return Factors(inverse_L, alpha, repaired)

    def surprise(self, k: int) -> float:
        """Return how much the trials after the first k contradict the particles, in standard deviations."""
        return surprise(self.factors.inverse_L, self._Y, k)

    def left_out(self) -> Moments:
        """Return means and variances (m, n) of each trial's value given all others, observation noise included."""
        mean, variance = left_out(self.factors.inverse_L, self.factors.alpha, self._Y)
        return Moments(self.outputs.shift + self.outputs.scale * mean, self.outputs.square * variance, None, None)

    @property
    def length_scales(self) -> NDArray[np.float64]:
        """Length-scales of the particles, (m, d), in widths of the unit cube."""
        return 1.0 / self.hyperparameters.inverse_l[:, : self.evidence.X.shape[1]]

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(query + offsets[i]) for queries (q, d).

        offsets are (s, d), or (q, s, d) where each query has its own; slopes, of the same shape and 1 by default, are
        the derivatives of query + offset by the query, coordinate by coordinate.
        """
        shape = (-1, *offsets.shape[-2:])
        steps = (
            np.ascontiguousarray(offsets).reshape(shape),
            np.ascontiguousarray(np.ones_like(offsets) if slopes is None else slopes).reshape(shape),
            np.ascontiguousarray(weights),
        )
        kernel = (
            self.hyperparameters.inverse_l,
            self.hyperparameters.s2,
            self.evidence.mean_variance,
            self.evidence.kernel,
        )
        if offsets.ndim == 2:  # the same for every query, and for those of the next call
            key = repr((shape, gradient)).encode() + b"".join(part.tobytes() for part in steps)
            prior = self._priors.value(key, lambda: prior_variance(*steps, *kernel, gradient))
        else:
            prior = prior_variance(*steps, *kernel, gradient)
        mean, variance, mean_gradient, variance_gradient = average(
            np.ascontiguousarray(queries),
            *steps,
            prior,
            self.evidence.X,
            *kernel,
            self.factors.inverse_L,
            self.factors.alpha,
            gradient,
        )
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

    def means(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the means (m, q) at queries (q, d), without their variances."""
        parameters = self.hyperparameters
        result = means(
            np.ascontiguousarray(queries),
            self.evidence.X,
            parameters.inverse_l,
            parameters.s2,
            self.evidence.mean_variance,
            self.evidence.kernel,
            self.factors.alpha,
        )
        return self.outputs.shift + self.outputs.scale * result

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s)."""
        draws = sample(
            np.ascontiguousarray(points),
            np.ascontiguousarray(normals),
            self.evidence.X,
            self.hyperparameters.inverse_l,
            self.hyperparameters.s2,
            self.evidence.mean_variance,
            self.evidence.kernel,
            self.factors.inverse_L,
            self.factors.alpha,
        )
        if np.isnan(draws).any():
            raise SureholdError("nothing can be drawn: the covariance of the points could not be factorized.")
        return self.outputs.shift + self.outputs.scale * draws

    def thinned(self, count: int, first: int = 0) -> "GaussianProcessPosterior":
        """Return the posterior of about `count` of the particles, from number `first` on: a cheaper approximation."""
        step = max(1, len(self._Y) // count)
        every = slice(first % step, None, step)
        return GaussianProcessPosterior(
            self.evidence,
            self.hyperparameters.theta[every],
            self.outputs,
            self.diagnostics.evaluations,
            self._Y[every],
            self.log_noise,
            Factors(
                np.ascontiguousarray(self.factors.inverse_L[every]),
                np.ascontiguousarray(self.factors.alpha[every]),
                self.factors.repaired,
            ),
        )

    def with_pending(self, X: NDArray[np.float64]) -> "GaussianProcessPosterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d): only variances shrink."""
        believed = self.outputs.apply(self.moments(X).mean)  # (m, k)
        extended = self.evidence._replace(
            X=np.concatenate([self.evidence.X, X]),
            y=np.concatenate([self.evidence.y, believed.mean(axis=0)]),
            noise=np.concatenate([self.evidence.noise, self._known_noise(X)]),
            offsets=np.array([0, len(self.evidence.X) + len(X)]),
        )
        Y = np.concatenate([self._Y, believed], axis=1)
        theta = self.hyperparameters.theta
        return GaussianProcessPosterior(extended, theta, self.outputs, self.diagnostics.evaluations, Y, self.log_noise)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (m, q) at X (q, d), known or learnt, in squared outputs.

        Of noise that differs from place to place each particle takes another quantile of what is known of its
        logarithm.
        """
        v = self.hyperparameters.v[:, None]  # (m, 1)
        if self.log_noise is None:
            return self.outputs.square * (self._known_noise(X) + v)
        level = self.log_noise.moments(X)
        quantiles = ndtri((np.arange(len(v)) + 0.5) / len(v))[:, None]
        return self.outputs.square * (np.exp(level.mean[0] + quantiles * np.sqrt(level.variance[0])) + v)

    def _known_noise(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance (q,) at X (q, d), standardized, without what the particles have learnt."""
        if self.log_noise is not None:
            return np.exp(self.log_noise.moments(X).mean[0])
        return np.full(len(X), self.evidence.noise.mean())


def left_out(
    inverse_L: NDArray[np.float64], alpha: NDArray[np.float64], Y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return means and variances (m, n) of each output given all others (Rasmussen and Williams 2006, (5.12)).

    inverse_L (m, n, n) are the inverse factors of the data's covariances A, alpha (m, n) is A^-1 y, Y (m, n) hold y.
    """
    precision = np.einsum("mij,mij->mj", inverse_L, inverse_L)  # diagonal of A^-1
    return Y - alpha / precision, 1.0 / precision


def surprise(inverse_L: NDArray[np.float64], Y: NDArray[np.float64], k: int) -> float:
    """Return how much trials after the first k contradict particles that were learnt without them, in deviations.

    That is the largest miss of a trial, predicted from those before it, by the particle that misses least; or infinity,
    where these trials are so much likelier under some particles that less than a quarter of all count (effective sample
    size, Kong 1992). inverse_L (m, n, n) are the inverse factors of the data's covariances, Y (m, n) the outputs.
    """
    z = np.einsum("mij,mj->mi", inverse_L[:, k:], Y)  # (m, n - k), standard normal if all is well
    logs = (np.log(np.diagonal(inverse_L, axis1=1, axis2=2)[:, k:]) - 0.5 * z * z).sum(axis=1)
    weights = np.exp(logs - logs.max())
    if weights.sum() ** 2 < 0.25 * len(weights) * np.square(weights).sum():
        return float("inf")
    return float(np.abs(z).min(axis=0).max())

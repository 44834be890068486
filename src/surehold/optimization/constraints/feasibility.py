"""The probability that a trial succeeds, learnt from which trials failed: a Gaussian process with a probit likelihood.

Legend
    t      n labels, 1 where a trial gave a value and -1 where it failed
    f      latent function with covariance K = s2 k(r / l) + 1, k Matern-5/2; the 1 is a constant of unknown size
    S      precisions of the sites, normal stand-ins for the labels' likelihoods; B = I + S^1/2 K S^1/2
    mu, v  mean and variance of f at a query; P = Phi(mu / sqrt(1 + v))
    j      settings (l, s2) on a grid, weighed by their evidence: few labels say little about both

Expectation propagation (Minka 2001; Rasmussen and Williams 2006, section 3.6): Laplace's approximation, at the mode, is
so unsure where labels agree that the search keeps returning to places that failed. That a criterion times this
probability converges is shown by Bachoc, Helbert and Picheny 2020.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.special import log_ndtr, ndtr

from surehold.defaults import FAILURE_LENGTHS, FAILURE_SIGNALS
from surehold.optimization.noise.perturbations import Perturbations

__all__ = ["Succeeds", "SuccessModel", "propagate"]

_SWEEPS: Final = 60
_DAMPING: Final = 0.8
_CONVERGED: Final = 1e-5
_LOG_SQRT_2PI: Final = 0.5 * np.log(2.0 * np.pi)


class Sites(NamedTuple):
    """Expectation propagation's approximation for one setting."""

    a: NDArray[np.float64]
    """(K + S^-1)^-1 of the sites' means: the mean at a query is k'a, (n,)"""
    root: NDArray[np.float64]
    """S^1/2, (n,)"""
    lower: NDArray[np.float64]
    """Cholesky factor of B, (n, n)"""
    log_evidence: float


def propagate(K: NDArray[np.float64], t: NDArray[np.float64]) -> Sites:
    """Return the sites for labels t (n,) of 1 and -1 and the covariance K (n, n); all are updated at once, damped."""
    n = len(t)
    precision, shift = np.zeros(n), np.zeros(n)  # of the sites: S and S times their means
    for _ in range(_SWEEPS):
        mean, variance, root, lower = _marginals(K, precision, shift)
        cavity, cavity_shift = 1.0 / variance - precision, mean / variance - shift
        z = t * cavity_shift / np.sqrt(cavity * (cavity + 1.0))
        ratio = np.exp(-0.5 * z * z - _LOG_SQRT_2PI - log_ndtr(z))
        tilted_mean = cavity_shift / cavity + t * ratio / np.sqrt(cavity * (cavity + 1.0))
        tilted = 1.0 / cavity - ratio * (z + ratio) / (cavity * (cavity + 1.0))
        new = np.maximum(1.0 / tilted - cavity, 1e-12)
        new_shift = tilted_mean / tilted - cavity_shift
        moved = float(np.abs(new - precision).max() / (1.0 + precision.max()))
        precision = precision + _DAMPING * (new - precision)
        shift = shift + _DAMPING * (new_shift - shift)
        if moved < _CONVERGED:
            break
    mean, variance, root, lower = _marginals(K, precision, shift)
    cavity, cavity_shift = 1.0 / variance - precision, mean / variance - shift
    z = t * cavity_shift / np.sqrt(cavity * (cavity + 1.0))
    total, before = cavity + precision, cavity_shift / cavity
    evidence = (  # Rasmussen and Williams 2006, (3.65), (3.73) and (3.74)
        log_ndtr(z).sum()
        + 0.5 * np.log1p(precision / cavity).sum()
        - np.log(np.diag(lower)).sum()
        + 0.5 * (shift @ mean - (shift * shift / total).sum())
        + 0.5 * (before * cavity / total * (precision * before - 2.0 * shift)).sum()
    )
    a = shift - root * cho_solve((lower, True), root * (K @ shift))
    return Sites(a, root, lower, float(evidence))


def _marginals(
    K: NDArray[np.float64], precision: NDArray[np.float64], shift: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and variance of f given the sites, (n,) each, S^1/2 and the Cholesky factor of B."""
    root = np.sqrt(precision)
    lower = cholesky(np.eye(len(K)) + root[:, None] * K * root, lower=True)
    half = solve_triangular(lower, root[:, None] * K, lower=True)
    covariance = K - half.T @ half
    return covariance @ shift, np.diag(covariance).copy(), root, lower


class SuccessModel:
    """Where trials succeed.

    Parameters
    ----------
    X : (n, d)
        Where trials were, the unit cube being the box.
    succeeded : (n,)
        Whether each gave a value.
    """

    def __init__(self, X: NDArray[np.float64], succeeded: NDArray[np.bool_]):
        t = np.where(succeeded, 1.0, -1.0)
        self._X: Final = X
        d = X.shape[1]
        settings = [(length * d**0.5, s2) for length in FAILURE_LENGTHS for s2 in FAILURE_SIGNALS]
        modes = [propagate(s2 * _matern(_distances(X, X) / length) + 1.0, t) for length, s2 in settings]
        logs = np.array([mode.log_evidence for mode in modes])
        weights = np.exp(logs - logs.max())
        kept = np.flatnonzero(weights > 1e-3)
        self._weights: Final = weights[kept] / weights[kept].sum()
        self._parts: Final = [(*settings[j], modes[j]) for j in kept]

    def probability(
        self, U: NDArray[np.float64], gradient: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return P (q,) at U (q, d) and its gradients (q, d), (0, d) where they are not asked for."""
        total, slopes = np.zeros(len(U)), np.zeros((len(U) if gradient else 0, U.shape[1]))
        distances = _distances(U, self._X)
        for weight, (length, s2, mode) in zip(self._weights, self._parts, strict=True):
            k = s2 * _matern(distances / length) + 1.0  # (q, n)
            mu = k @ mode.a
            solved = solve_triangular(mode.lower, (k * mode.root).T, lower=True)  # (n, q)
            v = np.maximum(s2 + 1.0 - np.square(solved).sum(axis=0), 0.0)
            scale = np.sqrt(1.0 + v)
            total += weight * ndtr(mu / scale)
            if not gradient:
                continue
            # dk/dx = -5/3 s2 (1 + sqrt5 r) exp(-sqrt5 r) (x - x_i) / l^2
            r = 5.0**0.5 * distances / length
            slope = (-5.0 / 3.0 * s2 / length**2) * ((1.0 + r) * np.exp(-r))  # (q, n), times (x - x_i)
            back = solve_triangular(mode.lower, solved, lower=True, trans=1).T * mode.root  # (q, n)
            by_k = mode.a / scale[:, None] + (mu / scale**3)[:, None] * back  # d (mu / scale) / dk
            inner = by_k * slope
            density = np.exp(-0.5 * (mu / scale) ** 2 - _LOG_SQRT_2PI)
            slopes += weight * density[:, None] * (inner.sum(axis=1)[:, None] * U - inner @ self._X)
        return total, slopes


class Succeeds:
    """The requirement that an execution succeeds, over the input noise; its probability counts to the given power."""

    def __init__(self, model: SuccessModel, perturbations: Perturbations, power: float = 1.0):
        self._power: Final = power
        self._model: Final = model
        self._perturbations: Final = perturbations

    def log_probability(
        self, U: NDArray[np.float64], gradient: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the logarithm of the probability (q,) at U (q, d), and its gradients (q, d) where asked for."""
        q, d = U.shape
        weights = self._perturbations.quadrature.weights
        points, free = self._perturbations.with_slopes(U)
        P, slopes = self._model.probability(points.reshape(-1, d), gradient)
        total = np.maximum(P.reshape(q, -1) @ weights, 1e-300)
        if not gradient:
            return self._power * np.log(total), np.zeros((0, d))
        slopes = slopes.reshape(q, -1, d) if free is None else slopes.reshape(q, -1, d) * free
        return self._power * np.log(total), self._power * np.einsum("s,qsd->qd", weights, slopes) / total[:, None]


def _distances(A: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(A, B), dtype=np.float64)


def _matern(r: NDArray[np.float64]) -> NDArray[np.float64]:
    r = 5.0**0.5 * r
    return (1.0 + r + r * r / 3.0) * np.exp(-r)

"""Expectation propagation: Laplace's approximation replaced by one that matches moments.

Legend
    tau, nu   sites (n,): the likelihood of input i counts as exp(nu_i f_i - tau_i f_i^2 / 2)
    B         I + tau^1/2 K tau^1/2 = L L', as in `laplace` with tau in place of W
    cavity    the marginal of f_i without its own site; tilted: cavity times the true likelihood

Minka 2001; Rasmussen and Williams 2006, section 3.6, for all sites at once and damped. Laplace's probabilities of 25
trials are up to .023 too near to 1/2, those of expectation propagation .01 or less off: `test_success.py`.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, roots_hermitenorm

__all__ = ["Sites", "propagated"]

_SWEEPS: Final = 60
_DAMPING: Final = 0.8
_CONVERGED: Final = 1e-4  # of site precisions, relative to the largest
_LEAST: Final = 1e-10
_LOG_SQRT_2PI: Final = 0.5 * np.log(2.0 * np.pi)
_NODES, _WEIGHTS = roots_hermitenorm(64)
_LOG_WEIGHTS: Final = np.log(np.maximum(_WEIGHTS, 1e-300)) - _LOG_SQRT_2PI


class Sites(NamedTuple):
    """Expectation propagation's approximation under one setting of the hyperparameters."""

    root: NDArray[np.float64]
    """tau^1/2, (n,)"""
    alpha: NDArray[np.float64]
    """K^-1 E f: the mean at a query is k' alpha, (n,)"""
    half: NDArray[np.float64]
    """L^-1 tau^1/2, (n, n); half' half = (K + 1 / tau)^-1"""
    log_evidence: float
    """log p(s), without the binomial coefficients"""


def propagated(
    K: NDArray[np.float64],
    successes: NDArray[np.float64],
    trials: NDArray[np.float64],
    tau: NDArray[np.float64],
    nu: NDArray[np.float64],
) -> Sites:
    """Return the sites for successes of trials (n,) and the covariance K (n, n), from first sites tau and nu (n,)."""
    for _ in range(_SWEEPS):
        mean, variance, lower = _marginals(K, tau, nu)
        precision = np.maximum(1.0 / variance - tau, _LEAST)
        center = (mean / variance - nu) / precision
        tilted, narrow, _ = _tilted(center, 1.0 / precision, successes, trials)
        new_tau = np.maximum(1.0 / narrow - precision, _LEAST)
        step = new_tau - tau
        tau = tau + _DAMPING * step
        nu = nu + _DAMPING * (tilted / narrow - center * precision - nu)
        if np.abs(step).max() < _CONVERGED * (1e-2 + np.abs(tau).max()):
            break
    mean, variance, lower = _marginals(K, tau, nu)
    precision = np.maximum(1.0 / variance - tau, _LEAST)
    center = (mean / variance - nu) / precision
    total = precision + tau
    evidence = (  # Rasmussen and Williams 2006, (3.65), (3.73) and (3.74)
        _tilted(center, 1.0 / precision, successes, trials)[2].sum()
        + 0.5 * np.log1p(tau / precision).sum()
        - np.log(np.diag(lower)).sum()
        + 0.5 * (nu @ mean - (nu * nu / total).sum())
        + 0.5 * (center * precision / total * (tau * center - 2.0 * nu)).sum()
    )
    root = np.sqrt(tau)
    half = np.tril(solve_triangular(lower, np.diag(root), lower=True, check_finite=False))
    return Sites(root, nu - half.T @ (half @ (K @ nu)), half, float(evidence))


def _marginals(
    K: NDArray[np.float64], tau: NDArray[np.float64], nu: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and variance (n,) of f given the sites, and L (n, n)."""
    root = np.sqrt(tau)
    lower = np.linalg.cholesky(np.eye(len(tau)) + root[:, None] * K * root)
    solved = solve_triangular(lower, root[:, None] * K, lower=True, check_finite=False)
    variance = np.diag(K) - np.square(solved).sum(axis=0)
    return K @ nu - solved.T @ (solved @ nu), variance, np.asarray(lower, dtype=np.float64)


def _tilted(
    center: NDArray[np.float64],
    variance: NDArray[np.float64],
    successes: NDArray[np.float64],
    trials: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return means, variances and logarithms of the masses (n,) of the tilted distributions.

    In closed form for single trials (Rasmussen and Williams 2006, section 3.9), else by Gauss-Hermite quadrature.
    """
    if trials.max() == 1.0:
        t, wide = 2.0 * successes - 1.0, np.sqrt(1.0 + variance)
        z = t * center / wide
        mass = log_ndtr(z)
        ratio = np.exp(-0.5 * z * z - _LOG_SQRT_2PI - mass)
        narrow = variance - variance**2 * ratio * (z + ratio) / wide**2
        return center + variance * t * ratio / wide, np.maximum(narrow, 1e-12), mass
    f = center[:, None] + np.sqrt(variance)[:, None] * _NODES
    logs = _LOG_WEIGHTS + successes[:, None] * log_ndtr(f) + (trials - successes)[:, None] * log_ndtr(-f)
    largest = logs.max(axis=1, keepdims=True)
    w = np.exp(logs - largest)
    mass = w.sum(axis=1, keepdims=True)
    w /= mass
    mean = (w * f).sum(axis=1)
    narrow = np.maximum((w * (f - mean[:, None]) ** 2).sum(axis=1), 1e-12)
    return mean, narrow, (largest + np.log(mass))[:, 0]

"""Expectation propagation: Laplace's approximation replaced by one that matches moments.

Legend
    tau, nu   sites (n,): the likelihood of input i counts as exp(nu_i f_i - tau_i f_i^2 / 2)
    B         I + tau^1/2 K tau^1/2, as in `laplace` with tau in place of W
    cavity    the marginal of f_i without its own site; tilted: cavity times the true likelihood

Minka 2001; Rasmussen and Williams 2006, section 3.6, for all sites at once and damped. Laplace's probabilities of 25
trials are up to .023 too near to 1/2, those of expectation propagation .01 or less off: `test_success.py`.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, roots_hermitenorm

__all__ = ["propagated"]

_SWEEPS: Final = 30
_DAMPING: Final = 0.8
_CONVERGED: Final = 1e-3  # of site precisions, relative to the largest
_LEAST: Final = 1e-10
_LOG_SQRT_2PI: Final = 0.5 * np.log(2.0 * np.pi)
_NODES, _WEIGHTS = roots_hermitenorm(64)
_LOG_WEIGHTS: Final = np.log(np.maximum(_WEIGHTS, 1e-300))


def propagated(
    K: NDArray[np.float64],
    successes: NDArray[np.float64],
    trials: NDArray[np.float64],
    tau: NDArray[np.float64],
    nu: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return root tau (n,), a = K^-1 E f (n,) and B^-1/2 tau^1/2 (n, n), from first sites tau and nu (n,)."""
    for _ in range(_SWEEPS):
        root, half = _half(K, tau)
        solved = half @ K
        variance = np.diag(K) - np.square(solved).sum(axis=0)
        mean = K @ nu - solved.T @ (solved @ nu)
        precision = np.maximum(1.0 / variance - tau, _LEAST)
        center = (mean / variance - nu) / precision
        tilted, narrow = _tilted(center, 1.0 / precision, successes, trials)
        new_tau = np.maximum(1.0 / narrow - precision, _LEAST)
        step = new_tau - tau
        tau = tau + _DAMPING * step
        nu = nu + _DAMPING * (tilted / narrow - center * precision - nu)
        if np.abs(step).max() < _CONVERGED * (1e-2 + np.abs(tau).max()):
            break
    root, half = _half(K, tau)
    return root, nu - half.T @ (half @ (K @ nu)), half


def _half(K: NDArray[np.float64], tau: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return root tau and H (n, n) such that H' H = (K + 1 / tau)^-1."""
    root = np.sqrt(tau)
    lower = np.linalg.cholesky(np.eye(len(tau)) + root[:, None] * K * root)
    return root, np.tril(solve_triangular(lower, np.diag(root), lower=True, check_finite=False))


def _tilted(
    center: NDArray[np.float64],
    variance: NDArray[np.float64],
    successes: NDArray[np.float64],
    trials: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return means and variances (n,) of the tilted distributions.

    In closed form for single trials (Rasmussen and Williams 2006, section 3.9), else by Gauss-Hermite quadrature.
    """
    if trials.max() == 1.0:
        t, wide = 2.0 * successes - 1.0, np.sqrt(1.0 + variance)
        z = t * center / wide
        ratio = np.exp(-0.5 * z * z - _LOG_SQRT_2PI - log_ndtr(z))
        narrow = variance - variance**2 * ratio * (z + ratio) / wide**2
        return center + variance * t * ratio / wide, np.maximum(narrow, 1e-12)
    f = center[:, None] + np.sqrt(variance)[:, None] * _NODES
    logs = _LOG_WEIGHTS + successes[:, None] * log_ndtr(f) + (trials - successes)[:, None] * log_ndtr(-f)
    w = np.exp(logs - logs.max(axis=1, keepdims=True))
    w /= w.sum(axis=1, keepdims=True)
    mean = (w * f).sum(axis=1)
    return mean, np.maximum((w * (f - mean[:, None]) ** 2).sum(axis=1), 1e-12)

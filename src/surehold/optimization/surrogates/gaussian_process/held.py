"""Learning what is left to learn where the length-scales are given: variances, and the share of a second scale.

Legend: theta (p,) as in `likelihood`; its first d entries are held at the prior's mean, where `Evidence.prior_mean` has
the given length-scales; free (p - d,) are the others. Where noise that differs from place to place is learnt, all are
sought, and the prior's deviation keeps these at what is given, to a hundredth.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import MODE_REACH, MODE_STARTS, MODE_TOLERANCES
from surehold.optimization.samplers.elliptical_slice import elliptical_slice_sample
from surehold.optimization.samplers.slice import slice_sample
from surehold.optimization.surrogates.gaussian_process.curvature import root_of_covariance
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning, Learnt
from surehold.optimization.surrogates.gaussian_process.likelihood import (
    Evidence,
    log_posterior,
    log_posterior_and_gradient,
)
from surehold.store.kernels import njit

__all__ = ["HELD", "learn_held", "mode_held"]

HELD: Final = 0.01  # deviation of a prior on the logarithm that as good as holds it


def learn_held(
    evidence: Evidence, learning: Learning, rng: np.random.Generator, previous: NDArray[np.float64] | None = None
) -> Learnt:
    """Draw particles (m, p) as `hyperparameters.learn` does, length-scales held; one where nothing else is learnt."""
    d, p = evidence.X.shape[1], evidence.prior_mean.size
    if p == d:
        return Learnt(evidence.prior_mean[None, :].copy(), 0)
    counts = {"keep": learning.particles, "burn_in": learning.burn_in, "thin": learning.thin}
    if learning.method == "slice":
        start = np.ones(p - d) if previous is None or previous.size != p else previous[d:]
        samples = slice_sample(_log_posterior, evidence, start, rng, widths=learning.width, **counts)
        return Learnt(_whole(evidence, samples.states), samples.evaluations)
    center, evaluations = mode_held(evidence)
    if learning.method == "map":
        return Learnt(center[None, :], evaluations)
    root = root_of_covariance(evidence, center, d)
    samples = elliptical_slice_sample(_log_posterior, evidence, center[d:], root, rng, **counts)
    return Learnt(_whole(evidence, samples.states), evaluations + samples.evaluations + p - d + 1)


def mode_held(evidence: Evidence) -> tuple[NDArray[np.float64], int]:
    """Return the mode (p,) of the log posterior with length-scales held, and the number of evaluations it took."""
    from scipy.optimize import minimize

    d = evidence.X.shape[1]
    mean, deviation = evidence.prior_mean, evidence.prior_deviation
    if mean.size == d:
        return mean.copy(), 0
    starts = np.repeat(mean[None, d:], len(MODE_STARTS), axis=0)
    starts[:, -1] += np.array(MODE_STARTS) * deviation[-1]  # the last variance: that of the noise, where it is learnt
    values = [log_posterior(theta, evidence) for theta in _whole(evidence, starts)]
    best = int(np.argmax(values))

    def negative(free: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        value, gradient = log_posterior_and_gradient(_whole(evidence, free[None, :])[0], evidence)
        return (1e25, gradient[d:]) if value == -np.inf else (-value, -gradient[d:])

    bounds = list(zip((mean - MODE_REACH * deviation)[d:], (mean + MODE_REACH * deviation)[d:], strict=True))
    found = minimize(negative, starts[best], jac=True, method="L-BFGS-B", bounds=bounds, options=MODE_TOLERANCES)
    free = found.x if -found.fun > values[best] else starts[best]
    return _whole(evidence, free[None, :])[0], len(starts) + int(found.nfev)


def _whole(evidence: Evidence, free: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return hyperparameters (m, p) of which free (m, p - d) are the free ones."""
    held = evidence.prior_mean[: evidence.X.shape[1]]
    return np.column_stack([np.tile(held, (len(free), 1)), free])


@njit(cache=True)
def _log_posterior(free, evidence):
    """Return the log posterior density of free (p - d,)."""
    d = evidence.X.shape[1]
    theta = evidence.prior_mean.copy()
    for i in range(free.size):
        theta[d + i] = free[i]
    return log_posterior(theta, evidence)

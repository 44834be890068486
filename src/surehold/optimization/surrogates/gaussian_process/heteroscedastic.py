"""Observation noise that differs from place to place: a second Gaussian process for its logarithm.

Legend
    y_i     = f(x_i) + e_i,  e_i ~ N(0, r(x_i))
    f       the process of interest, posterior mean mu_i and variance v_i at the observations, given r
    g       log r, a Gaussian process with a constant mean
    s_i     expected squared error of observation i given the data: (y_i - mu_i)^2 + v_i

The most likely noise is sought by alternation, after Kersting, Plagemann, Pfaff and Burgard 2007: f given r, then g
given the squared errors. Their log squared errors are biased; here each step is one of Fisher scoring for a log
variance instead (Smyth 1989): the working observation g_i + s_i / r_i - 1 carries noise of variance 2.
"""

from math import log, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    NOISE_VARIANCE_PRIOR,
    VARYING_NOISE_CONVERGED,
    VARYING_NOISE_LENGTH_SCALE,
    VARYING_NOISE_LENGTH_SCALE_DEVIATION,
    VARYING_NOISE_LONGEST_STEP,
    VARYING_NOISE_STEPS,
    VARYING_NOISE_VARIANCE_PRIOR,
)
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Prior, mode
from surehold.optimization.surrogates.gaussian_process.kernels import TWO_SCALES
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior

__all__ = ["most_likely_noise"]

_PLAIN: Final = Standardization(0.0, 1.0, False)


def most_likely_noise(evidence: Evidence) -> tuple[NDArray[np.float64], GaussianProcessPosterior]:
    """Return the noise variances r (n,) at the observations, and the posterior of g = log r.

    The evidence is that of f in standardized units; the noise it holds is not looked at.
    """
    X, y = evidence.X, evidence.y
    n, d = X.shape
    prior_mean, prior_deviation = Prior(
        (log(VARYING_NOISE_LENGTH_SCALE * sqrt(d)), VARYING_NOISE_LENGTH_SCALE_DEVIATION), VARYING_NOISE_VARIANCE_PRIOR
    ).vectors(d, True, False)
    levels = Evidence(
        X=X,
        y=np.zeros(n),
        noise=np.full(n, 2.0),
        offsets=np.array([0, n]),
        weights=np.ones(1),
        prior_mean=prior_mean,
        prior_deviation=prior_deviation,
        signal_variance=1.0,
        ratio=1e-6,
        mean_variance=25.0,
        kernel=0 if evidence.kernel == TWO_SCALES else evidence.kernel,  # noise varies at one scale
        learn_signal=True,
        learn_noise=False,
    )
    g = np.full(n, _common_level(evidence))
    steps = 0
    while True:
        f = _at_mode(evidence._replace(noise=np.exp(g))).moments(X)
        s = (y - f.mean[0]) ** 2 + f.variance[0]
        level = g.mean()
        working = g - level + np.minimum(s * np.exp(-g) - 1.0, VARYING_NOISE_LONGEST_STEP)
        posterior = _at_mode(levels._replace(y=working), Standardization(level, 1.0, False))
        change = posterior.moments(X).mean[0] - g
        g = g + change
        steps += 1
        if np.abs(change).max() < VARYING_NOISE_CONVERGED or steps == VARYING_NOISE_STEPS:
            return np.exp(g), posterior


def _common_level(evidence: Evidence) -> float:
    """Return the log of the noise variance that all observations have in common, at the mode."""
    common = evidence._replace(
        noise=np.zeros(len(evidence.y)),
        prior_mean=np.append(evidence.prior_mean, NOISE_VARIANCE_PRIOR[0]),
        prior_deviation=np.append(evidence.prior_deviation, NOISE_VARIANCE_PRIOR[1]),
        learn_noise=True,
    )
    return float(mode(common)[0][-1])


def _at_mode(evidence: Evidence, outputs: Standardization = _PLAIN) -> GaussianProcessPosterior:
    theta, cost = mode(evidence)
    return GaussianProcessPosterior(evidence, theta[None, :], outputs, cost)

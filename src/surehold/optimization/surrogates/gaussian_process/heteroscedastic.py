"""Observation noise that differs from place to place: a second Gaussian process for its logarithm.

Legend
    y_i     = f(x_i) + e_i,  e_i ~ N(0, r(x_i))
    f       the process of interest, posterior mean mu_i and variance v_i at the observations, given r
    g       log r, a Gaussian process with a constant mean
    s_i     expected squared error of observation i given the data: (y_i - mu_i)^2 + v_i

The most likely noise is sought by alternation, after Kersting, Plagemann, Pfaff and Burgard 2007: f given r, then g
given the squared errors. Their log squared errors are biased; here each step is one of Fisher scoring for a log
variance instead (Smyth 1989): the working observation g_i + s_i / r_i - 1 carries noise of variance 2.

Before that the working observations around one level common to all are asked whether there is anything to learn: the
evidence of a g that varies is compared with that of a constant one. A few dozen trials of a response that is not known
either seldom show where the noise is larger; a pattern that is seen in them all the same makes stated intervals too
narrow where it promises little noise, which is where the answer then is.
"""

from math import log, pi, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    VARYING_NOISE_CONVERGED,
    VARYING_NOISE_LENGTH_SCALE,
    VARYING_NOISE_LENGTH_SCALE_DEVIATION,
    VARYING_NOISE_LONGEST_STEP,
    VARYING_NOISE_STEPS,
    VARYING_NOISE_VARIANCE_PRIOR,
)
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Prior, log_evidence_and_root, mode
from surehold.optimization.surrogates.gaussian_process.kernels import TWO_SCALES
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior

__all__ = ["log_evidence_of_a_constant", "with_learnt_noise"]

_PLAIN: Final = Standardization(0.0, 1.0, False)
_WORKING_VARIANCE: Final = 2.0  # of the log of a squared normal error, by Fisher information
_LEVEL_VARIANCE: Final = 25.0  # prior variance of the mean of g: any level


def with_learnt_noise(common: Evidence) -> tuple[Evidence, GaussianProcessPosterior | None]:
    """Return the evidence with the noise variances r of the observations, and the posterior of g = log r.

    Given is the evidence of f, in standardized units, whose last hyperparameter is one noise variance common to all
    observations. Where they do not show that it varies, it is returned as it is, and no posterior.
    """
    evidence = common._replace(
        prior_mean=common.prior_mean[:-1], prior_deviation=common.prior_deviation[:-1], learn_noise=False
    )
    X, y = evidence.X, evidence.y
    n, d = X.shape
    prior_mean, prior_deviation = Prior(
        (log(VARYING_NOISE_LENGTH_SCALE * sqrt(d)), VARYING_NOISE_LENGTH_SCALE_DEVIATION), VARYING_NOISE_VARIANCE_PRIOR
    ).vectors(d, True, False)
    levels = Evidence(
        X=X,
        y=np.zeros(n),
        noise=np.full(n, _WORKING_VARIANCE),
        offsets=np.array([0, n]),
        weights=np.ones(1),
        prior_mean=prior_mean,
        prior_deviation=prior_deviation,
        signal_variance=1.0,
        ratio=1e-6,
        mean_variance=_LEVEL_VARIANCE,
        kernel=0 if evidence.kernel == TWO_SCALES else evidence.kernel,  # noise varies at one scale
        learn_signal=True,
        learn_noise=False,
    )
    g = np.full(n, mode(common)[0][-1])
    steps = 0
    while True:
        f = _at_mode(evidence._replace(noise=np.exp(g))).moments(X)
        s = (y - f.mean[0]) ** 2 + f.variance[0]
        level = g.mean()
        working = g - level + np.minimum(s * np.exp(-g) - 1.0, VARYING_NOISE_LONGEST_STEP)
        posterior = _at_mode(levels._replace(y=working), Standardization(level, 1.0, False))
        if steps == 0 and not _varies(posterior):
            return common, None
        change = posterior.moments(X).mean[0] - g
        g = g + change
        steps += 1
        if np.abs(change).max() < VARYING_NOISE_CONVERGED or steps == VARYING_NOISE_STEPS:
            return evidence._replace(noise=np.exp(g)), posterior


def log_evidence_of_a_constant(working: NDArray[np.float64]) -> float:
    """Return log p(z) of working observations z (n,) around a constant: z ~ N(0, 2 I + 25 11')."""
    n, mean = len(working), float(np.mean(working))
    along = _WORKING_VARIANCE + n * _LEVEL_VARIANCE  # eigenvalue of the direction 1
    squares = (float(np.sum(working**2)) - n * mean**2) / _WORKING_VARIANCE + n * mean**2 / along
    return -0.5 * (squares + (n - 1) * log(_WORKING_VARIANCE) + log(along) + n * log(2.0 * pi))


def _varies(levels: GaussianProcessPosterior) -> bool:
    """Return whether working observations, of which the mode is known, are likelier if g varies; NaN is no."""
    log_evidence, _ = log_evidence_and_root(levels.evidence, levels.hyperparameters.theta[0])
    return log_evidence > log_evidence_of_a_constant(levels.evidence.y)


def _at_mode(evidence: Evidence, outputs: Standardization = _PLAIN) -> GaussianProcessPosterior:
    theta, cost = mode(evidence)
    return GaussianProcessPosterior(evidence, theta[None, :], outputs, cost)

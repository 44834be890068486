"""Learning hyperparameters: their prior, the mode of their posterior, and slice-sampled particles.

Legend: theta (p,) = log length-scales (d), then log signal variance and log noise variance where learnt, see
`likelihood`. Particles are m equally likely draws of theta.
"""

from dataclasses import dataclass, fields
from math import log
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.likelihood import Evidence, log_posterior, log_posterior_and_gradient
from surehold.optimization.slice_sampling import slice_sample

__all__ = ["Learning", "Learnt", "Prior", "from_prior", "learn", "mode"]

_STARTS = (-2.0, -1.0, 0.0, 1.0)  # common length-scale of the mode's first guesses, in prior standard deviations
_CURVATURE_STEP = 0.05
_REACH = 6.0  # the mode is sought within this many prior standard deviations


@dataclass(frozen=True)
class Prior:
    """Independent normal priors on the logarithms of the hyperparameters."""

    log_length_scale: tuple[float, float]
    """mean and standard deviation; length-scales in widths of the unit cube"""
    log_signal_variance: tuple[float, float] = (0.0, 1.5)
    """in squared standard deviations of the outputs"""
    log_noise_variance: tuple[float, float] = (log(1e-2), 3.0)
    """in squared standard deviations of the outputs"""

    def __post_init__(self) -> None:
        for field in fields(self):
            mean, deviation = getattr(self, field.name)
            if not (np.isfinite(mean) and np.isfinite(deviation) and deviation > 0.0):
                raise InputError(
                    f"prior of {field.name} is ({mean}, {deviation}); give a mean and a positive deviation."
                )

    def vectors(self, d: int, signal: bool, noise: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return means and standard deviations (p,) of theta."""
        rows = [self.log_length_scale] * d
        rows += [self.log_signal_variance] * signal + [self.log_noise_variance] * noise
        table = np.array(rows, dtype=np.float64)
        return np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1])


@dataclass(frozen=True)
class Learning:
    """How the hyperparameters are learnt.

    `method` "slice" keeps `particles` states of a slice sampler after `burn_in` sweeps, one every `thin` sweeps;
    "map" keeps the mode alone. The chain starts at the mode, or, with `start` "previous" (thesis), at the last
    particle of the step before, or at log theta = 1 where there is none. `width` is the sampler's first guess of a
    slice's width; None takes three standard deviations of the density at the start, from its curvature there.
    """

    method: Literal["slice", "map"] = "slice"
    particles: int = 10
    burn_in: int = 5
    thin: int = 1
    width: float | None = None
    start: Literal["mode", "previous"] = "mode"

    def __post_init__(self) -> None:
        if self.method not in ("slice", "map"):
            raise unknown_name("learning method", self.method, ("slice", "map"))
        if self.start not in ("mode", "previous"):
            raise unknown_name("start of the chain", self.start, ("mode", "previous"))
        for name, least in (("particles", 1), ("burn_in", 0), ("thin", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
                raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
        if self.width is not None and not (np.isfinite(self.width) and self.width > 0.0):
            raise InputError(f"width is {self.width!r}; give a positive finite number, or None.")


class Learnt(NamedTuple):
    """Particles and what they cost."""

    particles: NDArray[np.float64]
    """(m, p)"""
    evaluations: int
    """evaluations of the density"""


def learn(
    evidence: Evidence, learning: Learning, rng: np.random.Generator, previous: NDArray[np.float64] | None = None
) -> Learnt:
    """Draw particles of the posterior of theta given the evidence.

    `previous` (p,) is the last particle of the step before, used where `learning.start` says so.
    """
    evaluations = 0
    if learning.start == "previous" and learning.method == "slice":
        start = np.ones(evidence.prior_mean.size) if previous is None else previous
    else:
        start, evaluations = mode(evidence)
    if learning.method == "map":
        return Learnt(start[None, :], evaluations)
    samples = slice_sample(
        log_posterior,
        evidence,
        start,
        rng,
        keep=learning.particles,
        burn_in=learning.burn_in,
        thin=learning.thin,
        widths=_widths(evidence, start) if learning.width is None else learning.width,
    )
    return Learnt(samples.states, evaluations + samples.evaluations)


def _widths(evidence: Evidence, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return three standard deviations (p,) of the density along each coordinate, from its curvature at theta (p,)."""
    widths = np.empty_like(theta)
    for i in range(theta.size):
        step = np.zeros_like(theta)
        step[i] = _CURVATURE_STEP
        rise = log_posterior_and_gradient(theta + step, evidence)[1][i]
        fall = log_posterior_and_gradient(theta - step, evidence)[1][i]
        curvature = (fall - rise) / (2.0 * _CURVATURE_STEP)
        narrowest = 1.0 / evidence.prior_deviation[i] ** 2  # no density is wider than its prior
        widths[i] = 3.0 / np.sqrt(max(curvature, narrowest))
    return widths


def from_prior(evidence: Evidence, particles: int, rng: np.random.Generator) -> Learnt:
    """Draw particles from the prior, for data that say nothing (equal outputs)."""
    shape = (particles, evidence.prior_mean.size)
    return Learnt(evidence.prior_mean + evidence.prior_deviation * rng.standard_normal(shape), 0)


def mode(evidence: Evidence) -> tuple[NDArray[np.float64], int]:
    """Return the mode of the log posterior (p,) and the number of evaluations it took.

    Common length-scales on a coarse grid are tried first; the best one is refined by L-BFGS-B with the analytic
    gradient.
    """
    from scipy.optimize import minimize

    d = evidence.X.shape[1]
    mean, deviation = evidence.prior_mean, evidence.prior_deviation
    starts = np.repeat(mean[None, :], len(_STARTS), axis=0)
    starts[:, :d] += np.outer(_STARTS, deviation[:d])
    values = [log_posterior(start, evidence) for start in starts]
    best = int(np.argmax(values))

    def negative(theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        value, gradient = log_posterior_and_gradient(theta, evidence)
        return (1e25, gradient) if value == -np.inf else (-value, -gradient)

    bounds = list(zip(mean - _REACH * deviation, mean + _REACH * deviation, strict=True))
    found = minimize(negative, starts[best], jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 50})
    theta = found.x if -found.fun > values[best] else starts[best]
    return np.ascontiguousarray(theta), len(starts) + int(found.nfev)

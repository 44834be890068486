"""Learning hyperparameters: their prior, the mode of their posterior, and slice-sampled particles.

Legend: theta (p,) = log length-scales (d), then log signal variance and log noise variance where learnt, see
`likelihood`. Particles are m equally likely draws of theta.
"""

from dataclasses import dataclass, fields
from math import log, pi
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    ADDITIVE_UP_TO,
    BURN_IN,
    INTERACTION_PRIOR,
    MODE_NOISE_START,
    MODE_REACH,
    MODE_STARTS,
    MODE_TOLERANCES,
    NOISE_VARIANCE_PRIOR,
    PARTICLES,
    PROPORTION_PRIOR,
    SHARE_PRIOR,
    SIGNAL_VARIANCE_PRIOR,
    SLICE_WIDTH,
    SMOOTH_LEAST,
    SMOOTH_ODDS,
    THIN,
)
from surehold.errors import InputError, unknown_name
from surehold.optimization.samplers.elliptical_slice import elliptical_slice_sample
from surehold.optimization.samplers.slice import slice_sample
from surehold.optimization.surrogates.gaussian_process.curvature import root_of_covariance
from surehold.optimization.surrogates.gaussian_process.kernels import (
    LOG_ADDITIVE,
    TWO_SCALES,
    kernel_number,
    shape_size,
)
from surehold.optimization.surrogates.gaussian_process.likelihood import (
    Evidence,
    log_posterior,
    log_posterior_and_gradient,
)

__all__ = ["Learning", "Learnt", "Prior", "from_prior", "learn", "log_evidence_and_root", "mode", "shared_out"]

_ABSENT = -50.0  # log(w / (1 - w)) of a short part that adds nothing in double precision, log a that is none
_SAME = 0.1  # of theta: ascents that end as near as this have found the same mode
_METHODS = ("elliptical_slice", "slice", "map")


@dataclass(frozen=True)
class Prior:
    """Independent normal priors on the logarithms of the hyperparameters."""

    log_length_scale: tuple[float, float]
    """mean and standard deviation; length-scales in widths of the unit cube"""
    log_signal_variance: tuple[float, float] = SIGNAL_VARIANCE_PRIOR
    """in squared standard deviations of the outputs"""
    log_noise_variance: tuple[float, float] = NOISE_VARIANCE_PRIOR
    """in squared standard deviations of the outputs"""
    log_proportion: tuple[float, float] = PROPORTION_PRIOR
    """of long to short length-scales, where the kernel has two"""
    logit_share: tuple[float, float] = SHARE_PRIOR
    """log(w / (1 - w)) of the short part's share w of the signal variance, where there is one"""

    def __post_init__(self) -> None:
        for field in fields(self):
            mean, deviation = getattr(self, field.name)
            if not (np.isfinite(mean) and np.isfinite(deviation) and deviation > 0.0):
                raise InputError(
                    f"prior of {field.name} is ({mean}, {deviation}); give a mean and a positive deviation."
                )

    def vectors(
        self, d: int, signal: bool, noise: bool, kernel: int = 0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return means and standard deviations (p,) of theta."""
        rows = [self.log_length_scale] * d
        rows += [self.log_proportion, self.logit_share][: shape_size(kernel)]
        rows += [self.log_signal_variance] * signal + [self.log_noise_variance] * noise
        table = np.array(rows, dtype=np.float64)
        return np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1])


@dataclass(frozen=True)
class Learning:
    """How the hyperparameters are learnt.

    `method` "elliptical_slice" (default) and "slice" keep `particles` states of a slice sampler after `burn_in` steps,
    one every `thin` steps; "map" keeps the mode alone. An elliptical step moves all hyperparameters together, starting
    at the mode and guided by the curvature there. A step of "slice" (the thesis) moves one after the other, with a
    first guess `width` of every slice's width; its chain starts at the last particle of the posterior before, or at
    log theta = 1 where there is none.
    """

    method: Literal["elliptical_slice", "slice", "map"] = "elliptical_slice"
    particles: int = PARTICLES
    burn_in: int = BURN_IN
    thin: int = THIN
    width: float = SLICE_WIDTH

    def __post_init__(self) -> None:
        if self.method not in _METHODS:
            raise unknown_name("learning method", self.method, _METHODS)
        for name, least in (("particles", 1), ("burn_in", 0), ("thin", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
                raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
        if not (np.isfinite(self.width) and self.width > 0.0):
            raise InputError(f"width is {self.width!r}; give a positive finite number.")


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

    `previous` is the last particle of the posterior before, from which "slice" goes on if it is one of the same model
    (p,): noise that varies is known to do so from some trial on.
    """
    if learning.method == "slice":
        p = evidence.prior_mean.size
        start = np.ones(p) if previous is None or previous.size != p else previous
        counts = {"keep": learning.particles, "burn_in": learning.burn_in, "thin": learning.thin}
        samples = slice_sample(log_posterior, evidence, start, rng, widths=learning.width, **counts)
        return Learnt(samples.states, samples.evaluations)
    if evidence.kernel == TWO_SCALES:
        return _learn_by_evidence(evidence, learning, rng)
    center, evaluations = mode(evidence)
    if learning.method == "map":
        return Learnt(center[None, :], evaluations)
    root = root_of_covariance(evidence, center)
    return _around(evidence, learning, learning.particles, center, root, rng, evaluations + center.size + 1)


def _learn_by_evidence(evidence: Evidence, learning: Learning, rng: np.random.Generator) -> Learnt:
    """Draw particles of several models, equally likely beforehand but for the smooth one, which is less so.

    They are one rough scale, one smooth scale, two scales, and, where variables are several and not too many, a sum of
    processes of one variable each with a share of one of all of them. Each has as many particles as its evidence
    p(y | model) says (Laplace's method, MacKay 2003, section 27), so that a function of one scale is modelled as if
    there were no second one, one that all derivatives exist of (squared exponential) as such, and one whose variables
    do not interact is known where no trial has been. A smooth model has none if along some variable its length-scale is
    below SMOOTH_LEAST and the mean gap of the trials, which then tell it nothing of each other.
    """
    d = evidence.X.shape[1]
    shape = [d, d + 1]
    alone = evidence._replace(
        prior_mean=np.delete(evidence.prior_mean, shape), prior_deviation=np.delete(evidence.prior_deviation, shape)
    )
    one_scale = {  # log a that tells the long process, where it is alone
        "matern52": float(evidence.prior_mean[d]),
        "squared_exponential": _ABSENT,
    }
    models = [*(alone._replace(kernel=kernel_number(name)) for name in one_scale), evidence]
    if 1 < d <= ADDITIVE_UP_TO:
        mean, deviation = evidence.prior_mean.copy(), evidence.prior_deviation.copy()
        mean[d] = LOG_ADDITIVE  # in the median the short part is as long as the others
        mean[d + 1], deviation[d + 1] = INTERACTION_PRIOR
        models.append(evidence._replace(prior_mean=mean, prior_deviation=deviation))
    found = [mode(model) for model in models]
    known = [log_evidence_and_root(model, center) for model, (center, _) in zip(models, found, strict=True)]
    logs = np.array([log for log, _ in known])
    smooth = list(one_scale).index("squared_exponential")
    least = min(SMOOTH_LEAST, 1.0 / len(evidence.y))
    logs[smooth] += SMOOTH_ODDS if found[smooth][0][:d].min() >= log(least) else np.nan
    keep = shared_out(logs, 1 if learning.method == "map" else learning.particles)
    parts, cost = [], sum(evaluations + center.size + 1 for center, evaluations in found)
    for model, (center, _), (_, root), count in zip(models, found, known, keep, strict=True):
        if learning.method == "map":
            parts.append(center[None, :][:count])
            continue
        part = _around(model, learning, count, center, root, rng)
        parts.append(part.particles)
        cost += part.evaluations
    for i, log_a in enumerate(one_scale.values()):
        shapes = np.tile([log_a, _ABSENT], (len(parts[i]), 1))
        parts[i] = np.column_stack([parts[i][:, :d], shapes, parts[i][:, d:]])
    return Learnt(np.concatenate(parts), cost)


def shared_out(log_evidences: NDArray[np.float64], count: int) -> list[int]:
    """Return how many of `count` particles each model has, in proportion to its evidence and odds; NaN is none.

    What is left by rounding down goes to the largest remainders. Without any evidence all go to the first model.
    """
    logs = np.where(np.isnan(log_evidences), -np.inf, log_evidences)
    if logs.max() == -np.inf:
        logs = np.where(np.arange(len(logs)) == 0, 0.0, -np.inf)
    shares = np.exp(logs - logs.max())
    shares *= count / shares.sum()
    keep = np.floor(shares).astype(int)
    keep[np.argsort(keep - shares, kind="stable")[: count - keep.sum()]] += 1
    return keep.tolist()


def _around(
    evidence: Evidence,
    learning: Learning,
    keep: int,
    center: NDArray[np.float64],
    root: NDArray[np.float64],
    rng: np.random.Generator,
    cost: int = 0,
) -> Learnt:
    """Draw `keep` particles by elliptical steps, starting at the mode (p,); `cost`: evaluations made before."""
    if keep == 0:
        return Learnt(np.empty((0, center.size)), cost)
    samples = elliptical_slice_sample(
        log_posterior, evidence, center, root, rng, keep=keep, burn_in=learning.burn_in, thin=learning.thin
    )
    return Learnt(samples.states, cost + samples.evaluations)


def log_evidence_and_root(evidence: Evidence, center: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return about log p(y | X, model) by Laplace's method at the mode (p,), and the root of theta's covariance."""
    root = root_of_covariance(evidence, center)
    volume = float(np.linalg.slogdet(root)[1]) + 0.5 * center.size * log(2.0 * pi)
    return log_posterior(center, evidence) + volume, root


def from_prior(evidence: Evidence, particles: int, rng: np.random.Generator) -> Learnt:
    """Draw particles from the prior, for data that say nothing (equal outputs)."""
    shape = (particles, evidence.prior_mean.size)
    return Learnt(evidence.prior_mean + evidence.prior_deviation * rng.standard_normal(shape), 0)


def mode(evidence: Evidence) -> tuple[NDArray[np.float64], int]:
    """Return the mode of the log posterior (p,) and the number of evaluations it took.

    Common length-scales on a coarse grid are tried first, of two scales each with a small and a larger share of the
    short part; the best one is refined by L-BFGS-B with the analytic gradient. Where noise is learnt, so is the best
    one under much noise: a rough function under little noise and a smooth one under much are two modes, and no ascent
    leads from one to the other. The one with the larger evidence around it counts.
    """
    from scipy.optimize import minimize

    d = evidence.X.shape[1]
    mean, deviation = evidence.prior_mean, evidence.prior_deviation
    starts = np.repeat(mean[None, :], len(MODE_STARTS), axis=0)
    starts[:, :d] += np.outer(MODE_STARTS, deviation[:d])
    if evidence.kernel == TWO_SCALES:
        rough = starts.copy()
        rough[:, d + 1] += deviation[d + 1]
        starts = np.concatenate([starts, rough])

    def negative(theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        value, gradient = log_posterior_and_gradient(theta, evidence)
        return (1e25, gradient) if value == -np.inf else (-value, -gradient)

    bounds = list(zip(mean - MODE_REACH * deviation, mean + MODE_REACH * deviation, strict=True))

    def refined(starts: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
        values = [log_posterior(start, evidence) for start in starts]
        best = int(np.argmax(values))
        found = minimize(negative, starts[best], jac=True, method="L-BFGS-B", bounds=bounds, options=MODE_TOLERANCES)
        theta = found.x if -found.fun > values[best] else starts[best]
        return np.ascontiguousarray(theta), len(starts) + int(found.nfev)

    theta, evaluations = refined(starts)
    if evidence.learn_noise:
        noisy = starts.copy()
        noisy[:, -1] = MODE_NOISE_START
        other, more = refined(noisy)
        evaluations += more
        if np.abs(other - theta).max() > _SAME:
            known = [log_evidence_and_root(evidence, place)[0] for place in (theta, other)]
            evaluations += 2 * (theta.size + 1)
            theta = other if known[1] > known[0] else theta
    return theta, evaluations

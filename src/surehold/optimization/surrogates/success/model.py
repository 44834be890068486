"""Binary outcomes as a surrogate: a Gaussian process behind a probit likelihood, hyperparameters slice-sampled."""

import warnings
from math import log, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from surehold.defaults import (
    LENGTH_SCALE_DEVIATION,
    LENGTH_SCALE_MEDIAN,
    MANY_LEARNT,
    NUGGET,
    PARTICLES,
    SUCCESS_BURN_IN,
    SUCCESS_MEAN_VARIANCE,
    SUCCESS_PLACES,
    SUCCESS_SIGNAL_PRIOR,
    THIN,
)
from surehold.errors import InputError
from surehold.optimization.samplers.elliptical_slice import elliptical_slice_sample
from surehold.optimization.surrogates.gaussian_process.kernels import kernel_number
from surehold.optimization.surrogates.memory import Remembered, fingerprint, learnt_from
from surehold.optimization.surrogates.protocol import Posterior
from surehold.optimization.surrogates.success.laplace import Counts, log_posterior
from surehold.optimization.surrogates.success.posterior import SuccessPosterior

__all__ = ["SuccessProcess", "counted", "learnt"]

_LLOYD: Final = 10  # rounds of the clustering


class SuccessProcess:
    """A Gaussian process behind a probit likelihood, for trials that succeed or fail (Tesch et al. 2013, model only).

    Laplace's approximation for given hyperparameters, which are integrated out by slice sampling on its evidence; a
    constant mean of prior N(0, 1) is integrated out exactly.

    Parameters
    ----------
    kernel
        As of `GaussianProcess`.
    length_scales
        Fixed length-scales (d,) in box widths, together with `signal_variance`; None (default) learns both.
    signal_variance
        Fixed variance of the latent function, in probit units.
    """

    def __init__(
        self,
        *,
        kernel: str = "matern52",
        length_scales: NDArray[np.float64] | None = None,
        signal_variance: float | None = None,
        mean_variance: float = SUCCESS_MEAN_VARIANCE,
    ):
        self._kernel = kernel_number(kernel)
        if (length_scales is None) != (signal_variance is None):
            raise InputError("length_scales and signal_variance of a SuccessProcess are fixed together or not at all.")
        self._fixed = (
            None
            if length_scales is None or signal_variance is None
            else np.log(np.append(np.asarray(length_scales, dtype=np.float64), signal_variance))
        )
        self._mean_variance = mean_variance
        self._learnt = Remembered[tuple[NDArray[np.float64], int]]()

    @property
    def noisy(self) -> bool:
        """Observations carry noise: True."""
        return True

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
        trials: NDArray[np.float64] | None = None,
    ) -> SuccessPosterior:
        """Learn from X (n, d) in the unit cube and shares of success y (n,) of `trials` (n,), 1 each by default.

        Hyperparameters are learnt anew after every sixteenth part of the trials, as those of `GaussianProcess`; of many
        trials from some of them, evenly taken in their order.
        """
        of = np.ones(len(y)) if trials is None else np.asarray(trials, dtype=np.float64)
        counts = self._counts(X, y * of, of)
        if self._fixed is not None:
            return SuccessPosterior(counts, self._fixed[None, :], 0)
        stream, k = int(rng.integers(2**63)), learnt_from(len(y))
        some = np.linspace(0, k - 1, min(k, MANY_LEARNT)).round().astype(np.intp)
        key = fingerprint(X[some], y[some], of[some], stream)

        def taught() -> tuple[NDArray[np.float64], int]:
            early = self._counts(X[some], (y * of)[some], of[some])
            return learnt(early, np.random.default_rng([stream, k]))

        return SuccessPosterior(counts, *self._learnt.value(key, taught))

    def _counts(self, X: NDArray[np.float64], successes: NDArray[np.float64], trials: NDArray[np.float64]) -> Counts:
        return counted(X, successes, trials, self._kernel, self._mean_variance)


def learnt(counts: Counts, rng: np.random.Generator) -> tuple[NDArray[np.float64], int]:
    """Return particles (m, d + 1) of the hyperparameters, and how often their density was evaluated."""
    samples = elliptical_slice_sample(
        log_posterior,
        counts,
        counts.prior_mean,
        np.diag(counts.prior_deviation),
        rng,
        keep=PARTICLES,
        burn_in=SUCCESS_BURN_IN,
        thin=THIN,
    )
    return samples.states, samples.evaluations


def counted(
    X: NDArray[np.float64],
    successes: NDArray[np.float64],
    trials: NDArray[np.float64],
    kernel: int,
    mean_variance: float = SUCCESS_MEAN_VARIANCE,
) -> Counts:
    """Return the data of this many successes of trials (n,) at X (n, d), trials of the same input put together.

    Of more than `SUCCESS_PLACES` inputs, those near each other count as one at their mean: that of their cluster
    (Lloyd 1982), from starts evenly taken in their order, so that there are more where more was tried.
    """
    d = X.shape[1]
    places, which = np.unique(X, axis=0, return_inverse=True)
    which = which.ravel()
    if len(places) > SUCCESS_PLACES:
        starts = np.unique(X[np.linspace(0, len(X) - 1, SUCCESS_PLACES).round().astype(np.intp)], axis=0)
        with warnings.catch_warnings(action="ignore"):  # a cluster may lose all its points, and is dropped
            which = np.unique(kmeans2(X, starts, iter=_LLOYD, minit="matrix")[1], return_inverse=True)[1]
        weight = np.bincount(which, trials)
        places = np.stack([np.bincount(which, trials * X[:, k]) / weight for k in range(d)], axis=1)
    prior = [(log(LENGTH_SCALE_MEDIAN * sqrt(d)), LENGTH_SCALE_DEVIATION)] * d + [SUCCESS_SIGNAL_PRIOR]
    mean, deviation = np.array(prior).T
    return Counts(
        np.ascontiguousarray(places, dtype=np.float64),
        np.bincount(which, successes, len(places)).astype(np.float64),
        np.bincount(which, trials, len(places)).astype(np.float64),
        np.ascontiguousarray(mean),
        np.ascontiguousarray(deviation),
        NUGGET,
        mean_variance,
        kernel,
        np.empty((0, 2), dtype=np.int64),
    )

"""Gaussian-process regression with the hyperparameters integrated out by slice sampling: settings, learning, fitting.

What is learnt is a `GaussianProcessPosterior`; the formulas of its predictions are in `prediction`.
"""

from collections.abc import Sequence
from math import log, sqrt
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.defaults import (
    LENGTH_SCALE_DEVIATION,
    LENGTH_SCALE_MEDIAN,
    MANY,
    MANY_LEARNT,
    NUGGET,
    SURPRISE,
)
from surehold.errors import InputError
from surehold.optimization.numerics.threads import computing
from surehold.optimization.surrogates.gaussian_process.held import HELD, learn_held, mode_held
from surehold.optimization.surrogates.gaussian_process.heteroscedastic import with_learnt_noise
from surehold.optimization.surrogates.gaussian_process.hyperparameters import (
    Learning,
    Learnt,
    Prior,
    from_prior,
    learn,
    mode,
)
from surehold.optimization.surrogates.gaussian_process.kernels import KERNELS, kernel_number, shape_size
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence, log_posterior
from surehold.optimization.surrogates.gaussian_process.neighbors import NeighborPosterior
from surehold.optimization.surrogates.gaussian_process.observations import (
    NoiseName,
    checked_data,
    checked_noise,
    checked_noise_setting,
)
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization, checked_range
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.optimization.surrogates.memory import Remembered, fingerprint, learnt_from
from surehold.optimization.surrogates.protocol import Posterior, mixture

__all__ = ["GaussianProcess"]

_LOUDEST: Final = 1e100  # standard deviation of the noise, in those of the outputs; its square stays finite


class GaussianProcess:
    """Gaussian-process regression; the hyperparameters are integrated out by slice sampling.

    Parameters
    ----------
    kernel
        "matern52" (default), "matern32", "squared_exponential", or "matern52_product", the product of Matern-5/2
        correlations of single variables; one length-scale a dimension. "matern52_two_scales" is the sum of a long and
        a short process: how much of the variance is the short one's, and whether there is one at all, is learnt; and
        where there is none, whether the long one is "matern52" or "squared_exponential". In 2 to 30 variables the long
        one may also be a sum of processes of one variable each.
    signal_variance
        Fixed signal variance; None (default) learns it. In squared standard deviations of the outputs, or in squared
        units of the outputs where `standardize` is False.
    noise
        Standard deviation of the observation noise: "none" (default) for a function that gives the same answer
        again, a number in the outputs' units, "inferred" for one common standard deviation that is learnt, or
        "heteroscedastic" for one that differs from place to place and is learnt; it is as "inferred" until the
        observations show a difference. Known standard deviations of single observations are an argument of `fit`.
    ratio
        Nugget on the diagonal of the data's covariance, as a fraction of the signal variance: what keeps it
        factorizable.
    standardize
        Whether outputs are brought to zero mean and unit standard deviation before learning.
    output_range
        (lowest, highest) value to expect, if known: sets the scale while the trials do not show it yet.
    mean_variance
        Prior variance of a constant mean that is integrated out, in the units of `signal_variance`; 0 is a zero mean.
    prior
        Prior of the hyperparameters; by default length-scales have median 0.2 sqrt(d) box widths and a standard
        deviation of 1 in the logarithm.
    learning
        Slice sampling or maximum a posteriori, particles, sweeps.
    length_scales
        Fixed length-scales (d,) in box widths; of the rest is learnt what is asked for above: the signal variance where
        it is None, noise that is "inferred" or "heteroscedastic", the share of a second scale.

    Raises
    ------
    InputError
        For an unknown kernel, or numbers out of range.

    Examples
    --------
    >>> import numpy as np
    >>> X = np.linspace(0.0, 1.0, 9)[:, None]
    >>> mean, std = GaussianProcess().fit(X, np.sin(6.0 * X[:, 0])).predict([[0.5]], return_std=True)
    >>> bool(abs(mean[0] - np.sin(3.0)) < 1e-3)
    True
    """

    def __init__(
        self,
        *,
        kernel: str = "matern52",
        signal_variance: float | None = None,
        noise: float | NoiseName = "none",
        ratio: float = NUGGET,
        standardize: bool = True,
        output_range: tuple[float, float] | None = None,
        mean_variance: float = 0.0,
        prior: Prior | None = None,
        learning: Learning | None = None,
        length_scales: ArrayLike | None = None,
    ):
        self._kernel = kernel_number(kernel)
        self._signal_variance = None if signal_variance is None else _positive("signal_variance", signal_variance)
        self._noise = checked_noise_setting(noise)
        self._ratio = float(ratio)
        if not 0.0 <= self._ratio < 1.0:
            raise InputError(f"ratio is {ratio!r}; the nugget is a fraction of the signal variance, in [0, 1).")
        self._standardize = standardize
        self._output_range = checked_range(output_range)
        self._mean_variance = float(mean_variance)
        if not (np.isfinite(self._mean_variance) and self._mean_variance >= 0.0):
            raise InputError(f"mean_variance is {mean_variance!r}; give a finite number of 0 or more.")
        self._prior = prior
        self._learning = learning or Learning()
        self._length_scales = None if length_scales is None else np.asarray(length_scales, dtype=np.float64)
        if self._length_scales is not None and not np.all((self._length_scales > 0) & np.isfinite(self._length_scales)):
            raise InputError(f"length_scales are {length_scales!r}; give positive finite numbers, one a dimension.")
        self._posterior: GaussianProcessPosterior | NeighborPosterior | None = None
        self._learnt = Remembered[tuple[Standardization, Learnt]]()

    def __repr__(self) -> str:
        return f"GaussianProcess(kernel={KERNELS[self._kernel]!r}, noise={self._noise!r})"

    @property
    def known_noise(self) -> float | None:
        """Standard deviation of the observation noise, in the outputs' units, 0 for none; None where it is learnt."""
        if isinstance(self._noise, str):
            return 0.0 if self._noise == "none" else None
        return self._noise

    @property
    def noisy(self) -> bool:
        """Whether observations carry noise."""
        return self.known_noise != 0.0

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
        noise: NDArray[np.float64] | None = None,
    ) -> GaussianProcessPosterior | NeighborPosterior:
        """Learn the hyperparameters from X (n, d) in the unit cube and finite y (n,), n >= 1.

        From 32 trials on they are learnt from the first k of them, n - n/16 < k <= n, unless the later trials
        contradict what was learnt: k, and all that follows, depend on the trials and `rng` alone, and one more trial
        seldom costs a new learning. Of more than `defaults.MANY` trials a query is answered from those near it alone.
        `previous` is the posterior of the step before; its last particle starts the chains of the learning "slice".
        `noise` (n,) are known standard deviations of the observations, in the outputs' units, in place of the setting.
        """
        if len(y) > MANY and self._learns_at_once:
            return self._on_neighbors(learnt_from(len(y)), X, y, noise, int(rng.integers(2**63)))
        return self.condition_on_all(X, y, rng, previous, noise)

    def condition_on_all(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
        noise: NDArray[np.float64] | None = None,
    ) -> GaussianProcessPosterior:
        """Do as `condition` does, with all trials in one matrix, however many there are."""
        if not self._learns_at_once:
            last = previous.hyperparameters.theta[-1] if isinstance(previous, GaussianProcessPosterior) else None
            return self.condition_on_blocks(X, y, rng, self.standardization(y), start=last, noise=noise)
        n, stream = len(y), int(rng.integers(2**63))
        k = learnt_from(n)
        posterior = self._learnt_from(k, X, y, noise, stream)
        if k < n and (posterior.outputs.flat or posterior.surprise(k) > SURPRISE):
            posterior = self._learnt_from(n, X, y, noise, stream)
        return posterior

    @property
    def _learns_at_once(self) -> bool:
        """Whether hyperparameters are learnt, without a chain that goes on or noise at every single trial."""
        return self._learning.method != "slice" and not self._all_fixed and self._noise != "heteroscedastic"

    @property
    def _all_fixed(self) -> bool:
        """Whether nothing is learnt."""
        fixed = self._length_scales is not None and self._signal_variance is not None
        return fixed and self._noise not in ("inferred", "heteroscedastic") and not shape_size(self._kernel)

    def _learnt_from(
        self, k: int, X: NDArray[np.float64], y: NDArray[np.float64], noise: NDArray[np.float64] | None, stream: int
    ) -> GaussianProcessPosterior:
        """Return the posterior given all trials, with hyperparameters that were learnt from the first k of them."""
        outputs, (particles, cost) = self._remembered(slice(0, k), X, y, noise, np.random.default_rng([stream, k]))
        evidence = self._evidence(X, y, outputs, [len(y)], (1.0,), noise)
        return GaussianProcessPosterior(evidence, particles, outputs, cost)

    def _on_neighbors(
        self, k: int, X: NDArray[np.float64], y: NDArray[np.float64], noise: NDArray[np.float64] | None, stream: int
    ) -> NeighborPosterior:
        """Return the posterior given many trials, with hyperparameters learnt from some of the first k.

        Every so manieth in their order: early trials are spread over the box, late ones lie where the function is high.
        """
        some = slice(0, k, -(-k // MANY_LEARNT))
        outputs, (particles, cost) = self._remembered(some, X, y, noise, np.random.default_rng([stream, k]))
        return NeighborPosterior(self._evidence(X, y, outputs, [len(y)], (1.0,), noise), particles, outputs, cost)

    def _remembered(
        self,
        part: slice,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        noise: NDArray[np.float64] | None,
        rng: np.random.Generator,
    ) -> tuple[Standardization, Learnt]:
        """Return the scale of the outputs and the hyperparameters that a part of the trials teaches, once."""
        X, y, noise = X[part], y[part], None if noise is None else noise[part]
        key = fingerprint(X, y, noise, rng.bit_generator.state)

        def taught() -> tuple[Standardization, Learnt]:
            outputs = self.standardization(y)
            evidence = self._evidence(X, y, outputs, [len(y)], (1.0,), noise)
            return outputs, self._learn(evidence, outputs, rng, None)

        return self._learnt.value(key, taught)

    def _learn(
        self, evidence: Evidence, outputs: Standardization, rng: np.random.Generator, start: NDArray[np.float64] | None
    ) -> Learnt:
        held = self._length_scales is not None
        if outputs.flat and self._standardize and not self._all_fixed:
            learnt = from_prior(evidence, self._learning.particles, rng)
            if held:
                learnt.particles[:, : evidence.X.shape[1]] = evidence.prior_mean[: evidence.X.shape[1]]
            return learnt
        return (learn_held if held else learn)(evidence, self._learning, rng, start)

    def standardization(self, y: NDArray[np.float64]) -> Standardization:
        """Return the map of outputs y (n,) to the scale on which this process learns."""
        return Standardization.of(y, self._output_range) if self._standardize else Standardization.identity(y)

    def centered(self, outputs: Standardization, y: NDArray[np.float64]) -> Standardization:
        """Return a map with the scale of `outputs` but the mean of outputs y (n,), if this process standardizes."""
        return outputs._replace(shift=float(y.mean()), flat=False) if self._standardize else outputs

    def condition_on_blocks(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        outputs: Standardization,
        *,
        sizes: Sequence[int] | None = None,
        weights: ArrayLike = (1.0,),
        start: NDArray[np.float64] | None = None,
        noise: NDArray[np.float64] | None = None,
    ) -> GaussianProcessPosterior:
        """Learn the hyperparameters from the weighted likelihoods of independent blocks; predict from the first one.

        Parameters
        ----------
        X, y
            Trials (n, d) in the unit cube and finite outputs (n,), block after block.
        outputs
            Map of the outputs to the scale on which is learnt.
        sizes, weights
            Number of trials and weight of each block; by default all trials are one block of weight 1.
        start : (p,)
            Last particle of the step before, or None.
        noise : (n,)
            Known standard deviations of the observations, in the outputs' units, in place of the setting.
        """
        evidence = self._evidence(X, y, outputs, [len(y)] if sizes is None else sizes, weights, noise)
        log_noise = None
        if self._noise == "heteroscedastic" and noise is None and not outputs.flat:
            evidence, log_noise = with_learnt_noise(evidence)
        particles, cost = self._learn(evidence, outputs, rng, start)
        return GaussianProcessPosterior(evidence.first_block(), particles, outputs, cost, log_noise=log_noise)

    def log_evidence(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        outputs: Standardization,
        noise: NDArray[np.float64] | None = None,
    ) -> float:
        """Return about log p(y | X), hyperparameters integrated out: their mode's, less p/2 log n (Schwarz 1978).

        Arguments as in `condition_on_blocks`.
        """
        evidence = self._evidence(X, y, outputs, [len(y)], (1.0,), noise)
        if self._length_scales is None:
            theta, _ = mode(evidence)
            return float(log_posterior(theta, evidence)) - 0.5 * theta.size * log(len(y))
        theta, _ = mode_held(evidence)
        d = X.shape[1]
        mean, deviation = self._prior_in(d).log_length_scale
        away = np.broadcast_to((np.log(self._length_scales) - mean) / deviation, (d,))
        given = -0.5 * float(away @ away) + d * log(HELD / deviation)  # what the prior says of them, in place of HELD
        return float(log_posterior(theta, evidence)) + given - 0.5 * (theta.size - d) * log(len(y))

    def _prior_in(self, d: int) -> Prior:
        return self._prior or Prior((log(LENGTH_SCALE_MEDIAN * sqrt(d)), LENGTH_SCALE_DEVIATION))

    def _evidence(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        outputs: Standardization,
        sizes: Sequence[int],
        weights: ArrayLike,
        noise: NDArray[np.float64] | None,
    ) -> Evidence:
        d = X.shape[1]
        if self._length_scales is not None and self._length_scales.shape not in ((), (1,), (d,)):
            raise InputError(f"length_scales have shape {self._length_scales.shape}; the inputs need ({d},).")
        known = noise if noise is not None else np.full(len(y), 0.0 if isinstance(self._noise, str) else self._noise)
        learn_signal = self._signal_variance is None
        learn_noise = self._noise in ("inferred", "heteroscedastic") and noise is None
        prior_mean, prior_deviation = self._prior_in(d).vectors(d, learn_signal, learn_noise, self._kernel)
        if self._length_scales is not None:
            prior_mean[:d], prior_deviation[:d] = np.log(self._length_scales), HELD
        return Evidence(
            np.ascontiguousarray(X, dtype=np.float64),
            np.ascontiguousarray(outputs.apply(y)),
            np.minimum(known / outputs.scale, _LOUDEST) ** 2,
            np.cumsum([0, *sizes]),
            np.array(weights, dtype=np.float64),
            prior_mean,
            prior_deviation,
            1.0 if self._signal_variance is None else self._signal_variance,
            self._ratio,
            self._mean_variance,
            self._kernel,
            learn_signal,
            learn_noise,
        )

    def fit(self, X: ArrayLike, y: ArrayLike, seed: int = 0, *, noise: ArrayLike | None = None) -> "GaussianProcess":
        """Learn from X (n, d), preferably scaled to the unit cube, and y (n,); returns itself.

        `noise` (n,) are known standard deviations of the observations, in the outputs' units; they replace the setting
        of the same name.

        Raises
        ------
        InputError
            If shapes do not fit, a value is not finite, or a standard deviation is negative.
        """
        inputs, outputs = checked_data(X, y)
        known = None if noise is None else checked_noise(noise, len(outputs))
        with computing():
            self._posterior = self.condition(inputs, outputs, np.random.default_rng(seed), noise=known)
        return self

    @property
    def posterior(self) -> GaussianProcessPosterior | NeighborPosterior:
        """What `fit` has learnt."""
        if self._posterior is None:
            raise InputError("this GaussianProcess has seen no data; call fit(X, y) first.")
        return self._posterior

    def predict(self, X: ArrayLike, return_std: bool = False):
        """Return the mean (q,) at X (q, d), and the standard deviation (q,) of the latent function where asked for."""
        queries, _ = checked_data(X, None, self.posterior.evidence.X.shape[1])
        with computing():
            mean, variance = mixture(self.posterior.moments(queries))
        return (mean, np.sqrt(variance)) if return_std else mean

    def noise_std(self, X: ArrayLike) -> NDArray[np.float64]:
        """Return the standard deviation of the observation noise (q,) at X (q, d): what is known of it, or learnt.

        Of known standard deviations of single observations the quadratic mean is taken.
        """
        queries, _ = checked_data(X, None, self.posterior.evidence.X.shape[1])
        return np.sqrt(self.posterior.noise_variance(queries).mean(axis=0))


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{name} is {value!r}; give a positive finite number.")
    return float(value)

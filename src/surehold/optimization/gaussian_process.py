"""Gaussian-process regression with the hyperparameters integrated out by slice sampling: settings, learning, fitting.

What is learnt is a `GaussianProcessPosterior`; the formulas of its predictions are in `prediction`.
"""

from math import log, sqrt
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.gaussian_process_posterior import GaussianProcessPosterior
from surehold.optimization.hyperparameters import Learning, Prior, from_prior, learn
from surehold.optimization.kernels import kernel_number
from surehold.optimization.likelihood import Evidence
from surehold.optimization.outputs import Standardization, checked_range
from surehold.optimization.surrogate import Posterior, mixture
from surehold.optimization.threads import single_threaded

__all__ = ["GaussianProcess"]


class GaussianProcess:
    """Gaussian-process regression; the hyperparameters are integrated out by slice sampling.

    Parameters
    ----------
    kernel
        "matern52" (default), "matern32", "squared_exponential", or "matern52_product", the product of Matern-5/2
        correlations of single variables; one length-scale a dimension.
    signal_variance
        Fixed signal variance; None (default) learns it. In squared standard deviations of the outputs, or in squared
        units of the outputs where `standardize` is False.
    noise
        Standard deviation of the observation noise: "none" (default) for a function that gives the same answer
        again, a number in the outputs' units, or "inferred".
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
        Fixed length-scales (d,) in box widths; nothing is learnt but what is asked for above.

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
        noise: float | Literal["none", "inferred"] = "none",
        ratio: float = 1e-10,
        standardize: bool = True,
        output_range: tuple[float, float] | None = None,
        mean_variance: float = 0.0,
        prior: Prior | None = None,
        learning: Learning | None = None,
        length_scales: ArrayLike | None = None,
    ):
        self._kernel = kernel_number(kernel)
        self._signal_variance = None if signal_variance is None else _positive("signal_variance", signal_variance)
        if isinstance(noise, str):
            if noise not in ("none", "inferred"):
                raise unknown_name("observation noise", noise, ("none", "inferred", "a standard deviation"))
        elif not (np.isfinite(noise) and noise >= 0.0):
            raise InputError(f"observation noise is {noise!r}; give a finite standard deviation of 0 or more.")
        self._noise = noise
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
        self._posterior: GaussianProcessPosterior | None = None

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
    ) -> GaussianProcessPosterior:
        """Learn the hyperparameters from X (n, d) in the unit cube and finite y (n,), n >= 1.

        `previous` is the posterior of the step before; its last particle starts the chain where the learning says so.
        """
        d = X.shape[1]
        if self._length_scales is not None and self._length_scales.shape not in ((), (1,), (d,)):
            raise InputError(f"length_scales have shape {self._length_scales.shape}; the inputs need ({d},).")
        outputs = Standardization.of(y, self._output_range) if self._standardize else Standardization.identity(y)
        known = 0.0 if isinstance(self._noise, str) else min(self._noise / outputs.scale, 1e100) ** 2
        learn_signal, learn_noise = self._signal_variance is None, self._noise == "inferred"
        prior = self._prior or Prior((log(0.2 * sqrt(d)), 1.0))
        prior_mean, prior_deviation = prior.vectors(d, learn_signal, learn_noise)
        evidence = Evidence(
            np.ascontiguousarray(X, dtype=np.float64),
            np.ascontiguousarray(outputs.apply(y)),
            np.full(len(y), known),
            np.array([0, len(y)]),
            np.ones(1),
            prior_mean,
            prior_deviation,
            1.0 if self._signal_variance is None else self._signal_variance,
            self._ratio,
            self._mean_variance,
            self._kernel,
            learn_signal,
            learn_noise,
        )
        if self._length_scales is not None:
            theta = prior_mean.copy()
            theta[:d] = np.log(np.broadcast_to(self._length_scales, (d,)))
            return GaussianProcessPosterior(evidence, theta[None, :], outputs, 0)
        if outputs.flat and self._standardize:
            learnt = from_prior(evidence, self._learning.particles, rng)
        else:
            last = previous.hyperparameters.theta[-1] if isinstance(previous, GaussianProcessPosterior) else None
            learnt = learn(evidence, self._learning, rng, last)
        return GaussianProcessPosterior(evidence, learnt.particles, outputs, learnt.evaluations)

    def fit(self, X: ArrayLike, y: ArrayLike, seed: int = 0) -> "GaussianProcess":
        """Learn from X (n, d), preferably scaled to the unit cube, and y (n,); returns itself.

        Raises
        ------
        InputError
            If shapes do not fit or a value is not finite.
        """
        inputs, outputs = checked_data(X, y)
        with single_threaded():
            self._posterior = self.condition(inputs, outputs, np.random.default_rng(seed))
        return self

    @property
    def posterior(self) -> GaussianProcessPosterior:
        """What `fit` has learnt."""
        if self._posterior is None:
            raise InputError("this GaussianProcess has seen no data; call fit(X, y) first.")
        return self._posterior

    def predict(self, X: ArrayLike, return_std: bool = False):
        """Return the mean (q,) at X (q, d), and the standard deviation (q,) of the latent function where asked for."""
        queries, _ = checked_data(X, None, self.posterior.evidence.X.shape[1])
        with single_threaded():
            mean, variance = mixture(self.posterior.moments(queries))
        return (mean, np.sqrt(variance)) if return_std else mean


def checked_data(
    X: ArrayLike, y: ArrayLike | None, d: int | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return X (n, d) and y (n,) as float64 arrays (y empty where None); raises InputError where they do not fit."""
    try:
        inputs = np.ascontiguousarray(X, dtype=np.float64)
        outputs = np.ascontiguousarray([] if y is None else y, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("X and y must be numeric arrays of shapes (n, d) and (n,).") from None
    if inputs.ndim != 2 or inputs.shape[1] == 0 or (d is not None and inputs.shape[1] != d):
        wanted = "(n, d)" if d is None else f"(q, {d})"
        raise InputError(f"X has shape {inputs.shape}; it must be {wanted}: one row a point.")
    if y is not None and outputs.shape != (len(inputs),):
        raise InputError(f"y has shape {outputs.shape}, but X has {len(inputs)} rows; give one output a row.")
    if y is not None and len(inputs) == 0:
        raise InputError("X has no rows; give at least one observation.")
    for name, values in (("X", inputs), ("y", outputs)):
        if not np.all(np.isfinite(values)):
            raise InputError(f"{name} holds NaN or infinity; remove those observations first.")
    return inputs, outputs


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{name} is {value!r}; give a positive finite number.")
    return float(value)

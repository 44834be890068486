"""Gaussian-process regression with the hyperparameters integrated out by slice sampling.

Legend (the thesis' symbols in brackets)
    X, y       trials: inputs (n, d) in the unit cube, outputs (n,)
    theta_j    particle j of m: log length-scales, log signal variance, log noise variance    [theta_1..theta_m]
    k_j        covariance of the query with X under particle j, (n,)
    A_j        covariance of the data under particle j, (n, n) = L_j L_j'
    mean_j     k_j' A_j^-1 y                                                                   thesis (3.5)
    variance_j k_j(x, x) - k_j' A_j^-1 k_j                                                     thesis (3.6)

A weighted sum of function values, sum_i w_i f(x + xi_i), is itself Gaussian under each particle: its covariance with
the data is sum_i w_i k_j(x + xi_i, X) and its prior variance sum_ij w_i w_j k_j(xi_i, xi_j). With one offset of 0 that
is f(x) itself, so one compiled function serves both.
"""

from math import log, sqrt
from typing import Final, Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, SureholdError, unknown_name
from surehold.optimization.hyperparameters import Learning, Prior, from_prior, learn
from surehold.optimization.kernels import correlation_and_factor, cross_correlation, kernel_number
from surehold.optimization.likelihood import (
    Evidence,
    cholesky,
    data_covariance,
    invert_lower,
    solve_lower,
    solve_lower_transposed,
)
from surehold.optimization.outputs import Standardization, checked_range
from surehold.optimization.surrogate import FitDiagnostics, Moments, Posterior, mixture
from surehold.optimization.threads import single_threaded

__all__ = ["GaussianProcess", "GaussianProcessPosterior"]

_LARGEST_REPAIR = 1e-2  # nugget ratio beyond which a factorization is given up


@njit(cache=True)
def _factorize(X, Y, noise, inverse_l, s2, v, ratio, mean_variance, kernel, inverse_L, alpha):
    """Fill inverse_L (m, n, n) and alpha (m, n) = A^-1 y_j; return how many nuggets were enlarged, -1 on failure."""
    m, n = Y.shape
    repaired = 0
    A = np.empty((n, n))
    for j in range(m):
        nugget = ratio
        while True:
            data_covariance(X, noise, inverse_l[j], s2[j], v[j], nugget, mean_variance, kernel, A)
            if cholesky(A):
                break
            nugget = max(10.0 * nugget, 1e-12)
            if nugget > _LARGEST_REPAIR:
                return -1
        if nugget > ratio:
            repaired += 1
        alpha[j] = Y[j]
        solve_lower(A, alpha[j])
        solve_lower_transposed(A, alpha[j])
        invert_lower(A, inverse_L[j])
    return repaired


@njit(cache=True, fastmath={"reassoc", "contract"})
def _weighted_sums(C, weights, out):
    """Fill out (n, q) with the sums over s of weights (s,) times the columns of C (n, q s)."""
    s = weights.size
    for a in range(out.shape[0]):
        for i in range(out.shape[1]):
            t = 0.0
            for w in range(s):
                t += weights[w] * C[a, i * s + w]
            out[a, i] = t


@njit(cache=True, fastmath={"reassoc", "contract"})
def _weighted_slopes(F, X, Z, slopes, weights, k, out):
    """Fill out (n, q) with the sums over s of -weights g (z_k - x_k) slope, for radial factors F (n, q s).

    Z (d, q s) are the perturbed points, slopes (d, q s) their derivatives by the query.
    """
    s = weights.size
    for a in range(out.shape[0]):
        x = X[a, k]
        for i in range(out.shape[1]):
            t = 0.0
            for w in range(s):
                c = i * s + w
                t -= weights[w] * F[a, c] * (Z[k, c] - x) * slopes[k, c]
            out[a, i] = t


@njit(cache=True)
def _average(Q, offsets, slopes, weights, X, inverse_l, s2, mean_variance, kernel, inverse_L, alpha, gradient):
    """Return mean, variance (m, q) and their gradients (m, q, d) of the weighted sums at Q (q, d).

    offsets (b, s, d): the same perturbations for every query (b = 1) or its own for each (b = q); slopes (b, s, d):
    derivative of each coordinate of query + offset by that coordinate of the query.
    """
    m, n = alpha.shape
    q, d = Q.shape
    s = weights.size
    last = offsets.shape[0] - 1
    points = np.empty((q * s, d))
    slope = np.ones((d, q * s if gradient else 0))
    for i in range(q):
        for w in range(s):
            for k in range(d):
                points[i * s + w, k] = Q[i, k] + offsets[min(i, last), w, k]
                if gradient:
                    slope[k, i * s + w] = slopes[min(i, last), w, k]
    Z = np.ascontiguousarray(points.T)
    mean = np.zeros((m, q))
    variance = np.empty((m, q))
    mean_gradient = np.zeros((m, q if gradient else 0, d))
    variance_gradient = np.zeros((m, q if gradient else 0, d))
    C = np.empty((n, q * s))
    F = np.empty((n, q * s if gradient else 0))
    K = np.empty((n, q))
    D = np.empty((n, q if gradient else 0))
    own = np.empty((s, s))
    own_factor = np.empty((s, s))
    shift = mean_variance * weights.sum()
    for j in range(m):
        for b in range(offsets.shape[0]):
            xi = offsets[b]
            correlation_and_factor(kernel, xi, xi, inverse_l[j], own, own_factor)
            prior = 0.0
            for w in range(s):
                for o in range(s):
                    prior += weights[w] * weights[o] * (s2[j] * own[w, o] + mean_variance)
            variance[j, b:] = prior
            if gradient:
                for k in range(d):
                    t = 0.0
                    for w in range(s):
                        for o in range(s):
                            step = (xi[w, k] - xi[o, k]) * (slopes[b, w, k] - slopes[b, o, k])
                            t -= weights[w] * weights[o] * own_factor[w, o] * step
                    variance_gradient[j, b:, k] = s2[j] * t * inverse_l[j, k] ** 2
        if gradient:
            correlation_and_factor(kernel, X, points, inverse_l[j], C, F)
        else:
            cross_correlation(kernel, X, points, inverse_l[j], C)
        _weighted_sums(C, s2[j] * weights, K)
        if shift != 0.0:
            K += shift
        V = np.dot(inverse_L[j], K)
        for a in range(n):
            for i in range(q):
                mean[j, i] += alpha[j, a] * K[a, i]
                variance[j, i] -= V[a, i] * V[a, i]
        if gradient:
            W = np.dot(inverse_L[j].T, V)
            for k in range(d):
                _weighted_slopes(F, X, Z, slope, s2[j] * inverse_l[j, k] ** 2 * weights, k, D)
                for a in range(n):
                    for i in range(q):
                        mean_gradient[j, i, k] += alpha[j, a] * D[a, i]
                        variance_gradient[j, i, k] -= 2.0 * W[a, i] * D[a, i]
    return mean, np.maximum(variance, 0.0), mean_gradient, variance_gradient


@njit(cache=True)
def _sample(P, normals, X, inverse_l, s2, mean_variance, kernel, inverse_L, alpha):
    """Return joint draws (m, q, b, s) of f at the points P (q, s, d), from standard normals (b, s)."""
    m, n = alpha.shape
    q, s, _ = P.shape
    draws = np.empty((m, q, normals.shape[0], s))
    K = np.empty((n, s))
    C = np.empty((s, s))
    for j in range(m):
        for i in range(q):
            cross_correlation(kernel, X, P[i], inverse_l[j], K)
            for a in range(n):
                for w in range(s):
                    K[a, w] = s2[j] * K[a, w] + mean_variance
            V = np.dot(inverse_L[j], K)
            cross_correlation(kernel, P[i], P[i], inverse_l[j], C)
            for w in range(s):
                for o in range(s):
                    C[w, o] = s2[j] * C[w, o] + mean_variance
            C -= np.dot(V.T, V)
            nugget = 1e-10 * (s2[j] + mean_variance)
            root = C.copy()
            while True:
                for w in range(s):
                    root[w, w] = C[w, w] + nugget
                if cholesky(root):
                    break
                root[:] = C
                nugget *= 10.0
            mean = np.dot(alpha[j], K)
            for b in range(normals.shape[0]):
                for w in range(s):
                    t = mean[w]
                    for o in range(w + 1):
                        t += root[w, o] * normals[b, o]
                    draws[j, i, b, w] = t
    return draws


class Hyperparameters(NamedTuple):
    """The particles, unpacked."""

    theta: NDArray[np.float64]
    """(m, p)"""
    inverse_l: NDArray[np.float64]
    """inverse length-scales, (m, d)"""
    s2: NDArray[np.float64]
    """signal variances in standardized units, (m,)"""
    v: NDArray[np.float64]
    """learnt noise variances in standardized units, (m,)"""


class GaussianProcessPosterior:
    """A Gaussian process conditioned on trials, a mixture over the particles of its hyperparameters.

    Built by `GaussianProcess.condition`. `evidence` holds the trials in standardized units, `outputs` the map
    back; `Y` (m, n) are the outputs that each particle has seen, which differ only at pending trials.
    """

    def __init__(
        self,
        evidence: Evidence,
        theta: NDArray[np.float64],
        outputs: Standardization,
        cost: int,
        Y: NDArray[np.float64] | None = None,
    ):
        m, d = len(theta), evidence.X.shape[1]
        n = len(evidence.X)
        self.evidence: Final = evidence
        self.outputs: Final = outputs
        self.hyperparameters: Final = Hyperparameters(
            theta,
            np.exp(-theta[:, :d]),
            np.exp(theta[:, d]) if evidence.learn_signal else np.full(m, evidence.signal_variance),
            np.exp(theta[:, -1]) if evidence.learn_noise else np.zeros(m),
        )
        self._Y: Final = np.ascontiguousarray(np.broadcast_to(evidence.y, (m, n)) if Y is None else Y)
        self._inverse_L: Final = np.empty((m, n, n))
        self._alpha: Final = np.empty((m, n))
        repaired = _factorize(
            evidence.X,
            self._Y,
            evidence.noise,
            self.hyperparameters.inverse_l,
            self.hyperparameters.s2,
            self.hyperparameters.v,
            evidence.ratio,
            evidence.mean_variance,
            evidence.kernel,
            self._inverse_L,
            self._alpha,
        )
        if repaired < 0:
            raise SureholdError("the covariance of the trials could not be factorized; are outputs of sane size?")
        self.diagnostics: Final = FitDiagnostics(n, cost, repaired, outputs.flat)

    @property
    def length_scales(self) -> NDArray[np.float64]:
        """Length-scales of the particles, (m, d), in widths of the unit cube."""
        return 1.0 / self.hyperparameters.inverse_l

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(query + offsets[i]) for queries (q, d).

        offsets are (s, d), or (q, s, d) where each query has its own; slopes, of the same shape and 1 by default, are
        the derivatives of query + offset by the query, coordinate by coordinate.
        """
        shape = (-1, *offsets.shape[-2:])
        mean, variance, mean_gradient, variance_gradient = _average(
            np.ascontiguousarray(queries),
            np.ascontiguousarray(offsets).reshape(shape),
            np.ascontiguousarray(np.ones_like(offsets) if slopes is None else slopes).reshape(shape),
            np.ascontiguousarray(weights),
            self.evidence.X,
            self.hyperparameters.inverse_l,
            self.hyperparameters.s2,
            self.evidence.mean_variance,
            self.evidence.kernel,
            self._inverse_L,
            self._alpha,
            gradient,
        )
        scale = self.outputs.scale
        return Moments(
            self.outputs.shift * weights.sum() + scale * mean,
            self.outputs.square * variance,
            scale * mean_gradient if gradient else None,
            self.outputs.square * variance_gradient if gradient else None,
        )

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f at queries (q, d)."""
        return self.average(queries, np.zeros((1, queries.shape[1])), np.ones(1), gradient)

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s)."""
        draws = _sample(
            np.ascontiguousarray(points),
            np.ascontiguousarray(normals),
            self.evidence.X,
            self.hyperparameters.inverse_l,
            self.hyperparameters.s2,
            self.evidence.mean_variance,
            self.evidence.kernel,
            self._inverse_L,
            self._alpha,
        )
        return self.outputs.shift + self.outputs.scale * draws

    def with_pending(self, X: NDArray[np.float64]) -> "GaussianProcessPosterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d): only variances shrink."""
        believed = self.outputs.apply(self.moments(X).mean)  # (m, k)
        noise = np.full(len(X), self.evidence.noise.mean() if len(self.evidence.noise) else 0.0)
        extended = self.evidence._replace(
            X=np.concatenate([self.evidence.X, X]),
            y=np.concatenate([self.evidence.y, believed.mean(axis=0)]),
            noise=np.concatenate([self.evidence.noise, noise]),
            offsets=np.array([0, len(self.evidence.X) + len(X)]),
        )
        Y = np.concatenate([self._Y, believed], axis=1)
        theta = self.hyperparameters.theta
        return GaussianProcessPosterior(extended, theta, self.outputs, self.diagnostics.evaluations, Y)


class GaussianProcess:
    """Gaussian-process regression; the hyperparameters are integrated out by slice sampling.

    Parameters
    ----------
    kernel
        "matern52" (default), "matern32" or "squared_exponential", one length-scale a dimension.
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
        ratio: float = 1e-8,
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

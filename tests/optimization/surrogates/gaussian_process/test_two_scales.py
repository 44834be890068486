"""Learning whether a response has one scale or two, and whether one scale is rough or smooth."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern

from surehold.optimization.surrogates.gaussian_process import hyperparameters
from surehold.optimization.surrogates.gaussian_process.hyperparameters import (
    Learning,
    log_evidence_and_root,
    mode,
    shared_out,
)
from surehold.optimization.surrogates.gaussian_process.kernels import correlation, kernel_number
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.protocol import mixture


def smooth(X):
    return np.sin(5.0 * X[:, 0]) + X[:, 1] ** 2


def rough(X):
    """A hill, and roughness much finer than the spacing of trials."""
    return smooth(X) + 0.5 * np.sign(np.sin(300.0 * X[:, 0]) * np.sin(170.0 * X[:, 1]))


def trials(f, n=60, seed=0):
    X = np.random.default_rng(seed).random((n, 2))
    return X, f(X)


def drawn(kernel, seed, length_scale=0.3):
    """Return a function that draws its values at X from a process of one scale."""

    def f(X):
        K = correlation(kernel, X, X, np.full(2, length_scale)) + 1e-10 * np.eye(len(X))
        return np.linalg.cholesky(K) @ np.random.default_rng(seed + 100).standard_normal(len(X))

    return f


def particles_of(f, seed=0, n=60):
    """Return how many particles are rough of one scale, smooth, and of two scales."""
    posterior = GaussianProcess(kernel="matern52_two_scales", mean_variance=1.0).fit(*trials(f, n, seed)).posterior
    a, w = posterior.hyperparameters.inverse_l[:, 2:].T
    alone = w < 1e-20
    return np.sum(alone & (a >= 1e-20)), np.sum(alone & (a < 1e-20)), np.sum(~alone)


def test_a_smooth_function_has_one_smooth_scale():
    assert particles_of(smooth) == (0, 10, 0)


def test_a_rough_function_has_two_scales():
    assert particles_of(rough) == (0, 0, 10)


@pytest.mark.parametrize("seed", range(3))
def test_draws_of_a_process_are_modelled_as_that_process(seed):
    assert particles_of(drawn("squared_exponential", seed), seed)[1] == 10
    assert particles_of(drawn("matern52", seed), seed)[0] >= 8


def test_of_twenty_trials_few_rough_functions_are_called_smooth_and_few_smooth_ones_are_not():
    """By the evidence alone a quarter of the particles of rough draws were smooth, and such a model is too sure."""
    smooth_particles = {
        kernel: np.array([particles_of(drawn(kernel, seed, 0.6), seed, 20)[1] for seed in range(20)])
        for kernel in ("matern52", "squared_exponential")
    }
    assert smooth_particles["matern52"].max() < 8
    assert smooth_particles["matern52"].mean() < 1.0
    assert smooth_particles["squared_exponential"].mean() > 9.0


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_what_is_white_noise_along_a_variable_is_not_called_smooth(seed, monkeypatch):
    """Trials in sixty columns that tell nothing of each other: the evidence alone would be for the smooth model."""

    def smooth_particles(length_scale):
        rng = np.random.default_rng(seed)
        X = np.column_stack([rng.integers(60, size=100) / 59.0, rng.random(100)])
        K = correlation("squared_exponential", X, X, np.array([length_scale, 0.6])) + 1e-10 * np.eye(100)
        y = np.linalg.cholesky(K) @ rng.standard_normal(100)
        posterior = GaussianProcess(kernel="matern52_two_scales", mean_variance=1.0).fit(X, y).posterior
        return np.sum(np.all(posterior.hyperparameters.inverse_l[:, 2:] < 1e-20, axis=1))

    assert smooth_particles(0.002) == 0
    assert smooth_particles(0.05) == 10
    monkeypatch.setattr(hyperparameters, "SMOOTH_LEAST", 1e-9)
    assert smooth_particles(0.002) >= 5


def test_where_trials_are_dense_a_short_wave_is_smooth():
    def waves(X):
        return np.sin(50.0 * np.pi * X[:, 0]) + np.sin(34.0 * np.pi * X[:, 0] + 1.0)

    rng = np.random.default_rng(0)
    X, Q = rng.random((150, 1)), rng.random((200, 1))
    model = GaussianProcess(kernel="matern52_two_scales", mean_variance=1.0).fit(X, waves(X))
    assert model.posterior.length_scales.max() < hyperparameters.SMOOTH_LEAST
    assert np.sqrt(np.mean((model.predict(Q) - waves(Q)) ** 2)) < 0.01


def test_rough_between_trials_it_predicts_the_trend_and_knows_what_it_does_not_know():
    """One stationary process calls the trend noise-free and short; at fresh inputs it errs more."""
    X, y = trials(rough)
    Q, truth = trials(rough, n=2000, seed=1)
    errors = {}
    for kernel, constant in (("matern52", 0.0), ("matern52_two_scales", 1.0)):
        mean, std = GaussianProcess(kernel=kernel, mean_variance=constant).fit(X, y).predict(Q, return_std=True)
        errors[kernel] = np.sqrt(np.mean((mean - truth) ** 2))
    assert errors["matern52_two_scales"] < 0.9 * errors["matern52"]
    assert 0.9 < np.mean(np.abs(mean - truth) < 1.96 * std) < 0.999


@pytest.mark.parametrize(("f", "tolerance"), [(rough, 1e-5), (smooth, 2e-4), (drawn("matern52", 0), 1e-5)])
def test_particles_predict_as_scikit_learn(f, tolerance, monkeypatch):
    monkeypatch.setattr(hyperparameters, "ADDITIVE_UP_TO", 1)  # no sums: those are of test_additive
    X, y = trials(f, 30)
    Q, _ = trials(f, 7, 1)
    posterior = GaussianProcess(kernel="matern52_two_scales", ratio=1e-8).fit(X, y).posterior
    found, p = posterior.moments(Q), posterior.hyperparameters
    for j, scales in enumerate(posterior.length_scales):
        a, w = p.inverse_l[j, 2:]
        kernel = ConstantKernel(p.s2[j] * (1.0 - w)) * (RBF(scales) if a < 1e-20 else Matern(scales, nu=2.5))
        if w >= 1e-20:
            kernel += ConstantKernel(p.s2[j] * w) * Matern(scales / a, nu=2.5)
        reference = GaussianProcessRegressor(kernel, alpha=1e-8 * p.s2[j], optimizer=None, normalize_y=True).fit(X, y)
        mean, std = reference.predict(Q, return_std=True)
        np.testing.assert_allclose(found.mean[j], mean, atol=tolerance)
        np.testing.assert_allclose(np.sqrt(found.variance[j]), std, atol=1e-4)


def test_particles_are_shared_out_by_evidence():
    """By largest remainders: of ten, .55, .25 and .2 are 5.5, 2.5 and 2, and the first of two equal remainders wins."""
    assert shared_out(np.log([0.5, 0.3, 0.2]) - 700.0, 10) == [5, 3, 2]
    assert shared_out(np.log([0.55, 0.25, 0.2]) + 700.0, 10) == [6, 2, 2]
    assert shared_out(np.array([0.0, np.nan, 0.0]), 4) == [2, 0, 2]
    assert shared_out(np.full(3, np.nan), 10) == [10, 0, 0]
    assert shared_out(np.array([-np.inf, -3.0, -2.0]), 1) == [0, 0, 1]


def test_evidence_is_the_integral_over_the_hyperparameter():
    """Laplace's method beside quadrature, in one hyperparameter."""
    rng = np.random.default_rng(3)
    X = np.sort(rng.random((40, 1)), axis=0)
    y = np.sin(12.0 * X[:, 0]) + 0.1 * rng.standard_normal(40)
    evidence = Evidence(
        X=X, y=y, noise=np.full(40, 0.01), offsets=np.array([0, 40]), weights=np.ones(1), prior_mean=np.array([-1.5]),
        prior_deviation=np.ones(1), signal_variance=1.0, ratio=0.0, mean_variance=0.0,
        kernel=kernel_number("matern52"), learn_signal=False, learn_noise=False,
    )  # fmt: skip
    center, _ = mode(evidence)
    found, root = log_evidence_and_root(evidence, center)

    def density(t, shift):
        A = correlation("matern52", X, X, np.exp([t])) + 0.01 * np.eye(40)
        return np.exp(multivariate_normal.logpdf(y, np.zeros(40), A) + norm.logpdf(t, -1.5, 1.0) - shift)

    integral = quad(density, center[0] - 2.0, center[0] + 2.0, args=(found,), points=[center[0]])[0]
    assert np.log(integral) == pytest.approx(0.0, abs=0.1)
    assert 0.0 < root[0, 0] < 1.0


@pytest.mark.parametrize("method", ["map", "elliptical_slice"])
def test_every_way_to_learn(method):
    X, y = trials(rough, 40)
    learning = Learning(method=method, particles=6)
    process = GaussianProcess(kernel="matern52_two_scales", learning=learning).fit(X, y)
    assert len(process.posterior.length_scales) == (1 if method == "map" else 6)
    mean, variance = mixture(process.posterior.moments(X))
    np.testing.assert_allclose(mean, y, atol=1e-3)
    assert variance.max() < 1e-3


def test_the_same_trials_give_the_same_particles():
    X, y = trials(rough, 50)
    first, second = (GaussianProcess(kernel="matern52_two_scales").fit(X, y, seed=4).posterior for _ in range(2))
    np.testing.assert_array_equal(first.hyperparameters.theta, second.hyperparameters.theta)

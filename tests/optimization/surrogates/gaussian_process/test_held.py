"""What is learnt where the length-scales are given."""

import numpy as np
import pytest
from scipy.optimize import minimize
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from surehold.optimization.surrogates.gaussian_process.held import HELD, learn_held, mode_held
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning
from surehold.optimization.surrogates.gaussian_process.likelihood import log_posterior
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

SCALES = [0.4, 0.6]


def _noisy(deviation, n=80):
    rng = np.random.default_rng(0)
    X = rng.random((n, 2))
    return X, np.sin(5.0 * X[:, 0]) + deviation * rng.standard_normal(n)


@pytest.mark.parametrize("kernel", ["matern52", "matern52_two_scales"])
@pytest.mark.parametrize("deviation", [0.05, 0.5, 1.0])
def test_noise_is_learnt_and_length_scales_stay(deviation, kernel):
    X, y = _noisy(deviation)
    model = GaussianProcess(kernel=kernel, length_scales=SCALES, noise="inferred").fit(X, y)
    assert model.noise_std(X[:1])[0] == pytest.approx(deviation, rel=0.25)
    np.testing.assert_allclose(model.posterior.length_scales, np.tile(SCALES, (10, 1)))


@pytest.mark.parametrize("method", ["elliptical_slice", "slice", "map"])
def test_every_way_of_learning_finds_the_variances(method):
    X, y = _noisy(0.5)
    model = GaussianProcess(length_scales=SCALES, noise="inferred", learning=Learning(method)).fit(X, y)
    kernel = ConstantKernel(1.0) * Matern(SCALES, length_scale_bounds="fixed", nu=2.5) + WhiteKernel(0.1)
    theirs = GaussianProcessRegressor(kernel, normalize_y=True).fit(X, y)
    found = np.sqrt(theirs.kernel_.k2.noise_level) * y.std()
    assert model.noise_std(X[:1])[0] == pytest.approx(found, rel=0.1)
    assert model.posterior.hyperparameters.s2.mean() != 1.0


def test_the_mode_is_that_of_the_density_along_what_is_free():
    X, y = _noisy(0.5)
    evidence = GaussianProcess(length_scales=SCALES, noise="inferred").fit(X, y).posterior.evidence
    theta, _ = mode_held(evidence)
    best = minimize(lambda free: -log_posterior(np.append(np.log(SCALES), free), evidence), theta[2:] + 0.1)
    np.testing.assert_allclose(theta[:2], np.log(SCALES))
    assert log_posterior(theta, evidence) > -best.fun - 1e-3


def test_the_variance_of_a_smooth_function_is_learnt_and_a_given_one_is_not():
    X, _ = _noisy(0.0, 30)
    y = X @ [1.0, 2.0]
    wide = GaussianProcess(length_scales=[3.0, 3.0]).fit(X, y).posterior.hyperparameters.s2
    assert wide.min() > 1.5, "within a box that is small to it a process shows a part of its variance"
    fixed = GaussianProcess(length_scales=[3.0, 3.0], signal_variance=1.0).fit(X, y).posterior
    assert fixed.hyperparameters.theta.shape == (1, 2)


def test_equal_outputs_teach_nothing_but_length_scales_stay():
    X, _ = _noisy(0.0, 12)
    posterior = GaussianProcess(length_scales=SCALES, noise="inferred").fit(X, np.ones(12)).posterior
    np.testing.assert_allclose(posterior.length_scales, np.tile(SCALES, (10, 1)))
    assert np.ptp(posterior.hyperparameters.s2) > 0.0


def test_noise_that_differs_from_place_to_place_is_learnt_beside_given_length_scales():
    rng = np.random.default_rng(1)
    X = rng.random((150, 1))
    y = np.sin(5.0 * X[:, 0]) + 0.02 * np.exp(4.0 * X[:, 0]) * rng.standard_normal(150)
    model = GaussianProcess(length_scales=[0.4], noise="heteroscedastic").fit(X, y)
    low, high = model.noise_std([[0.1], [0.9]])
    assert high > 8.0 * low
    np.testing.assert_allclose(model.posterior.length_scales, 0.4)


def test_the_evidence_is_of_the_given_length_scales():
    X, y = _noisy(0.5)
    values = []
    for scale in (0.05, 0.4):
        model = GaussianProcess(length_scales=scale, noise="inferred")
        values.append(model.log_evidence(X, y, model.standardization(y)))
        evidence = model.fit(X, y).posterior.evidence
        assert np.all(evidence.prior_deviation[:2] == HELD)
        assert learn_held(evidence, Learning(particles=3), np.random.default_rng(0)).particles.shape == (3, 4)
    assert values[1] > values[0]

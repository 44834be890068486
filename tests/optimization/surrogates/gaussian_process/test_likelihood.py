import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

from surehold.optimization.surrogates.gaussian_process.kernels import (
    KERNELS,
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

RADIAL = {
    "matern52": lambda scales: Matern(scales, nu=2.5),
    "matern32": lambda scales: Matern(scales, nu=1.5),
    "squared_exponential": lambda scales: RBF(scales),
}


def evidence_of(X, y, *, kernel="matern52", offsets=None, weights=None, **changes):
    d = X.shape[1]
    settings = {
        "signal_variance": 1.7,
        "ratio": 1e-6,
        "mean_variance": 0.0,
        "learn_signal": False,
        "learn_noise": False,
        "noise": np.zeros(len(y)),
    } | changes
    p = d + shape_size(kernel_number(kernel)) + settings["learn_signal"] + settings["learn_noise"]
    return Evidence(
        X=X,
        y=y,
        offsets=np.array([0, len(y)]) if offsets is None else np.array(offsets),
        weights=np.ones(1) if weights is None else np.array(weights, dtype=float),
        prior_mean=np.linspace(-1.0, 0.5, p),
        prior_deviation=np.linspace(0.7, 2.0, p),
        kernel=kernel_number(kernel),
        **settings,
    )


def prior_of(theta, evidence):
    return norm.logpdf(theta, evidence.prior_mean, evidence.prior_deviation).sum()


@pytest.fixture
def data():
    rng = np.random.default_rng(0)
    X = rng.random((25, 2))
    return X, np.sin(5 * X[:, 0]) + X[:, 1] ** 2


@pytest.mark.parametrize("kernel", RADIAL)
def test_equal_to_scikit_learn(kernel, data):
    X, y = data
    scales, s2, v = np.array([0.4, 0.9]), 2.3, 0.01
    evidence = evidence_of(X, y, kernel=kernel, learn_signal=True, learn_noise=True, ratio=0.0)
    theta = np.log([*scales, s2, v])
    model = GaussianProcessRegressor(
        ConstantKernel(s2) * RADIAL[kernel](scales) + WhiteKernel(v), alpha=0.0, optimizer=None
    ).fit(X, y)
    expected = model.log_marginal_likelihood() + prior_of(theta, evidence)
    assert abs(log_posterior(theta, evidence) - expected) < 1e-8
    assert abs(log_posterior_and_gradient(theta, evidence)[0] - expected) < 1e-8


def test_ratio_noise_and_mean_enter_the_covariance(data):
    X, y = data
    noise = np.linspace(0.0, 0.3, len(y))
    evidence = evidence_of(X, y, ratio=1e-3, mean_variance=4.0, noise=noise)
    theta = np.log([0.4, 0.9])
    A = 1.7 * Matern([0.4, 0.9], nu=2.5)(X) + 1.7e-3 * np.eye(25) + 4.0 + np.diag(noise)
    expected = -0.5 * y @ np.linalg.solve(A, y) - 0.5 * np.linalg.slogdet(2 * np.pi * A)[1]
    assert abs(log_posterior(theta, evidence) - expected - prior_of(theta, evidence)) < 1e-8


def test_blocks_are_independent_and_weighted(data):
    X, y = data
    theta = np.log([0.4, 0.9])
    blocks = evidence_of(X, y, offsets=[0, 10, 10, 18, 25], weights=[2.0, 5.0, 1.0, 0.0])
    alone = [evidence_of(X[a:b], y[a:b], noise=np.zeros(b - a)) for a, b in ((0, 10), (10, 18))]
    prior = prior_of(theta, blocks)
    expected = 2.0 * (log_posterior(theta, alone[0]) - prior) + (log_posterior(theta, alone[1]) - prior) + prior
    assert abs(log_posterior(theta, blocks) - expected) < 1e-9


@pytest.mark.parametrize(("kernel", "form"), [*((name, 0.0) for name in KERNELS), (KERNELS[TWO_SCALES], LOG_ADDITIVE)])
@pytest.mark.parametrize(("signal", "inferred"), [(False, False), (True, False), (False, True), (True, True)])
def test_gradient(kernel, form, signal, inferred, data):
    X, y = data
    evidence = evidence_of(
        X,
        y,
        kernel=kernel,
        learn_signal=signal,
        learn_noise=inferred,
        ratio=1e-3,
        mean_variance=0.5,
        noise=np.linspace(0.0, 0.1, 25),
        offsets=[0, 15, 25],
        weights=[1.0, 0.6],
    )
    shape = np.array([form + np.log(5.0), -1.0])[: shape_size(kernel_number(kernel))]
    theta = np.concatenate([np.log([0.4, 0.9]), shape, np.log([2.0, 0.02])[: signal + inferred]])
    value, gradient = log_posterior_and_gradient(theta, evidence)
    assert value == pytest.approx(log_posterior(theta, evidence), abs=1e-9)
    h = 1e-5
    for i, step in enumerate(h * np.eye(len(theta))):
        numeric = (log_posterior(theta + step, evidence) - log_posterior(theta - step, evidence)) / (2 * h)
        assert gradient[i] == pytest.approx(numeric, rel=1e-6, abs=1e-6)


def test_density_is_zero_where_nothing_can_be_computed(data):
    X, y = data
    twice = evidence_of(np.concatenate([X, X]), np.concatenate([y, y]), ratio=0.0, noise=np.zeros(50))
    for evidence, theta in ((twice, np.log([0.4, 0.9])), (evidence_of(X, y), np.array([0.0, 61.0]))):
        assert log_posterior(theta, evidence) == -np.inf
        value, gradient = log_posterior_and_gradient(theta, evidence)
        assert value == -np.inf
        assert not gradient.any()
    assert log_posterior(np.array([np.nan, 0.0]), evidence_of(X, y)) == -np.inf


@settings(deadline=None)
@given(st.integers(1, 6), st.integers(1, 4), st.integers(0, 2**31), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_scaling_outputs_and_signal_together_shifts_the_density(n, d, seed, log_c, log_l):
    rng = np.random.default_rng(seed)
    X, y = rng.random((n, d)), rng.standard_normal(n)
    theta = np.full(d, log_l)
    c = np.exp(log_c)
    before = log_posterior(theta, evidence_of(X, y, ratio=1e-2))
    after = log_posterior(theta, evidence_of(X, c * y, ratio=1e-2, signal_variance=1.7 * c * c))
    assert after == pytest.approx(before - n * log_c, abs=1e-6)

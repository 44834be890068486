import numpy as np
import pytest
from numba import njit, types
from scipy.stats import kstest, norm

from surehold.optimization.samplers.elliptical_slice import elliptical_slice_sample
from surehold.optimization.samplers.slice import slice_sample
from surehold.optimization.surrogates.gaussian_process.kernels import correlation
from surehold.optimization.surrogates.gaussian_process.likelihood import EVIDENCE_TYPE, Evidence, log_posterior

RHO = 0.8
MEAN = np.array([1.0, -2.0])
DEVIATION = np.array([0.5, 3.0])


@njit(types.float64(types.float64[::1], EVIDENCE_TYPE))
def correlated_normal(theta, evidence):
    a = (theta[0] - 1.0) / 0.5
    b = (theta[1] + 2.0) / 3.0
    return -0.5 * (a * a - 2.0 * 0.8 * a * b + b * b) / (1.0 - 0.8 * 0.8)


@njit(types.float64(types.float64[::1], EVIDENCE_TYPE))
def truncated_exponential(theta, evidence):
    return -theta[0] if 0.0 <= theta[0] <= 2.0 else -np.inf


def evidence_of(X, y, learn_noise=False):
    d = X.shape[1]
    p = d + learn_noise
    return Evidence(
        np.ascontiguousarray(X),
        y,
        np.zeros(len(y)),
        np.array([0, len(y)]),
        np.ones(1),
        np.full(p, -0.5),
        np.full(p, 0.8),
        1.0,
        1e-4,
        0.0,
        0,
        False,
        learn_noise,
    )


NOTHING = evidence_of(np.zeros((1, 2)), np.zeros(1))


def effective_size(x):
    """Return the number of independent draws worth as much as the chain x, by Geyer's initial positive sequence."""
    x = x - x.mean()
    n = len(x)
    f = np.fft.rfft(x, 2 * n)
    correlations = np.fft.irfft(f * np.conj(f))[:n] / np.arange(n, 0, -1)
    correlations /= correlations[0]
    pairs = correlations[: n // 4 * 2].reshape(-1, 2).sum(axis=1)
    stop = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    return n / max(2.0 * pairs[:stop].sum() - 1.0, 1.0)


def assert_expectation(draws, expected, what):
    error = draws.std() / np.sqrt(effective_size(draws))
    assert abs(draws.mean() - expected) < 4.5 * error, f"{what}: {draws.mean()} against {expected} +- {error}"


def coordinate_wise(density, evidence, start, rng, widths=6.0, **counts):
    return slice_sample(density, evidence, start, rng, widths=widths, **counts)


def elliptical(density, evidence, start, rng, spread=1.0, **counts):
    return elliptical_slice_sample(density, evidence, start, spread * np.eye(start.size), rng, **counts)


@pytest.mark.parametrize(
    ("sampler", "tuning"),
    [
        (coordinate_wise, {"widths": 0.3}),
        (coordinate_wise, {"widths": 6.0}),
        (coordinate_wise, {"widths": np.array([0.05, 40.0])}),
        (elliptical, {"spread": 1.0}),
        (elliptical, {"spread": 3.0}),
        (elliptical, {"spread": 0.7}),
    ],
)
def test_moments_of_a_correlated_normal(sampler, tuning):
    """Whatever the first guesses of widths, or of the covariance around a center that is not the mode."""
    chain = sampler(
        correlated_normal, NOTHING, np.zeros(2), np.random.default_rng(1), keep=30_000, burn_in=100, **tuning
    )
    z = (chain.states - MEAN) / DEVIATION
    for i in range(2):
        assert_expectation(z[:, i], 0.0, f"mean of coordinate {i}")
        assert_expectation(z[:, i] ** 2, 1.0, f"variance of coordinate {i}")
        assert_expectation(z[:, i] ** 4, 3.0, f"fourth moment of coordinate {i}")
        assert_expectation((z[:, i] > 1.0).astype(float), norm.sf(1.0), f"tail of coordinate {i}")
    assert_expectation(z[:, 0] * z[:, 1], RHO, "correlation")


@pytest.mark.parametrize("sampler", [coordinate_wise, elliptical])
def test_bounded_support_is_respected(sampler):
    chain = sampler(
        truncated_exponential, NOTHING, np.array([1.0]), np.random.default_rng(2), keep=20_000, burn_in=50, thin=3
    )
    x = chain.states[:, 0]
    assert x.min() >= 0.0
    assert x.max() <= 2.0
    assert_expectation(x, (1.0 - 3.0 * np.exp(-2.0)) / (1.0 - np.exp(-2.0)), "mean of the truncated exponential")
    np.testing.assert_allclose(chain.log_densities, -x)


@pytest.mark.parametrize(("sampler", "tuning"), [(coordinate_wise, {"widths": 2.0}), (elliptical, {"spread": 0.8})])
def test_joint_distribution_of_hyperparameters_and_data(sampler, tuning):
    """Geweke 2004: draw theta from the prior, data given theta, then the chain on them; theta is as before."""
    rng = np.random.default_rng(3)
    X = rng.random((6, 1))
    after = []
    for _ in range(1500):
        theta = -0.5 + 0.8 * rng.standard_normal(2)
        C = correlation("matern52", X, X, np.exp(theta[:1])) + (1e-4 + np.exp(theta[1])) * np.eye(6)
        y = np.linalg.cholesky(C) @ rng.standard_normal(6)
        evidence = evidence_of(X, y, learn_noise=True)
        chain = sampler(log_posterior, evidence, theta, rng, keep=1, burn_in=4, **tuning)
        after.append(chain.states[0])
    z = (np.array(after) + 0.5) / 0.8
    for i in range(2):
        assert kstest(z[:, i], "norm").pvalue > 1e-3, f"hyperparameter {i} no longer follows its prior"
    assert abs(np.corrcoef(z.T)[0, 1]) < 4.0 / np.sqrt(1500), "the chain correlates what the prior does not"


def test_reproducible_and_counted():
    runs = [
        slice_sample(correlated_normal, NOTHING, np.zeros(2), np.random.default_rng(5), keep=7, burn_in=3, thin=2)
        for _ in range(2)
    ]
    assert np.array_equal(runs[0].states, runs[1].states)
    assert runs[0].states.shape == (7, 2)
    assert runs[0].evaluations == runs[1].evaluations > 17 * 2 * 3
    densities = [correlated_normal(state, NOTHING) for state in runs[0].states]
    np.testing.assert_allclose(runs[0].log_densities, densities)


@njit(types.float64(types.float64[::1], EVIDENCE_TYPE))
def not_a_number(theta, evidence):
    return np.nan


@njit(types.float64(types.float64[::1], EVIDENCE_TYPE))
def level_everywhere(theta, evidence):
    return 0.0


@pytest.mark.parametrize("sampler", [coordinate_wise, elliptical])
@pytest.mark.parametrize("start", [0.5, np.nan])
def test_a_density_that_is_nan_ends(sampler, start):
    chain = sampler(not_a_number, NOTHING, np.array([start]), np.random.default_rng(0), keep=2, burn_in=0)
    assert chain.evaluations <= 1 + 2 * (2 + 1001)
    np.testing.assert_array_equal(chain.states, start)


def test_a_density_without_end_ends():
    chain = coordinate_wise(level_everywhere, NOTHING, np.zeros(1), np.random.default_rng(0), keep=3, burn_in=0)
    assert np.isfinite(chain.states).all()

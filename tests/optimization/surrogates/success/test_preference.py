"""Preferences between two inputs, against sampling of the exact posterior and a single comparison in closed form."""

import numpy as np
import pytest
from scipy.special import log_ndtr, ndtr

from surehold.optimization.surrogates.gaussian_process.kernels import correlation
from surehold.optimization.surrogates.success.preference import PreferenceProcess

L, S2 = np.array([0.3, 0.5]), 2.0
THETA = np.log([*L, S2])


def duels(n=12, p=20, seed=0):
    """Inputs, and pairs of them of which the first was preferred."""
    rng = np.random.default_rng(seed)
    X = rng.random((n, 2))
    f = 3.0 - 12.0 * ((X - 0.5) ** 2).sum(axis=1)
    pairs = np.array([rng.choice(n, 2, replace=False) for _ in range(p)])
    won = rng.random(p) < ndtr((f[pairs[:, 0]] - f[pairs[:, 1]]) / np.sqrt(2.0))
    pairs[~won] = pairs[~won][:, ::-1]
    return X, pairs


def test_differences_and_probabilities_are_those_of_exact_sampling():
    """Elliptical slice sampling of f itself (Murray et al. 2010), written here; repeated pairs are among them."""
    X, pairs = duels(8, 16)
    assert len(np.unique(np.sort(pairs, axis=1), axis=0)) < 16
    queries = np.random.default_rng(4).random((4, 2))
    both = np.concatenate([X, queries])
    root = np.linalg.cholesky(S2 * correlation("matern52", both, both, L) + 1e-9 * np.eye(12))
    rng = np.random.default_rng(1)

    def log_likelihood(f):
        return log_ndtr((f[pairs[:, 0]] - f[pairs[:, 1]]) / np.sqrt(2.0)).sum()

    f, kept = np.zeros(12), []
    for step in range(40_000):
        nu = root @ rng.standard_normal(12)
        level = log_likelihood(f) + np.log(rng.random())
        angle = rng.uniform(0, 2 * np.pi)
        low, high = angle - 2 * np.pi, angle
        while log_likelihood(f * np.cos(angle) + nu * np.sin(angle)) < level:
            low, high = (angle, high) if angle < 0 else (low, angle)
            angle = rng.uniform(low, high)
        f = f * np.cos(angle) + nu * np.sin(angle)
        if step >= 1000:
            kept.append(f)
    kept = np.array(kept)
    posterior = PreferenceProcess(theta=THETA).condition(X, pairs, np.random.default_rng(0))
    over = kept - kept[:, np.argmin(np.abs(both - posterior.anchor).max(axis=1))][:, None]
    assert over.mean(axis=0)[:8].max() == 0.0, "the anchor is the best of the inputs compared"
    np.testing.assert_allclose(posterior.moments(both).mean[0], over.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(np.sqrt(posterior.moments(both).variance[0]), over.std(axis=0), atol=0.05)
    for a, b in ((8, 9), (10, 11), (0, 8)):
        exact = ndtr((kept[:, a] - kept[:, b]) / np.sqrt(2.0)).mean()
        assert posterior.preferred(both[a], both[b]) == pytest.approx(exact, abs=0.01)


def test_one_comparison_in_closed_form():
    """Of two inputs and one judgement E g = v phi(0) / (Phi(0) sqrt(1 + v)), v the prior variance of g."""
    X = np.array([[0.2, 0.3], [0.7, 0.6]])
    v = S2 * (1.0 - correlation("matern52", X[:1], X[1:], L)[0, 0])
    posterior = PreferenceProcess(theta=THETA).condition(X, np.array([[1, 0]]), np.random.default_rng(0))
    worse, better = posterior.moments(X).mean[0]
    expected = v * 2.0 / np.sqrt(2.0 * np.pi) / np.sqrt(1.0 + v)
    assert (better - worse) / np.sqrt(2.0) == pytest.approx(expected, rel=1e-4)
    assert better == pytest.approx(0.0, abs=1e-9)


def test_preferred_is_antisymmetric_and_a_far_pair_is_even():
    X, pairs = duels(20, 80)
    posterior = PreferenceProcess().condition(X, pairs, np.random.default_rng(0))
    a, b = np.array([0.5, 0.5]), np.array([0.05, 0.95])
    assert posterior.preferred(a, b) + posterior.preferred(b, a) == pytest.approx(1.0)
    assert posterior.preferred(a, b) > 0.7
    assert posterior.preferred(a, a) == pytest.approx(0.5, abs=1e-3)


def test_gradients_by_differences_and_draws_have_the_moments():
    X, pairs = duels()
    posterior = PreferenceProcess(theta=THETA).condition(X, pairs, np.random.default_rng(0))
    at = posterior.moments(X[:2] + 0.03, True)
    for k in range(2):
        step = 1e-5 * np.eye(2)[k]
        above, below = posterior.moments(X[:2] + 0.03 + step), posterior.moments(X[:2] + 0.03 - step)
        np.testing.assert_allclose(at.mean_gradient[..., k], (above.mean - below.mean) / 2e-5, atol=1e-5)
        np.testing.assert_allclose(at.variance_gradient[..., k], (above.variance - below.variance) / 2e-5, atol=1e-5)
    draws = posterior.sample(X[None, :2] + 0.03, np.random.default_rng(1).standard_normal((40_000, 2)))[0, 0]
    np.testing.assert_allclose(draws.mean(axis=0), at.mean[0], atol=0.03)
    np.testing.assert_allclose(draws.var(axis=0), at.variance[0], rtol=0.04)


def test_a_pending_input_narrows_itself():
    X, pairs = duels()
    posterior = PreferenceProcess(theta=THETA).condition(X, pairs, np.random.default_rng(0))
    at = np.array([[0.9, 0.1]])
    later = posterior.with_pending(at)
    assert later.moments(at).variance[0, 0] < 0.95 * posterior.moments(at).variance[0, 0]
    assert later.noise_variance(at).shape == (1, 1)

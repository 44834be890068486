"""The Gaussian process behind a probit likelihood, against sampling, quadrature and differences."""

import numpy as np
import pytest
from scipy import integrate, optimize, stats
from scipy.special import log_ndtr, ndtr

from surehold.optimization.surrogates.gaussian_process.kernels import correlation
from surehold.optimization.surrogates.success import model
from surehold.optimization.surrogates.success.laplace import Counts, laplace, log_posterior, prior_covariance
from surehold.optimization.surrogates.success.model import SuccessProcess
from surehold.optimization.surrogates.success.posterior import probability, shares
from surehold.optimization.surrogates.success.propagation import propagated

L, S2 = np.array([0.3, 0.5]), 1.5


def data(n=25, trials=1, seed=0):
    rng = np.random.default_rng(seed)
    X = rng.random((n, 2))
    p = ndtr(1.5 - 6.0 * ((X - 0.5) ** 2).sum(axis=1))
    return X, rng.binomial(trials, p) / trials


def fixed(X, y, trials=None):
    process = SuccessProcess(length_scales=L, signal_variance=S2)
    return process.condition(X, y, np.random.default_rng(0), trials=None if trials is None else np.full(len(y), trials))


def covariance(A, B):
    return S2 * correlation("matern52", A, B, L) + 1.0


def log_joint(a, K, s, r):
    f = K @ a
    return -0.5 * a @ f + s @ log_ndtr(f) + (r - s) @ log_ndtr(-f)


@pytest.mark.parametrize("trials", [1, 7])
def test_mode_and_evidence_as_an_independent_maximization_gives(trials):
    X, y = data(20, trials)
    s, r = y * trials, np.full(20, float(trials))
    K = covariance(X, X) + 1e-10 * S2 * np.eye(20)
    found = optimize.minimize(
        lambda f: 0.5 * f @ np.linalg.solve(K, f) - s @ log_ndtr(f) - (r - s) @ log_ndtr(-f), np.zeros(20), tol=1e-12
    ).x
    a, W, factor = np.empty(20), np.empty(20), np.empty((20, 20))
    evidence = laplace(K, s, r, a, W, factor)
    np.testing.assert_allclose(K @ a, found, atol=1e-4)

    def log_likelihood(f, i):
        return s[i] * log_ndtr(f) + (r[i] - s[i]) * log_ndtr(-f)

    h, f = 1e-4, K @ a
    curvature = [
        -(log_likelihood(f[i] + h, i) - 2 * log_likelihood(f[i], i) + log_likelihood(f[i] - h, i)) / h**2
        for i in range(20)
    ]
    np.testing.assert_allclose(W, curvature, rtol=1e-4, atol=1e-5)
    expected = log_joint(a, K, s, r) - 0.5 * np.linalg.slogdet(np.eye(20) + K * W)[1]
    assert evidence == pytest.approx(expected, abs=1e-8)


def test_likelihood_far_in_the_tail_stays_finite():
    K = np.array([[1e6]])
    a, W, factor = np.empty(1), np.empty(1), np.empty((1, 1))
    assert np.isfinite(laplace(K, np.array([40.0]), np.array([40.0]), a, W, factor))
    assert np.isfinite(a).all()
    assert (W > 0.0).all()


def test_probabilities_are_those_of_exact_sampling():
    """Elliptical slice sampling of f itself (Murray et al. 2010), written here; probabilities within .01."""
    X, y = data(25)
    Q = np.random.default_rng(5).random((12, 2))
    K = covariance(X, X) + 1e-8 * np.eye(25)
    root, weights = np.linalg.cholesky(K), np.linalg.solve(K, covariance(X, Q))
    rest = S2 + 1.0 - np.einsum("nq,nq->q", covariance(X, Q), weights)
    rng = np.random.default_rng(1)

    def log_likelihood(f):
        return log_ndtr((2 * y - 1) * f).sum()

    f, total, kept = np.zeros(25), np.zeros(12), 0
    for step in range(40_000):
        nu = root @ rng.standard_normal(25)
        level = log_likelihood(f) + np.log(rng.random())
        angle = rng.uniform(0, 2 * np.pi)
        low, high = angle - 2 * np.pi, angle
        while log_likelihood(f * np.cos(angle) + nu * np.sin(angle)) < level:
            low, high = (angle, high) if angle < 0 else (low, angle)
            angle = rng.uniform(low, high)
        f = f * np.cos(angle) + nu * np.sin(angle)
        if step >= 1000:
            total += ndtr(weights.T @ f / np.sqrt(1.0 + rest))
            kept += 1
    exact = total / kept
    ours = fixed(X, y).moments(Q).mean[0]
    assert np.abs(ours - exact).max() < 0.01


@pytest.mark.parametrize("v", [0.01, 2.5, 1e5])
@pytest.mark.parametrize(("successes", "of"), [(1, 1), (5, 7), (0, 3)])
def test_evidence_and_mean_of_a_single_place_are_exact(successes, of, v):
    """With one site expectation propagation has nothing to approximate: one integral over f."""
    s, r = np.array([float(successes)]), np.array([float(of)])

    def integral(power):
        return integrate.quad(
            lambda f: f**power * ndtr(f) ** successes * ndtr(-f) ** (of - successes) * stats.norm.pdf(f, 0.0, v**0.5),
            -8.0 * v**0.5,
            8.0 * v**0.5,
            points=[-6.0, -3.0, 0.0, 3.0, 6.0] if v > 1.0 else None,
            limit=200,
        )[0]

    sites = propagated(np.array([[v]]), s, r, np.full(1, 0.1), np.zeros(1))
    assert sites.log_evidence == pytest.approx(np.log(integral(0)), abs=2e-3)
    assert v * sites.alpha[0] == pytest.approx(integral(1) / integral(0), abs=2e-3 * v**0.5)


def test_moments_of_the_probability_by_quadrature():
    for mu, v in [(0.3, 0.5), (-1.7, 2.0), (4.0, 0.01), (0.0, 1.0)]:
        mean, variance, _ = probability(np.array(mu), np.array(v))
        moments = [
            integrate.quad(
                lambda f, k=k, mu=mu, v=v: ndtr(f) ** k * stats.norm.pdf(f, mu, np.sqrt(v)),
                mu - 12 * v**0.5,
                mu + 12 * v**0.5,
            )[0]
            for k in (1, 2)
        ]
        assert mean == pytest.approx(moments[0], abs=1e-9)
        assert variance == pytest.approx(moments[1] - moments[0] ** 2, abs=1e-9)


def test_gradients_of_moments_and_averages_by_differences():
    X, y = data(30, 5)
    posterior = SuccessProcess().condition(X, y, np.random.default_rng(0), trials=np.full(30, 5))
    Q = np.array([[0.41, 0.33], [0.8, 0.1]])
    offsets, weights = np.array([[0.0, 0.0], [0.05, 0.0], [-0.03, 0.04]]), np.array([0.5, 0.25, 0.25])
    for moments in (posterior.moments, lambda U, g=False: posterior.average(U, offsets, weights, g)):
        at = moments(Q, True)
        for k in range(2):
            step = 1e-5 * np.eye(2)[k]
            above, below = moments(Q + step), moments(Q - step)
            np.testing.assert_allclose(at.mean_gradient[..., k], (above.mean - below.mean) / 2e-5, atol=1e-5)
            np.testing.assert_allclose(
                at.variance_gradient[..., k], (above.variance - below.variance) / 2e-5, atol=1e-5
            )


def test_draws_have_the_moments():
    X, y = data(30, 5)
    posterior = fixed(X, y, 5)
    points = np.random.default_rng(0).random((2, 3, 2))
    draws = posterior.sample(points, np.random.default_rng(1).standard_normal((40_000, 3)))  # (1, 2, b, 3)
    moments = posterior.moments(points.reshape(-1, 2))
    np.testing.assert_allclose(draws.mean(axis=2).ravel(), moments.mean[0], atol=0.004)
    np.testing.assert_allclose(draws.var(axis=2).ravel(), moments.variance[0], rtol=0.04)


def test_repeated_trials_are_counts():
    X, y = data(10, 4)
    single = np.repeat(X, 4, axis=0)
    outcomes = np.concatenate([[1.0] * round(4 * v) + [0.0] * (4 - round(4 * v)) for v in y])
    Q = np.random.default_rng(2).random((5, 2))
    np.testing.assert_allclose(fixed(X, y, 4).moments(Q).mean, fixed(single, outcomes).moments(Q).mean, atol=1e-12)


def test_of_many_trials_the_near_ones_count_together(monkeypatch):
    """Nothing is lost, and what is said is what all trials say, nearly: places of a hundred stand for 500 trials."""
    rng = np.random.default_rng(3)
    X = np.concatenate([rng.random((150, 2)), np.clip(0.6 + 0.06 * rng.standard_normal((350, 2)), 0.0, 1.0)])
    y = (rng.random(500) < ndtr(1.5 - 8.0 * ((X - 0.6) ** 2).sum(axis=1))).astype(float)
    Q = np.concatenate([rng.random((50, 2)), 0.6 + 0.06 * rng.standard_normal((50, 2))])
    monkeypatch.setattr(model, "SUCCESS_PLACES", 500)
    every = fixed(X, y)
    assert len(every.counts.X) == 500
    monkeypatch.setattr(model, "SUCCESS_PLACES", 100)
    some = fixed(X, y)
    assert 90 < len(some.counts.X) <= 100
    assert some.counts.trials.sum() == 500.0
    assert some.counts.successes.sum() == y.sum()
    assert some.counts.trials @ some.counts.X == pytest.approx(X.sum(axis=0))
    every, some = every.moments(Q), some.moments(Q)
    off = np.abs(some.mean - every.mean)[0]
    assert off.max() < 0.06
    assert off[50:].max() < 0.02  # where most trials are, places are near each other
    assert np.abs(np.sqrt(some.variance) - np.sqrt(every.variance)).max() < 0.03


def test_pending_trials_narrow_and_move_nothing():
    X, y = data(20)
    posterior, at = fixed(X, y), np.array([[0.2, 0.9]])
    later = posterior.with_pending(at)
    np.testing.assert_allclose(later.latent.moments(at).mean, posterior.latent.moments(at).mean, atol=1e-9)
    v, mu = posterior.latent.moments(at).variance[0, 0], posterior.latent.moments(at).mean[0, 0]
    information = stats.norm.pdf(mu) ** 2 / (ndtr(mu) * ndtr(-mu))
    assert later.latent.moments(at).variance[0, 0] == pytest.approx(1.0 / (1.0 / v + information), rel=1e-6)


def test_log_posterior_adds_the_prior():
    X, y = data(15)
    counts = Counts(X, y, np.ones(15), np.zeros(3), np.ones(3), 1e-10, 1.0, 0, np.empty((0, 2), dtype=np.int64))
    theta = np.array([-1.0, -0.5, 0.4])
    K = np.empty((15, 15))
    prior_covariance(theta, counts, K)
    expected = np.exp(0.4) * (correlation("matern52", X, X, np.exp(theta[:2])) + 1e-10 * np.eye(15)) + 1.0
    np.testing.assert_allclose(K, expected, atol=1e-12)
    evidence = laplace(K, y, np.ones(15), np.empty(15), np.empty(15), np.empty((15, 15)))
    assert log_posterior(theta, counts) == pytest.approx(evidence - 0.5 * theta @ theta)


def test_evidence_gradient_as_the_closed_form_gives():
    """Rasmussen and Williams 2006, algorithm 5.1, for the log signal variance, against differences of `laplace`."""
    X, y = data(15)
    ones = np.ones(15)
    base = correlation("matern52", X, X, L)

    def evidence(log_s2):
        K = np.exp(log_s2) * base + 1.0 + 1e-9 * np.eye(15)
        return laplace(K, y, ones, np.empty(15), np.empty(15), np.empty((15, 15)))

    K = S2 * base + 1.0 + 1e-9 * np.eye(15)
    a, W = np.empty(15), np.empty(15)
    laplace(K, y, ones, a, W, np.empty((15, 15)))
    f, t = K @ a, 2.0 * y - 1.0
    r = np.exp(stats.norm.logpdf(f) - log_ndtr(t * f))
    third = t * r * (2.0 * r**2 + 3.0 * t * f * r + f**2 - 1.0)  # d3 log Phi(t f) / df3
    R = np.linalg.inv(K + np.diag(1.0 / W))
    by_f = 0.5 * np.diag(K - K @ R @ K) * third
    C = S2 * base
    b = C @ a
    explicit = 0.5 * a @ C @ a - 0.5 * np.trace(R @ C)
    gradient = explicit + by_f @ (b - K @ R @ b)
    h = 1e-4
    differences = (evidence(np.log(S2) + h) - evidence(np.log(S2) - h)) / (2.0 * h)
    assert differences == pytest.approx(gradient, rel=1e-4, abs=1e-7)


def test_probabilities_near_those_of_the_logistic_classifier():
    """scikit-learn's Laplace with its logistic link, whose latent function is about 1.7 times that of a probit."""
    from sklearn.gaussian_process import GaussianProcessClassifier
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern

    X, y = data(120)
    kernel = ConstantKernel(1.7**2 * S2, "fixed") * Matern(L, "fixed", nu=2.5) + ConstantKernel(1.7**2, "fixed")
    theirs = GaussianProcessClassifier(kernel, optimizer=None).fit(X, y)
    queries = np.random.default_rng(1).random((200, 2))
    ours = fixed(X, y).moments(queries).mean[0]
    difference = ours - theirs.predict_proba(queries)[:, 1]
    assert np.abs(difference).max() < 0.05
    assert np.abs(difference).mean() < 0.02


def test_shares_of_success_over_points_of_unequal_weight():
    posterior = fixed(*data())
    points, weights = np.array([[0.5, 0.5], [0.05, 0.95], [0.9, 0.1]]), np.array([0.7, 0.2, 0.1])
    expected = posterior.moments(points).mean.mean(axis=0) @ weights
    assert shares(posterior, points, weights).mean() == pytest.approx(expected, abs=0.005)

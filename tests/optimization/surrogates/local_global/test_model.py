import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.noise.quadratures import sigma_points
from surehold.optimization.surrogates.gaussian_process.kernels import correlation
from surehold.optimization.surrogates.local_global.density import log_posterior
from surehold.optimization.surrogates.local_global.model import LocalGlobalProcess

RNG = np.random.default_rng(0)
X = RNG.random((18, 2))
Y = np.sin(9.0 * X.sum(axis=1)) * X[:, 0]
Q = RNG.random((5, 2))


@pytest.fixture(scope="module")
def posterior():
    return LocalGlobalProcess().condition(X, Y, np.random.default_rng(1))


def shares(P, center):
    """The definition, by SciPy's densities: sqrt(w_j / (w_g + w_l))."""
    wide = norm.pdf(P, 0.5, 10.0).prod(axis=1)
    narrow = norm.pdf(P, center, 0.05).prod(axis=1)
    return np.sqrt(wide / (wide + narrow)), np.sqrt(narrow / (wide + narrow))


def covariance(P, R, particle):
    (gp, lp), (gr, lr) = shares(P, particle.center), shares(R, particle.center)
    wide, narrow = 1.0 / particle.inverse_l
    return particle.s2 * (
        np.outer(gp, gr) * correlation("matern52", P, R, wide)
        + np.outer(lp, lr) * correlation("matern52", P, R, narrow)
    )


def test_moments_by_textbook_algebra(posterior):
    offsets, weights = sigma_points(0.003 * np.eye(2))
    found = posterior.average(Q, offsets, weights)
    for j, particle in enumerate(posterior._particles):
        A = covariance(X, X, particle) + 1e-10 * particle.s2 * np.eye(len(X))
        for i, q in enumerate(Q):
            P = q + offsets
            K = weights @ covariance(P, X, particle)
            mean = posterior._outputs.shift + posterior._outputs.scale * K @ np.linalg.solve(
                A, posterior._outputs.apply(Y)
            )
            variance = weights @ covariance(P, P, particle) @ weights - K @ np.linalg.solve(A, K)
            assert found.mean[j, i] == pytest.approx(mean, abs=1e-6)
            assert found.variance[j, i] == pytest.approx(posterior._outputs.square * variance, abs=1e-6)


def test_a_trial_left_out_is_predicted_from_the_others(posterior):
    found, outputs = posterior.left_out(), posterior._outputs
    for j, particle in enumerate(posterior._particles):
        A = covariance(X, X, particle) + 1e-10 * particle.s2 * np.eye(len(X))
        for i in range(len(X)):
            rest = np.arange(len(X)) != i
            gain = np.linalg.solve(A[np.ix_(rest, rest)], A[rest, i])
            mean, variance = gain @ outputs.apply(Y[rest]), A[i, i] - gain @ A[rest, i]
            assert found.mean[j, i] == pytest.approx(outputs.shift + outputs.scale * mean, abs=1e-5)
            assert found.variance[j, i] == pytest.approx(outputs.scale**2 * variance, rel=1e-4, abs=1e-8)


@pytest.mark.parametrize("many", [False, True])
def test_weights_need_not_sum_to_one(many, posterior):
    offsets, weights = sigma_points(0.003 * np.eye(2)) if many else (np.zeros((1, 2)), np.ones(1))
    once, thrice = (posterior.average(Q, offsets, factor * weights, gradient=True) for factor in (1.0, 3.0))
    for one, other, factor in zip(once, thrice, (3.0, 9.0, 3.0, 9.0), strict=True):
        np.testing.assert_allclose(other, factor * one, rtol=1e-6, atol=1e-9)


def test_gradient_where_points_are_held_at_the_border(posterior):
    offsets, weights = sigma_points(0.003 * np.eye(2))
    U, h = np.array([[0.02, 0.5], [0.97, 0.99]]), 1e-6

    def held(V):
        return np.clip(V[:, None, :] + offsets, 0.0, 1.0) - V[:, None, :]

    inside = (U[:, None, :] + offsets > 0.0) & (U[:, None, :] + offsets < 1.0)
    assert not inside.all()
    found = posterior.average(U, held(U), weights, True, inside.astype(float))
    for k in range(2):
        up, down = (posterior.average(V, held(V), weights) for V in (U + h * np.eye(2)[k], U - h * np.eye(2)[k]))
        np.testing.assert_allclose(found.mean_gradient[..., k], (up.mean - down.mean) / (2 * h), rtol=1e-4, atol=1e-4)
        slope = (up.variance - down.variance) / (2 * h)
        np.testing.assert_allclose(found.variance_gradient[..., k], slope, rtol=1e-3, atol=1e-4)


def test_a_thinned_posterior_is_that_of_its_particles(posterior):
    whole, some = posterior.moments(Q), posterior.thinned(3, 1).moments(Q)
    for one, all_ in zip(some[:2], whole[:2], strict=True):
        np.testing.assert_array_equal(one, all_[1::3])


def test_hyperparameters_are_learnt_anew_where_later_trials_contradict():
    places = np.random.default_rng(5).random((33, 2))
    values = np.sin(4.0 * places[:, 0]) + places[:, 1]
    before, after, contradicted = (
        LocalGlobalProcess().condition(places[:n], values[:n] + shift, np.random.default_rng(0))._particles
        for n, shift in ((32, 0.0), (33, 0.0), (33, np.eye(33)[32] * 5.0))
    )
    scales = [np.array([particle.inverse_l for particle in some]) for some in (before, after, contradicted)]
    np.testing.assert_array_equal(scales[1], scales[0])
    assert not np.array_equal(scales[2], scales[0])


def test_density_of_the_hyperparameters(posterior):
    particle = posterior._particles[0]
    theta = np.concatenate([-np.log(particle.inverse_l).ravel(), [np.log(particle.s2)], particle.center])
    evidence = sh.GaussianProcess().fit(X, Y).posterior.evidence
    extended = evidence._replace(prior_mean=np.zeros(7), prior_deviation=np.full(7, 2.0))
    A = covariance(X, X, particle) + 1e-10 * particle.s2 * np.eye(len(X))
    expected = multivariate_normal(np.zeros(len(X)), A, allow_singular=True).logpdf(evidence.y)
    expected -= 0.5 * np.square(theta[:5] / 2.0).sum()
    assert log_posterior(theta, extended) == pytest.approx(expected, rel=1e-6)
    outside = theta.copy()
    for coordinate in (1.2, -0.2):
        outside[-1] = coordinate
        assert log_posterior(outside, extended) == -np.inf


@pytest.mark.parametrize("many", [False, True])
def test_gradients(many, posterior):
    offsets, weights = sigma_points(0.003 * np.eye(2)) if many else (np.zeros((1, 2)), np.ones(1))
    found = posterior.average(Q, offsets, weights, gradient=True)
    h = 1e-6
    for k in range(2):
        step = h * np.eye(2)[k]
        up, down = posterior.average(Q + step, offsets, weights), posterior.average(Q - step, offsets, weights)
        np.testing.assert_allclose(found.mean_gradient[..., k], (up.mean - down.mean) / (2 * h), rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(
            found.variance_gradient[..., k], (up.variance - down.variance) / (2 * h), rtol=1e-4, atol=1e-5
        )


def test_interpolates_samples_and_repeats_itself(posterior):
    np.testing.assert_allclose(posterior.moments(X).mean, np.broadcast_to(Y, (10, 18)), atol=1e-4)
    draws = posterior.sample(Q[None], np.random.default_rng(2).standard_normal((20_000, 5)))[:, 0]
    moments = posterior.moments(Q)
    np.testing.assert_allclose(draws.mean(axis=1), moments.mean, atol=0.02)
    np.testing.assert_allclose(draws.var(axis=1), moments.variance, rtol=0.06, atol=1e-6)
    again = LocalGlobalProcess().condition(X, Y, np.random.default_rng(1)).moments(Q)
    np.testing.assert_array_equal(again.mean, moments.mean)


def test_pending_trials_leave_the_mean_alone_and_take_the_variance(posterior):
    waiting = posterior.with_pending(Q[:2])
    np.testing.assert_allclose(waiting.moments(Q).mean, posterior.moments(Q).mean, atol=1e-5)
    assert waiting.moments(Q[:2]).variance.max() < 1e-6


def test_finds_the_needle_of_a_function_that_is_smooth_elsewhere():
    problem = sh.problems.RKHS()
    for seed in range(2):
        optimizer = sh.Optimizer(problem.box, n_initial=5, seed=seed, surrogate="local_global")
        for _ in range(40):
            x = optimizer.ask()
            optimizer.tell(x, float(problem(x)))
        assert optimizer.y.max() > 5.68
    assert optimizer.recommend().observed == optimizer.y.max()


def test_flat_data_and_one_trial():
    for y in (np.zeros(6), np.array([2.0])):
        found = LocalGlobalProcess().condition(X[: len(y)], y, np.random.default_rng(0)).moments(Q)
        assert np.isfinite(found.mean).all()
        assert np.isfinite(found.variance).all()


@pytest.mark.parametrize("settings", [{"noise": "inferred"}, {"noise": 0.1}, {"preset": "thesis"}])
def test_settings_that_it_has_not_are_refused(settings):
    with pytest.raises(InputError, match="local_global"):
        sh.Optimizer(sh.Box.unit(2), surrogate="local_global", **settings)

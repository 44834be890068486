"""Learning whether variables act each on its own: a sum of processes of one variable, with a share of one of all."""

import numpy as np
import pytest
from sklearn.gaussian_process.kernels import Matern

from surehold.defaults import ADDITIVE_UP_TO
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning
from surehold.optimization.surrogates.gaussian_process.kernels import LOG_ADDITIVE
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

D = 5


def additive(X):
    """Two tops along each variable, so 32 hills."""
    return np.sum(np.cos(8.0 * X) + X * np.arange(1, X.shape[1] + 1) / 4.0, axis=1)


def interacting(X):
    return np.sin(6.0 * X[:, 0] * X[:, 1]) * np.cos(5.0 * X[:, 2] - 4.0 * X[:, 3]) + X[:, 0] * X[:, -1]


def process(f, n=60, d=D, seed=0, **settings):
    X = np.random.default_rng(seed).random((n, d))
    return GaussianProcess(kernel="matern52_two_scales", mean_variance=1.0, **settings).fit(X, f(X))


def additive_particles(posterior):
    """Return which particles are sums."""
    return np.log(posterior.hyperparameters.inverse_l[:, -2]) > 0.5 * LOG_ADDITIVE


def test_a_sum_is_modelled_as_one_and_known_where_no_trial_has_been():
    learnt = process(additive)
    assert additive_particles(learnt.posterior).all()
    assert learnt.posterior.regions.separable
    X, Q = np.random.default_rng(0).random((60, D)), np.random.default_rng(1).random((500, D))
    mean, std = learnt.predict(Q, return_std=True)
    plain = GaussianProcess(mean_variance=1.0).fit(X, additive(X)).predict(Q)
    truth = additive(Q)
    error, before = (np.sqrt(np.mean((values - truth) ** 2)) for values in (mean, plain))
    assert error < 0.25 * before
    assert np.mean(np.abs(mean - truth) < 1.96 * std) > 0.9


def test_what_interacts_is_no_sum():
    posterior = process(interacting, n=100).posterior
    shares = posterior.hyperparameters.inverse_l[:, -1]
    assert not np.any(additive_particles(posterior) & (shares < 0.2))
    assert not posterior.regions.separable


@pytest.mark.parametrize("d", [1, ADDITIVE_UP_TO + 1])
def test_a_function_of_one_or_many_variables_has_no_such_particles(d):
    assert not additive_particles(process(additive, d=d).posterior).any()


def test_particles_predict_as_scikit_learns_kernels_added_up():
    posterior = process(additive, n=30, ratio=1e-8).posterior
    X, y, p = posterior.evidence.X, posterior.evidence.y, posterior.hyperparameters
    Q = np.random.default_rng(1).random((7, D))
    found = posterior.moments(Q)
    assert additive_particles(posterior).all()
    for j, scales in enumerate(posterior.length_scales):
        a, w = p.inverse_l[j, -2] * np.exp(-LOG_ADDITIVE), p.inverse_l[j, -1]

        def covariance(A, B, j=j, scales=scales, a=a, w=w):
            parts = [Matern(scales[k], nu=2.5)(A[:, [k]], B[:, [k]]) for k in range(D)]
            return p.s2[j] * ((1.0 - w) * np.mean(parts, axis=0) + w * Matern(scales / a, nu=2.5)(A, B)) + 1.0

        solved = np.linalg.solve(covariance(X, X) + 1e-8 * p.s2[j] * np.eye(30), np.c_[y, covariance(X, Q)])
        mean = covariance(Q, X) @ solved[:, 0]
        variance = np.diag(covariance(Q, Q) - covariance(Q, X) @ solved[:, 1:])
        np.testing.assert_allclose(found.mean[j], posterior.outputs.shift + posterior.outputs.scale * mean, atol=1e-5)
        np.testing.assert_allclose(found.variance[j], posterior.outputs.square * variance, atol=1e-5)


def test_gradients_of_outcomes_under_noise():
    posterior = process(additive, n=40).posterior
    rng = np.random.default_rng(2)
    offsets, slopes, weights = 0.1 * rng.standard_normal((6, D)), rng.uniform(0.0, 1.0, (6, D)), np.full(6, 1.0 / 6.0)
    Q = rng.random((1, D))
    found = posterior.average(Q, offsets[None], weights, True, slopes[None])
    h = 1e-6
    for k, step in enumerate(h * np.eye(D)):
        moments = []
        for move in (step, -step):
            moved = offsets + (slopes - 1.0) * move  # an offset moves against the query where its slope is below 1
            moments.append(posterior.average(Q + move, moved[None], weights))
        for name, by in (("mean", found.mean_gradient), ("variance", found.variance_gradient)):
            up, down = (getattr(one, name)[:, 0] for one in moments)
            np.testing.assert_allclose(by[:, 0, k], (up - down) / (2.0 * h), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("method", ["map", "elliptical_slice"])
def test_the_same_trials_give_the_same_particles(method):
    first, second = (process(additive, learning=Learning(method=method)).posterior for _ in range(2))
    np.testing.assert_array_equal(first.hyperparameters.theta, second.hyperparameters.theta)
    assert additive_particles(first).all()

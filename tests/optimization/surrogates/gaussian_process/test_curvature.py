"""The covariance of hyperparameters against SciPy's differences, and the short way for many against the whole one."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from surehold.optimization.surrogates.gaussian_process import curvature
from surehold.optimization.surrogates.gaussian_process.curvature import root_of_covariance
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Prior, mode
from surehold.optimization.surrogates.gaussian_process.likelihood import (
    Evidence,
    log_posterior,
    log_posterior_and_gradient,
)


def evidence_in(d, n, seed=0):
    X = np.random.default_rng(seed).random((n, d))
    y = np.sin(3.0 * X[:, :5]).sum(axis=1)
    mean, deviation = Prior((np.log(0.2 * d**0.5), 1.0)).vectors(d, True, False)
    return Evidence(
        *(X, (y - y.mean()) / y.std(), np.zeros(n), np.array([0, n]), np.ones(1), mean, deviation),
        *(1.0, 1e-6, 0.0, 0, True, False),
    )


def test_it_is_the_inverse_curvature_where_trials_say_more_than_the_prior():
    evidence = evidence_in(2, 30)
    center, _ = mode(evidence)
    hessian = approx_fprime(center, lambda theta: log_posterior_and_gradient(theta, evidence)[1], 1e-5)
    root = root_of_covariance(evidence, center)
    assert np.linalg.eigvalsh(-hessian).min() > 1.0
    np.testing.assert_allclose(root @ root.T, np.linalg.inv(-hessian), rtol=0.1, atol=0.01)
    assert np.isfinite(log_posterior(center, evidence))


def test_few_directions_are_enough_for_many_hyperparameters(monkeypatch):
    evidence = evidence_in(160, 70)
    center, _ = mode(evidence)
    short = root_of_covariance(evidence, center)
    monkeypatch.setattr(curvature, "MANY_HYPERPARAMETERS", 1000)
    whole = root_of_covariance(evidence, center)
    ratio = np.linalg.solve(whole, short)
    variances = np.linalg.eigvalsh(ratio @ ratio.T)
    assert 0.7 < variances.min() < variances.max() < 1.4
    assert np.ptp(np.linalg.eigvalsh(whole @ whole.T)) > 0.5, "some directions are determined"
    assert np.linalg.slogdet(short)[1] == pytest.approx(np.linalg.slogdet(whole)[1], abs=3.0)


@pytest.mark.parametrize("changed", [{"y": np.full(70, np.nan)}, {"noise": np.full(70, -10.0)}])
def test_many_hyperparameters_without_a_density_or_a_finite_gradient_have_their_prior(changed):
    evidence = evidence_in(160, 70)._replace(**changed)
    root = root_of_covariance(evidence, evidence.prior_mean)
    np.testing.assert_array_equal(root, np.diag(evidence.prior_deviation))


def test_directions_that_do_not_converge_are_left_out(monkeypatch):
    """Gradients with noise in them, as rounding at a nearly singular matrix gives: no endless search for directions."""
    evidence, rng, asked = evidence_in(160, 70), np.random.default_rng(0), []

    def noisy(theta, evidence):
        asked.append(theta)
        value, gradient = log_posterior_and_gradient(theta, evidence)
        return value, gradient + 10.0 * rng.standard_normal(len(theta))

    monkeypatch.setattr(curvature, "log_posterior_and_gradient", noisy)
    root = root_of_covariance(evidence, evidence.prior_mean)
    assert len(asked) < 1000
    assert np.all(np.isfinite(root))
    assert np.linalg.matrix_rank(root) == len(root)

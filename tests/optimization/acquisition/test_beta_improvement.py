"""The expected improvement of a Beta distributed probability, against quadrature, sampling and differences."""

import numpy as np
import pytest
from scipy import stats

from surehold.optimization.acquisition.beta_improvement import BetaImprovement, beta_improvement
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.surrogates.success.beta_process import BetaProcess

BOX = Box.unit(2)


def posterior():
    rng = np.random.default_rng(0)
    X = rng.random((40, 2))
    y = (rng.random(40) < np.exp(-4.0 * ((X - 0.6) ** 2).sum(axis=1))).astype(float)
    return BetaProcess(length_scales=[0.15, 0.2]).condition(X, y, rng)


def perturbations(kind):
    if kind == "varying":
        noise = InputNoise.varying(lambda x: np.array([0.02 + 0.2 * x[0], 0.05 + 0.1 * x[1]]))
    else:
        noise = None if kind == "exact" else InputNoise.unit(0.08)
    return Perturbations.of(noise, BOX, "unscented", "clip" if kind == "clip" else "extend")


@pytest.mark.parametrize("best", [0.0, 0.4, 0.95])
@pytest.mark.parametrize(("alpha", "beta"), [(1.0, 1.0), (3.5, 1.2), (40.0, 3.0), (0.6, 5.0)])
def test_expected_improvement_by_quadrature(alpha, beta, best):
    law = stats.beta(alpha, beta)
    expected = law.expect(lambda p: p - best, lb=best, ub=1.0)
    found = beta_improvement(np.array(law.mean()), np.array(law.var()), best)
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("kind", ["exact", "extend", "clip", "varying"])
def test_gradient_by_differences(kind):
    criterion = BetaImprovement(posterior(), perturbations(kind), 0.7)
    U = np.array([[0.31, 0.42], [0.83, 0.2], [0.97, 0.55]])
    values, gradient = criterion.with_gradient(U)
    np.testing.assert_allclose(values, criterion(U), rtol=1e-12)
    for k, h in enumerate(1e-6 * np.eye(2)):
        np.testing.assert_allclose(gradient[:, k], (criterion(U + h) - criterion(U - h)) / 2e-6, rtol=1e-4, atol=1e-5)


def test_under_input_noise_it_is_that_of_joint_draws():
    shaken, model, U = perturbations("extend"), posterior(), np.array([[0.4, 0.5]])
    normals = np.random.default_rng(1).standard_normal((40_000, len(shaken.quadrature.weights)))
    average = model.sample(shaken.around(U), normals)[0, 0] @ shaken.quadrature.weights
    expected = np.maximum(average - 0.6, 0.0).mean()
    assert np.exp(BetaImprovement(model, shaken, 0.6)(U)).item() == pytest.approx(expected, rel=0.08)


def test_where_nothing_can_be_gained_it_stays_finite():
    criterion = BetaImprovement(posterior(), perturbations("exact"), 1.0)
    values, gradient = criterion.with_gradient(np.random.default_rng(0).random((5, 2)))
    assert np.isfinite(values).all()
    assert not gradient.any()

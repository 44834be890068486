import numpy as np
import pytest

from surehold.optimization.acquisition.where_to_look import where_to_look
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import sigma_points
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

S = np.diag([0.01, 0.0025])
U = np.array([[0.31, 0.52], [0.8, 0.15], [0.04, 0.97]])


def posterior_of(noise):
    X = np.random.default_rng(0).random((12, 2))
    return GaussianProcess(noise=noise).fit(X, np.sin(4 * X[:, 0]) * np.cos(3 * X[:, 1])).posterior


@pytest.mark.parametrize("held", [None, np.array([False, False])], ids=["own", "uncontrolled"])
@pytest.mark.parametrize("noise", ["none", 0.1])
@pytest.mark.parametrize("u", [*U, [0.5, 0.5]])
def test_where_to_look_takes_the_trial_that_tells_most(noise, u, held):
    posterior = posterior_of(noise)
    perturbations = Perturbations(sigma_points(S), held=held)
    u, offsets, weights = np.asarray(u), *sigma_points(S)
    points = where_to_look(posterior, u, perturbations, perturbations)
    steps = offsets[np.any(offsets != 0.0, axis=1)]
    considered = np.clip(u + np.vstack([np.zeros((1, 2)), steps, 0.5 * steps]), 0.0, 1.0)
    np.testing.assert_allclose(*(p[np.lexsort(p.T)] for p in (points, considered)), atol=1e-15)

    def variance(model):
        return model.average(u[None, :], offsets, weights).variance.mean()

    told = np.array([variance(posterior) - variance(posterior.with_pending(point[None, :])) for point in points])
    told[np.all(points == u, axis=1)] *= 3.0 if held is None else 1.0
    assert np.all(np.diff(told) < 1e-6), "a later point tells more than an earlier one"

"""Observation noise that each trial tells."""

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer

BOX = Box({"x": (0.0, 1.0)})
X = np.linspace(0.05, 0.95, 12)[:, None]
DEVIATIONS = np.where(np.arange(12) % 2, 0.3, 0.01)


def told(seed=0, **settings):
    rng = np.random.default_rng(seed)
    optimizer = Optimizer(BOX, noise="told", surrogate="gp", seed=0, **settings)
    for x, s in zip(X, DEVIATIONS, strict=True):
        optimizer.tell(x, float(np.sin(6.0 * x[0]) + s * rng.standard_normal()), noise=s)
    return optimizer


def test_each_trial_counts_as_precise_as_it_says():
    """Against scikit-learn, particle by particle of the hyperparameters that were learnt."""
    optimizer = told()
    posterior = optimizer.posterior
    queries = np.linspace(0.0, 1.0, 9)[:, None]
    moments = posterior.moments(queries)
    scale = float(np.std(optimizer.y))
    for k, theta in enumerate(np.exp(posterior.hyperparameters.theta)):
        kernel = ConstantKernel(theta[-1], "fixed") * Matern(theta[:1], "fixed", nu=2.5)
        center, spread = posterior.outputs.shift, posterior.outputs.scale
        model = GaussianProcessRegressor(kernel, alpha=(DEVIATIONS / spread) ** 2, optimizer=None)
        model.fit(X, (optimizer.y - center) / spread)
        mean, std = model.predict(queries, return_std=True)
        np.testing.assert_allclose(moments.mean[k], center + spread * mean, atol=2e-4 * scale)
        np.testing.assert_allclose(np.sqrt(moments.variance[k]), spread * std, atol=2e-3 * scale)


def test_an_unsure_spike_is_not_recommended_and_a_sure_one_is():
    answers = {}
    for s in (0.01, 3.0):
        optimizer = told()
        optimizer.tell([0.9], 1.5, noise=s)
        answers[s] = optimizer.recommend().x[0]
    assert answers[0.01] == 0.9
    assert abs(answers[3.0] - 0.26) < 0.1


def test_an_execution_has_the_noise_of_the_trials():
    optimizer = told()
    best = optimizer.recommend()
    assert best.execution.std**2 - best.expectation.std**2 == pytest.approx(np.mean(DEVIATIONS**2), rel=1e-6)


def test_saved_restored_and_asked_alike(tmp_path):
    optimizer = told(input_noise=InputNoise.unit(0.03))
    optimizer.save(tmp_path / "run.json")
    again = Optimizer.load(tmp_path / "run.json")
    other = Optimizer(BOX, noise="told", surrogate="gp", seed=0, input_noise=InputNoise.unit(0.03))
    other.restore(optimizer.X, optimizer.y, noise=DEVIATIONS)
    expected = optimizer.ask()
    assert np.array_equal(again.ask(), expected)
    assert np.array_equal(other.ask(), expected)
    assert other.recommend().mean == optimizer.recommend().mean
    third = Optimizer(BOX, noise="told", surrogate="gp", seed=0, input_noise=InputNoise.unit(0.03))
    third.restore(optimizer.X, optimizer.y, noise=np.full(12, 0.01))
    assert third.recommend().mean != optimizer.recommend().mean


@pytest.mark.parametrize("noise", [None, -0.1, np.nan, "much", True and [0.1, 0.2]])
def test_what_is_no_deviation_is_refused(noise):
    optimizer = Optimizer(BOX, noise="told")
    with pytest.raises(InputError, match="standard deviation"):
        optimizer.tell([0.5], 1.0, noise=noise)
    optimizer.tell([0.5], failed=True)
    assert len(optimizer.y) == 1


def test_who_does_not_expect_it_says_so():
    with pytest.raises(InputError, match="noise='told'"):
        Optimizer(BOX).tell([0.5], 1.0, noise=0.1)
    for settings in ({"surrogate": "local_global"}, {"preset": "thesis"}):
        with pytest.raises(InputError, match="noise='told'"):
            Optimizer(BOX, noise="told", **settings)

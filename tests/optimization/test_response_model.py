"""What the surrogate is told of the trials, and what of their noise is an execution's."""

import numpy as np
import pytest

from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer

BOX = Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
X = np.random.default_rng(1).random((14, 2))
Y = np.sin(7 * X[:, 0]) * np.cos(5 * X[:, 1])
Q = np.random.default_rng(2).random((40, 2))


def told(times, values=Y, **settings):
    optimizer = Optimizer(BOX, seed=0, **settings)
    optimizer.restore(np.tile(X, (times, 1)), np.tile(values, times))
    return optimizer


@pytest.mark.parametrize("surrogate", ["two_scales", "tgp", "local_global"])
def test_exact_trials_that_are_told_again_change_nothing(surrogate):
    once, thrice = told(1, surrogate=surrogate), told(3, surrogate=surrogate)
    for found, expected in zip(thrice.predict(Q), once.predict(Q), strict=True):
        np.testing.assert_array_equal(found, expected)
    assert thrice.diagnosis().error == once.diagnosis().error
    assert thrice.diagnosis().n == 14
    assert thrice.promise() == pytest.approx(once.promise(), rel=1e-3)


def test_limited_outputs_that_are_told_again_change_nothing():
    found = []
    for times in (1, 3):
        optimizer = Optimizer(BOX, seed=0, constraints={"force": (None, 0.3)})
        outputs = np.tile(np.sin(9 * X[:, :1]), (times, 1))
        optimizer.restore(np.tile(X, (times, 1)), np.tile(Y, times), outputs=outputs)
        answer = optimizer.recommend()
        found.append((answer.outputs["force"].mean, answer.outputs["force"].std, answer.feasible))
    assert found[0] == found[1]


def test_trials_that_differ_all_count():
    rng = np.random.default_rng(0)
    noisy = Optimizer(BOX, seed=0, noise=0.1)
    noisy.restore(np.tile(X, (2, 1)), np.tile(Y, 2))
    assert noisy.posterior.diagnostics.observations == 28, "under noise the same value again is news"
    contradicted = Optimizer(BOX, seed=0)
    contradicted.restore(np.tile(X, (2, 1)), np.concatenate([Y, Y + 0.3 * rng.standard_normal(14)]))
    assert contradicted.diagnosis().contradicted


@pytest.mark.parametrize("deviation", [0.0, 0.5])
@pytest.mark.parametrize("noise", ["inferred", "heteroscedastic"])
def test_what_trials_strayed_is_no_noise_of_executions_besides(noise, deviation):
    """A slope of 3 under noise of .1: executions differ by .3, and the noise learnt from trials is that already."""
    found = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        x = rng.random((150, 1))
        y = 3.0 * (x[:, 0] + 0.1 * rng.standard_normal(150)) + deviation * rng.standard_normal(150)
        optimizer = Optimizer(
            Box({"x": (0.0, 1.0)}),
            input_noise=InputNoise.unit(0.1),
            noise_while_exploring=True,
            noise=noise,
            allowed="x <= 0.5",
        )
        optimizer.restore(x, y)
        found.append(optimizer.recommend().std)
    assert np.mean(found) == pytest.approx(np.hypot(0.3, deviation), rel=0.15)

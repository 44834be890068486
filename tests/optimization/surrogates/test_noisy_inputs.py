import numpy as np
import pytest
from scipy import special
from scipy.stats import qmc

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.surrogates import noisy_inputs
from surehold.optimization.surrogates.local_global.model import LocalGlobalProcess
from surehold.optimization.surrogates.noisy_inputs import by_straying, condition_on_noisy_inputs

BOX = sh.Box({"x": (0.0, 2.0), "y": (0.0, 5.0)})


def steep(U):
    return np.tanh(12.0 * (U[:, 0] - 0.5)) + 0.3 * U[:, 1]


def test_a_straying_trial_of_a_line_counts_as_noisy_by_slope_times_deviation():
    rng = np.random.default_rng(0)
    X = rng.random((40, 2))
    roots = np.broadcast_to(np.diag([0.03, 0.01]), (40, 2, 2)).copy()
    roots[5] = 0.0
    y = 3.0 * X[:, 0] - 4.0 * X[:, 1]
    posterior = condition_on_noisy_inputs(sh.GaussianProcess(noise=0.02), X, y, roots, [0])
    noise = posterior.outputs.scale * np.sqrt(posterior.evidence.noise)
    np.testing.assert_allclose(np.delete(noise, 5), np.hypot(0.02, np.hypot(0.09, 0.04)), rtol=0.1)
    assert noise[5] == pytest.approx(0.02)


def test_the_correction_brings_the_model_nearer_to_the_function():
    grid = np.random.default_rng(9).random((200, 2))
    gains = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        X = rng.random((40, 2))
        roots = np.broadcast_to(np.diag([0.06, 0.0]), (40, 2, 2))
        y = steep(X + rng.standard_normal((40, 2)) @ np.diag([0.06, 0.0]))
        exact = sh.GaussianProcess().fit(X, y).posterior.moments(grid).mean.mean(axis=0)
        corrected = condition_on_noisy_inputs(sh.GaussianProcess(), X, y, roots, [0]).moments(grid).mean.mean(axis=0)
        gains.append(np.sqrt(np.mean((exact - steep(grid)) ** 2)) - np.sqrt(np.mean((corrected - steep(grid)) ** 2)))
    assert np.mean(gains) > 3.0 * np.std(gains) / np.sqrt(6.0)


@pytest.mark.parametrize("surrogate", ["gp", "tgp"])
def test_optimizer_whose_trials_stray_finds_the_safe_hill(surrogate):
    def f(x):
        return float(1.5 * np.exp(-0.5 * ((x[0] - 0.2) / 0.01) ** 2) + np.exp(-0.5 * ((x[0] - 0.7) / 0.1) ** 2))

    noise = sh.InputNoise.unit(0.03)
    rng = np.random.default_rng(0)
    optimizer = sh.Optimizer(
        sh.Box({"x": (0.0, 1.0)}), input_noise=noise, surrogate=surrogate, noise_while_exploring=True, seed=0
    )
    for i in range(40):
        x = optimizer.ask()
        reached = np.clip(x + 0.03 * rng.standard_normal(1), 0.0, 1.0)
        optimizer.tell(x, f(reached), reached=reached if i % 2 else None)
    best = optimizer.recommend()
    assert best.x[0] == pytest.approx(0.7, abs=0.06)
    assert best.mean == pytest.approx(0.957, abs=0.08)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"input_noise": sh.InputNoise.unit(0.1), "preset": "thesis"},
        {"input_noise": sh.InputNoise.unit(0.1), "surrogate": "local_global"},
        {"input_noise": sh.InputNoise.unit(0.1), "surrogate": LocalGlobalProcess()},
    ],
)
def test_straying_needs_input_noise_and_a_surrogate_that_takes_it(settings):
    with pytest.raises(InputError, match="noise_while_exploring needs"):
        sh.Optimizer(BOX, noise_while_exploring=True, **settings)


@pytest.mark.parametrize("noise", ["none", 0.05, "inferred"])
def test_straying_is_the_same_with_a_surrogate_object(noise):
    rng = np.random.default_rng(3)
    X = rng.random((12, 2)) * [2.0, 5.0]
    kinds = ({"surrogate": "gp", "noise": noise}, {"surrogate": sh.GaussianProcess(noise=noise)})
    named, given = (
        sh.Optimizer(BOX, input_noise=sh.InputNoise.unit(0.05), noise_while_exploring=True, **kind) for kind in kinds
    )
    for optimizer in (named, given):
        for x in X:
            optimizer.tell(x, float(steep(x[None, :])[0]))
    assert np.array_equal(named.predict(X), given.predict(X))


@pytest.mark.parametrize("noise", [0.01, "inferred"])
def test_a_hill_is_not_learnt_as_its_average(noise):
    """Of a parabola, averaging takes off half the trace of Hessian times covariance: here 8 * 0.1**2 = 0.08."""
    X = np.linspace(0.0, 1.0, 25)[:, None]
    f = -8.0 * (X[:, 0] - 0.5) ** 2
    roots = np.full((25, 1, 1), 0.1)
    roots[::5] = 0.0  # reached inputs are known: the value there is that of the function
    y = np.where(roots[:, 0, 0] > 0.0, f - 0.08, f)
    found = condition_on_noisy_inputs(sh.GaussianProcess(noise=noise), X, y, roots, [0]).moments(X)
    inside = slice(6, 19)
    assert abs((found.mean.mean(axis=0) - f)[inside].mean()) < 0.03


def test_what_straying_does_to_a_quadratic_function_is_what_scipy_draws(monkeypatch):
    """Mean and variance along the axes of the noise; each axis has a slope and a curvature, all of which is counted."""
    monkeypatch.setattr(noisy_inputs, "CURVATURE_WEIGHT", 2.0)
    rng = np.random.default_rng(4)
    X = rng.random((60, 2))
    slope, curvature, deviations = np.array([0.6, -0.3]), np.array([-9.0, 5.0]), np.array([0.08, 0.05])

    def f(x):
        return x @ slope + 0.5 * (x - 0.5) ** 2 @ curvature

    posterior = sh.GaussianProcess(kernel="squared_exponential").fit(X, f(X)).posterior
    inner = np.array([[0.5, 0.5], [0.3, 0.6], [0.6, 0.35]])
    added, variance = by_straying(posterior, inner, np.broadcast_to(np.diag(deviations), (3, 2, 2)))
    np.testing.assert_allclose(added, 0.5 * curvature @ deviations**2, rtol=0.02)
    normals = special.ndtri(qmc.Sobol(2, seed=0).random(2**14))
    outcomes = f(inner[:, None, :] + deviations * normals)
    np.testing.assert_allclose(variance, outcomes.var(axis=1), rtol=0.02)


def test_on_top_of_a_hill_a_trial_that_strays_is_noisy():
    X = np.linspace(0.0, 1.0, 25)[:, None]
    posterior = sh.GaussianProcess(kernel="squared_exponential").fit(X, -8.0 * (X[:, 0] - 0.5) ** 2).posterior
    _, variance = by_straying(posterior, np.array([[0.5]]), np.full((1, 1, 1), 0.1))
    assert variance[0] == pytest.approx(noisy_inputs.CURVATURE_WEIGHT * 0.08**2, rel=0.02)


def test_what_averaging_adds_is_half_the_trace_of_hessian_times_covariance():
    rng = np.random.default_rng(4)
    X = rng.random((60, 2))
    hessian, root = np.array([[-3.0, 1.0], [1.0, 2.0]]), np.array([[0.05, 0.0], [0.03, 0.04]])
    y = 0.5 * np.einsum("ni,ij,nj->n", X - 0.5, hessian, X - 0.5)
    posterior = sh.GaussianProcess(kernel="squared_exponential").fit(X, y).posterior
    inner = X[np.all(np.abs(X - 0.5) < 0.3, axis=1)]
    added, _ = by_straying(posterior, inner, np.broadcast_to(root, (len(inner), 2, 2)))
    np.testing.assert_allclose(added, 0.5 * np.trace(hessian @ root @ root.T), rtol=0.05)


@pytest.mark.parametrize("noise", ["none", 0.02, "inferred"])
def test_an_offset_of_straying_trials_is_counted_once(noise):
    """Trials fall short by 0.1 and nobody reports it: what came of them is the value there, not where they were sent.

    A hill at 0.6 is reached by sending to 0.7; of errors that are given both trials and executions have the offset.
    """

    def f(x):
        return np.exp(-0.5 * ((x - 0.6) / 0.15) ** 2)

    rng = np.random.default_rng(0)
    errors = -0.1 + 0.02 * rng.standard_normal(200)
    optimizer = sh.Optimizer(
        sh.Box({"x": (0.0, 1.0)}),
        input_noise=sh.InputNoise.samples(errors),
        noise_while_exploring=True,
        noise=noise,
        surrogate="gp",
    )
    X = np.linspace(0.0, 1.0, 26)[:, None]
    reached = X + rng.choice(errors, (26, 1))
    y = f(reached[:, 0]) + (0.0 if noise == "none" else 0.02 * rng.standard_normal(26))
    told = np.arange(26) % 5 == 0
    optimizer.restore(X, y, reached=np.where(told[:, None], reached, X))
    best = optimizer.recommend()
    assert best.x[0] == pytest.approx(0.7, abs=0.05)
    assert best.mean == pytest.approx(f(best.x[0] + errors).mean(), abs=0.03)

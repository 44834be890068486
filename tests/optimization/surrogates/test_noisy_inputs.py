import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.surrogates.noisy_inputs import (
    condition_on_noisy_inputs,
    noise_from_reached,
    noise_from_repeats,
)

BOX = sh.Box({"x": (0.0, 2.0), "y": (0.0, 5.0)})


def steep(U):
    return np.tanh(12.0 * (U[:, 0] - 0.5)) + 0.3 * U[:, 1]


def test_a_straying_trial_of_a_line_counts_as_noisy_by_slope_times_deviation():
    rng = np.random.default_rng(0)
    X = rng.random((40, 2))
    roots = np.broadcast_to(np.diag([0.03, 0.01]), (40, 2, 2)).copy()
    roots[5] = 0.0
    y = 3.0 * X[:, 0] - 4.0 * X[:, 1]
    posterior = condition_on_noisy_inputs(sh.GaussianProcess(), X, y, roots, 0.02, [0])
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
        corrected = (
            condition_on_noisy_inputs(sh.GaussianProcess(), X, y, roots, 0.0, [0]).moments(grid).mean.mean(axis=0)
        )
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


def test_noise_of_reached_inputs():
    rng = np.random.default_rng(1)
    U = rng.random((60, 2))
    S = np.array([[0.02**2, 0.6 * 0.02 * 0.01], [0.6 * 0.02 * 0.01, 0.01**2]])
    strays = rng.multivariate_normal([0.0, 0.0], S, 60)
    found = noise_from_reached(BOX, U, U + strays).unit_covariance(BOX)
    np.testing.assert_allclose(found, strays.T @ strays / 60, rtol=1e-9)
    few = noise_from_reached(BOX, U[:5], (U + strays)[:5]).unit_covariance(BOX)
    np.testing.assert_allclose(np.diag(few), np.mean(strays[:5] ** 2, axis=0), rtol=1e-9)
    assert few[0, 1] == 0.0


def test_noise_of_repeated_inputs():
    rng = np.random.default_rng(2)
    shares = []
    for _ in range(10):
        places = np.repeat(rng.random((15, 2)), 4, axis=0)
        y = (lambda U: np.sin(4.0 * U[:, 0]) + 2.0 * U[:, 1])(places + 0.02 * rng.standard_normal(places.shape))
        shares.append(np.sqrt(noise_from_repeats(places, y).unit_covariance(BOX)[0, 0]))
    assert np.mean(shares) == pytest.approx(0.02, rel=0.15)


def test_no_guess_without_data():
    optimizer = sh.Optimizer(BOX, seed=0)
    for _ in range(12):
        x = optimizer.ask()
        optimizer.tell(x, float(x[0]))
    with pytest.raises(InputError, match="repeated 0 times"):
        optimizer.estimate_input_noise()
    x = optimizer.X[0]
    for _ in range(5):
        optimizer.tell(x, 100.0 * np.random.default_rng(len(optimizer.y)).random())
    with pytest.raises(InputError, match="too level"):
        optimizer.estimate_input_noise()
    optimizer.tell(x, 1.0, reached=BOX.from_unit(np.clip(BOX.to_unit(x) + 0.01, 0.0, 1.0)))
    with pytest.raises(InputError, match="at least 4"):
        optimizer.estimate_input_noise()


def test_equal_repeats_show_no_noise():
    places = np.repeat(np.random.default_rng(0).random((4, 2)), 3, axis=0)
    with pytest.raises(InputError, match="no sign"):
        noise_from_repeats(places, places[:, 0])


@pytest.mark.parametrize("settings", [{}, {"input_noise": sh.InputNoise.unit(0.1), "preset": "thesis"}])
def test_straying_needs_input_noise_and_no_preset(settings):
    with pytest.raises(InputError, match="noise_while_exploring needs"):
        sh.Optimizer(BOX, noise_while_exploring=True, **settings)

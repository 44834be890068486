import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.noise.estimation import noise_from_reached, noise_from_repeats

BOX = sh.Box({"x": (0.0, 2.0), "y": (0.0, 5.0)})


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

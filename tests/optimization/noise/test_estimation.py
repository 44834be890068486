import warnings

import numpy as np
import pytest
from scipy import stats

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


@pytest.mark.parametrize("size", [2, 5])
def test_repeats_on_a_plane_tell_the_share_by_their_degrees_of_freedom(size):
    rng = np.random.default_rng(3)
    places = np.repeat(rng.random((80 // size, 2)), size, axis=0)
    y = places @ [1.0, 2.0] + 0.05 * rng.standard_normal(80)
    share = np.sqrt(y.reshape(-1, size).var(axis=1, ddof=1).mean() / 5.0)
    assert np.sqrt(noise_from_repeats(places, y).unit_covariance(BOX)[0, 0]) == pytest.approx(share, rel=0.05)
    with pytest.raises(InputError, match="repeated 3 times"):
        noise_from_repeats(np.repeat(places[::size][:4], [4, 1, 1, 1], axis=0), y[:7])


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


MIXED = sh.Box({"gap_m": (0.0, 1e-3), "T_K": (300.0, 1300.0)})


def reports(strays, box=MIXED, seed=0):
    """Return commanded inputs in the unit cube and reached ones that stray by (n, d) in the box's units."""
    U = np.random.default_rng(seed).random(strays.shape)
    return U, U + strays / box.widths


def test_twenty_five_reports_of_meters_and_kelvin():
    S = np.array([[1e-10, 1e-4], [1e-4, 400.0]])
    strays = np.random.default_rng(1).multivariate_normal([0.0, 0.0], S, 25, method="cholesky")
    optimizer = sh.Optimizer(MIXED, seed=0)
    for _, stray in zip(range(25), strays, strict=True):
        x = (
            optimizer.ask()
            if len(optimizer.y) < 10
            else MIXED.from_unit(np.random.default_rng(len(optimizer.y)).random(2))
        )
        x = np.clip(x, MIXED.lower + 0.1 * MIXED.widths, MIXED.upper - 0.1 * MIXED.widths)
        optimizer.tell(x, float(x[1]), reached=x + stray)
    found = optimizer.estimate_input_noise().unit_covariance(MIXED) * np.outer(MIXED.widths, MIXED.widths)
    np.testing.assert_allclose(found, strays.T @ strays / 25, rtol=1e-6)


def test_an_exact_variable_among_many_reports_stays_exact():
    strays = np.random.default_rng(2).normal(0.0, 20.0, (30, 2)) * [0.0, 1.0]
    found = noise_from_reached(MIXED, *reports(strays)).unit_covariance(MIXED)
    assert found[0, 0] == found[0, 1] == 0.0
    assert found[1, 1] == pytest.approx(np.mean(strays[:, 1] ** 2) / 1e6)


def test_variables_that_stray_in_step_keep_their_deviations():
    strays = np.random.default_rng(3).normal(0.0, 1.0, (30, 1)) * [1e-5, 20.0]
    found = noise_from_reached(MIXED, *reports(strays)).unit_covariance(MIXED)
    np.testing.assert_allclose(np.diag(found), np.mean(strays**2, axis=0) / MIXED.widths**2)
    assert found[0, 1] == 0.0


@pytest.mark.parametrize("n", [8, 30])
def test_a_constant_offset_is_named_and_is_no_noise(n):
    strays = np.random.default_rng(4).normal(0.0, 1.0, (n, 2)) * [1e-5, 20.0] + [1e-4, 0.0]
    with pytest.warns(UserWarning, match=r"gap_m by 9\.\d+e-05 .*not noise"):
        found = noise_from_reached(MIXED, *reports(strays))
    expected = np.square(strays - [strays[:, 0].mean(), 0.0]).sum(axis=0) / (n - 1)
    np.testing.assert_allclose(np.diag(found.unit_covariance(MIXED)), expected / MIXED.widths**2, rtol=1e-9)


def test_an_offset_alone_is_no_noise():
    with pytest.warns(UserWarning, match="T_K by 30"), pytest.raises(InputError, match="no sign of input noise"):
        noise_from_reached(MIXED, *reports(np.tile([0.0, 30.0], (6, 1))))


@pytest.mark.parametrize(("factor", "named"), [(0.98, False), (1.02, True)])
def test_an_offset_is_one_where_students_test_of_so_many_variables_says_so(factor, named):
    n, level = 12, 1e-3 / 2
    shape = np.random.default_rng(6).standard_normal((n, 2))
    shape = (shape - shape.mean(axis=0)) / shape.std(axis=0, ddof=1)
    offset = factor * stats.t.isf(level / 2, n - 1) / np.sqrt(n)
    strays = (shape + np.array([offset, 0.0])) * [1e-5, 20.0]
    assert (stats.ttest_1samp(strays[:, 0], 0.0).pvalue < level) == named
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        noise_from_reached(MIXED, *reports(strays))
    assert len(found) == named


def test_reports_fewer_than_variables_and_two_tell_nothing():
    with pytest.raises(InputError, match="at least 4"):
        noise_from_reached(BOX, np.full((3, 2), 0.5), np.full((3, 2), 0.5) + np.diag([0.1, 0.2, 0.3])[:, :2])


def test_noise_without_offset_is_seldom_taken_for_one():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        for seed in range(3000):
            noise_from_reached(MIXED, *reports(np.random.default_rng(seed).normal(0.0, 1.0, (12, 2)) * [1e-5, 20.0]))
    assert all("off on average" in str(warning.message) for warning in found)
    assert 0 < len(found) < 12, "3 are expected of 3000"


def test_choices_are_left_out_of_what_is_estimated():
    box = sh.Box({"g": ["a", "b"], "x": (0.0, 1.0)})
    optimizer, rng = sh.Optimizer(box, n_initial=12, seed=0), np.random.default_rng(0)
    strays = []
    for _ in range(12):
        trial = optimizer.ask_trial()
        strays.append(rng.normal(0.0, 0.02))
        reached = {**trial.parameters, "x": trial.parameters["x"] + strays[-1]}
        optimizer.tell(trial, 0.0, reached=reached)
    noise = optimizer.estimate_input_noise()
    assert np.sqrt(noise.unit_covariance(sh.Box({"x": (0.0, 1.0)}))[0, 0]) == pytest.approx(np.std(strays), rel=0.2)
    sh.Optimizer(box, input_noise=noise)

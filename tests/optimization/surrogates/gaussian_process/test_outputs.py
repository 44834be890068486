"""The scale of outputs, above all where they hardly differ."""

import numpy as np
import pytest

import surehold as sh
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization

WAVE = np.sin(6.0 * np.linspace(0.0, 1.0, 9))


@pytest.mark.parametrize("height", [4.9e-5, 1e-5, 1e-6])
def test_far_from_zero_what_doubles_resolve_is_a_difference(height):
    found = Standardization.of(1e8 + height * WAVE)
    assert not found.flat
    assert found.scale == pytest.approx(height * WAVE.std(), rel=0.03)  # doubles are 1.5e-8 apart there


@pytest.mark.parametrize("level", [0.3, -3.0, 1e8, 1e-6])
def test_equal_outputs_and_rounding_say_nothing_but_their_size(level):
    for y in (np.full(9, level), level + 8.0 * np.spacing(level) * WAVE):
        found = Standardization.of(y)
        assert found.flat
        assert found.scale == pytest.approx(abs(level))


def test_the_smallest_and_the_largest_floats_have_a_scale():
    for y in ([0.0, 5e-324], [1.7e308, -1.7e308], [1.7e308, 1.7e308]):
        found = Standardization.of(np.array(y))
        assert np.isfinite(found.scale)
        assert found.scale > 0.0


def test_small_differences_of_large_values_are_stated_as_small():
    X = np.linspace(0.0, 1.0, 9)[:, None]
    optimizer = sh.Optimizer(sh.Box.unit(1), seed=0)
    optimizer.restore(X, 1e8 + 4.9e-5 * WAVE)
    assert optimizer.recommend().std < 1e-6
    assert optimizer.promise() < 1e-5


def test_a_stated_range_never_makes_the_scale_smaller_than_the_spread():
    y = np.array([0.0, 4.0, 8.0])
    assert Standardization.of(y, (0.0, 100.0)).scale == 25.0
    assert Standardization.of(y, (0.0, 1.0)).scale == pytest.approx(np.std(y))


def test_a_coarse_scale_is_the_nearest_power_of_the_root_of_two_and_squares_stay_finite():
    for scale in np.geomspace(1e-3, 1e3, 61):
        coarse = Standardization(0.0, float(scale), False).coarse().scale
        assert coarse**2 == pytest.approx(2.0 ** np.round(np.log2(scale**2)), rel=1e-12)
    assert Standardization(0.0, 1e200, False).square == pytest.approx(1e300)

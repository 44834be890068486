import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surehold.optimization.maximizer.multistart import multistart


class Function:
    """A function of the unit cube with a gradient, made from NumPy expressions."""

    def __init__(self, value, gradient):
        self._value, self._gradient = value, gradient

    def __call__(self, U):
        return self._value(U)

    def with_gradient(self, U):
        return self._value(U), self._gradient(U)


def bowl(center):
    center = np.asarray(center)
    return Function(lambda U: -np.sum((U - center) ** 2, axis=1), lambda u: -2.0 * (u - center))


def two_peaks(width):
    """A broad hill at 0.25 of height 1 and a narrow peak at 0.8 of height 2, the same in every variable."""

    def parts(U):
        hill = np.exp(-0.5 * np.sum((U - 0.25) ** 2, axis=-1) / 0.2**2)
        peak = 2.0 * np.exp(-0.5 * np.sum((U - 0.8) ** 2, axis=-1) / width**2)
        return hill, peak

    def gradient(u):
        hill, peak = (part[:, None] for part in parts(u))
        return -hill * (u - 0.25) / 0.2**2 - peak * (u - 0.8) / width**2

    return Function(lambda U: sum(parts(U)), gradient)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-0.3, 1.3), min_size=1, max_size=6))
def test_multistart_finds_the_top_of_a_bowl_also_on_the_border(center):
    d = len(center)
    f = bowl(center)
    found = multistart(f, f, d, np.full((1, d), 0.5), np.random.default_rng(0))
    np.testing.assert_allclose(found[0], np.clip(center, 0.0, 1.0), atol=1e-4)
    assert np.all((found >= 0.0) & (found <= 1.0))


@pytest.mark.parametrize("d", [1, 2])
def test_multistart_finds_the_higher_of_two_peaks(d):
    f = two_peaks(0.05)
    for seed in range(5):
        found = multistart(f, f, d, np.full((1, d), 0.25), np.random.default_rng(seed))
        np.testing.assert_allclose(found[0], 0.8, atol=1e-3)


def test_a_needle_is_found_from_an_anchor_on_its_flank():
    f = two_peaks(0.004)
    found = multistart(f, f, 2, np.full((1, 2), 0.802), np.random.default_rng(0))
    np.testing.assert_allclose(found[0], 0.8, atol=1e-4)


def test_ascents_come_first_and_best_first():
    f = two_peaks(0.05)
    found = multistart(f, f, 2, np.full((1, 2), 0.5), np.random.default_rng(1))
    ascents = f(found)[:4]
    assert np.all(np.diff(ascents) <= 1e-12)
    assert ascents[0] >= f(found).max() - 1e-9
    assert len(found) > 256


def test_reproducible():
    f = two_peaks(0.05)
    first, second = (multistart(f, f, 2, np.full((1, 2), 0.5), np.random.default_rng(3)) for _ in range(2))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("exponent", [-170.0, -161.0, -160.5, -155.0, -140.0])
@pytest.mark.parametrize("d", [1, 3])
def test_a_top_at_the_border_but_for_next_to_nothing(d, exponent):
    """The last steps are as short, and their squares underflow: the quasi-Newton update once divided by them."""
    f = bowl(np.full(d, 10.0**exponent))
    found = multistart(f, f, d, np.full((1, d), 0.5), np.random.default_rng(0))
    np.testing.assert_allclose(found[0], 0.0, atol=1e-4)


def test_a_level_function_and_one_that_is_not_finite():
    level = Function(lambda U: np.zeros(len(U)), np.zeros_like)
    hole = Function(lambda U: np.full(len(U), -np.inf), np.zeros_like)
    for f in (level, hole):
        found = multistart(f, f, 2, np.full((1, 2), 0.5), np.random.default_rng(0))
        assert np.isfinite(found).all()
        assert np.all((found >= 0.0) & (found <= 1.0))

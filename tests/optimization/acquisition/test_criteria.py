import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate
from scipy.stats import norm

from surehold.optimization.acquisition.criteria import (
    expected_improvement,
    log_expected_improvement,
    probability_of_improvement,
    upper_confidence_bound,
)

CASES = [(0.3, 0.7, 0.5, 0.0), (-1.0, 0.4, 0.5, 0.1), (2.0, 1.5, 0.0, 0.0), (0.0, 0.2, 0.3, 0.05), (0.1, 1.0, 0.1, 0.0)]


def exact_log_improvement(z):
    """Return log(phi(z) + z Phi(z)) with 60 digits."""
    with mpmath.workdps(60):
        z = mpmath.mpf(z)
        # Phi far in the tail by erfc, which mpmath computes without cancellation
        h = mpmath.npdf(z) + z * mpmath.erfc(-z / mpmath.sqrt(2)) / 2
        return float(mpmath.log(h))


@pytest.mark.parametrize(("mean", "std", "best", "margin"), CASES)
def test_improvement_is_the_integral(mean, std, best, margin):
    threshold = best + margin
    integral, _ = integrate.quad(
        lambda f: (f - threshold) * norm.pdf(f, mean, std), threshold, mean + 12 * std, epsabs=1e-13, epsrel=1e-13
    )
    assert abs(float(expected_improvement(mean, std, best, margin).value) - integral) < 1e-10
    assert abs(float(np.exp(log_expected_improvement(mean, std, best, margin).value)) - integral) < 1e-10
    above = norm.sf(threshold, mean, std)
    assert abs(float(probability_of_improvement(mean, std, best, margin).value) - above) < 1e-12


@pytest.mark.parametrize("z", [3.0, 0.0, -0.5, -0.999, -1.0, -1.001, -5.0, -30.0, -38.0, -199.0, -201.0, -1e4])
def test_log_improvement_far_in_the_tail(z):
    expected = exact_log_improvement(z)
    assert float(log_expected_improvement(z, 1.0, 0.0).value) == pytest.approx(expected, rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("z", [-0.9, -1.1, -5.0, -20.0, -35.0])
def test_improvement_keeps_its_digits_in_the_tail(z):
    assert float(expected_improvement(z, 1.0, 0.0).value) == pytest.approx(
        np.exp(exact_log_improvement(z)), rel=1e-10, abs=0.0
    )


@pytest.mark.parametrize(
    "criterion", [expected_improvement, log_expected_improvement, probability_of_improvement], ids=lambda c: c.__name__
)
@pytest.mark.parametrize(("mean", "std"), [(0.3, 0.7), (-2.0, 0.5), (-8.0, 0.9), (3.0, 0.2)])
def test_derivatives(criterion, mean, std):
    h = 1e-6
    at = criterion(mean, std, 0.1, 0.01)
    by_mean = (criterion(mean + h, std, 0.1, 0.01).value - criterion(mean - h, std, 0.1, 0.01).value) / (2 * h)
    by_std = (criterion(mean, std + h, 0.1, 0.01).value - criterion(mean, std - h, 0.1, 0.01).value) / (2 * h)
    assert float(at.by_mean) == pytest.approx(by_mean, rel=1e-6, abs=1e-9)
    assert float(at.by_std) == pytest.approx(by_std, rel=1e-6, abs=1e-9)


def test_upper_confidence_bound():
    value, by_mean, by_std = upper_confidence_bound([1.0, 2.0], [0.5, 0.0], 3.0)
    np.testing.assert_array_equal(value, [2.5, 2.0])
    np.testing.assert_array_equal(by_mean, 1.0)
    np.testing.assert_array_equal(by_std, 3.0)


def test_no_spread():
    assert expected_improvement([1.0, -1.0, 0.0], 0.0, 0.0).value.tolist() == [1.0, 0.0, 0.0]
    assert probability_of_improvement([1.0, -1.0], 0.0, 0.0).value.tolist() == [1.0, 0.0]
    assert np.isfinite(probability_of_improvement([1e300, -1e300], 0.0, 0.0)).all(), "z squared overflows, or z itself"


@pytest.mark.parametrize("std", [1e-7, 1e-9, 1e-20, 0.0])
def test_log_improvement_of_a_sure_gain_is_the_logarithm_of_the_gain(std):
    for gain in (2.0, 0.003):
        value, by_mean, by_std = log_expected_improvement(gain, std, 0.0)
        assert float(value) == pytest.approx(np.log(gain), rel=1e-12)
        assert float(by_mean) == pytest.approx(1.0 / gain, rel=1e-12)
        assert abs(by_std) < 1e-7 / gain


@given(st.floats(-1e6, 1e6), st.floats(0.0, 1e6), st.floats(-1e6, 1e6), st.floats(0.0, 10.0))
def test_always_numbers_and_ordered(mean, std, best, more):
    for criterion in (expected_improvement, log_expected_improvement, probability_of_improvement):
        value, by_mean, by_std = criterion(mean, std, best)
        assert not np.isnan([value, by_mean, by_std]).any(), criterion.__name__
        rounding = 1e-14 * abs(value)
        assert criterion(mean + more, std, best).value >= value - rounding, (
            f"{criterion.__name__} falls as the mean rises"
        )
    improvement = float(expected_improvement(mean, std, best).value)
    assert improvement >= max(mean - best, 0.0) - 1e-9 * max(1.0, abs(mean), abs(best))

import nlopt
import numpy as np
import pytest
from scipy.optimize import direct

from surehold.optimization.maximizer.direct import divide_and_climb, divide_rectangles


def rugged(U):
    return -np.sum((U - 0.37) ** 2, axis=1) + 0.1 * np.prod(np.cos(9.0 * (U - 0.37)), axis=1)


@pytest.mark.parametrize("d", [1, 2, 3, 7])
def test_finds_what_scipy_finds_with_the_same_number_of_evaluations(d):
    budget = 450 * d
    asked = []

    def counted(U):
        asked.append(len(U))
        return rugged(U)

    found = divide_rectangles(counted, np.zeros((1, d)), np.ones((1, d)), budget)
    oracle = direct(lambda u: -rugged(u[None])[0], [(0, 1)] * d, maxfun=budget, maxiter=budget, vol_tol=0, len_tol=0)
    assert rugged(found)[0] == pytest.approx(-oracle.fun, abs=1e-6)
    assert sum(asked) <= budget
    assert len(asked) < budget / 8, "the rectangles of a round are not evaluated together"


def two_hills(U):
    one = np.exp(-((U[:, 0] - 0.31) ** 2 + (U[:, 1] - 0.77) ** 2) / 0.02)
    return one + 0.6 * np.exp(-((U[:, 0] - 0.7) ** 2 + (U[:, 1] - 0.2) ** 2) / 0.01)


@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e-9, 1e-13, 1e-30])
def test_ends_where_the_program_of_the_thesis_ends(scale):
    """Criteria as small as its tolerances end its searches after a few evaluations, close to the center."""
    asked = []

    def counted(U):
        asked.append(len(U))
        return scale * two_hills(U)

    found = divide_rectangles(counted, np.zeros((1, 2)), np.ones((1, 2)), 900)
    oracle = nlopt.opt(nlopt.GN_DIRECT_L, 2)
    oracle.set_lower_bounds([0.0, 0.0])
    oracle.set_upper_bounds([1.0, 1.0])
    oracle.set_max_objective(lambda u, _: scale * float(two_hills(u[None])[0]))
    oracle.set_maxeval(900)
    oracle.set_ftol_abs(1e-12)
    oracle.set_ftol_rel(1e-12)
    expected = oracle.optimize([0.5, 0.5])
    np.testing.assert_allclose(found[0], expected, atol=1e-7)
    assert sum(asked) == pytest.approx(oracle.get_numevals(), rel=0.1)


def test_regions_are_searched_apart():
    lower, upper = np.array([[0.0, 0.0], [0.6, 0.0]]), np.array([[0.6, 1.0], [1.0, 1.0]])
    together = divide_rectangles(rugged, lower, upper, 500)
    for i in range(2):
        alone = divide_rectangles(rugged, lower[i : i + 1], upper[i : i + 1], 500)
        np.testing.assert_array_equal(alone[0], together[i])
        assert np.all((together[i] >= lower[i]) & (together[i] <= upper[i]))


def test_level_functions_and_values_that_are_not_finite():
    for value in (0.0, -np.inf, np.nan):
        found = divide_rectangles(lambda U, v=value: np.full(len(U), v), np.zeros((1, 2)), np.ones((1, 2)), 300)
        assert np.all((found >= 0.0) & (found <= 1.0))


class TwoPeaks:
    """A broad hill at 0.25 of height 1 and a narrower one at 0.8 of height 2, the same in every variable."""

    def __call__(self, U):
        return sum(self._parts(U))

    def with_gradient(self, U):
        low, high = (part[:, None] for part in self._parts(U))
        return self(U), -low * (U - 0.25) / 0.2**2 - high * (U - 0.8) / 0.15**2

    @staticmethod
    def _parts(U):
        low = np.exp(-0.5 * np.sum((U - 0.25) ** 2, axis=1) / 0.2**2)
        return low, 2.0 * np.exp(-0.5 * np.sum((U - 0.8) ** 2, axis=1) / 0.15**2)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_search_of_the_thesis_finds_the_higher_of_two_peaks(d):
    found = divide_and_climb(TwoPeaks(), d, np.full(d, 0.25), np.random.default_rng(0))
    np.testing.assert_allclose(found[0], 0.8, atol=1e-2)
    values = TwoPeaks()(found)
    assert np.all(np.diff(values) <= 0.0), "the best point does not come first"
    again = divide_and_climb(TwoPeaks(), d, np.full(d, 0.25), np.random.default_rng(0))
    assert np.array_equal(found, again)

import numpy as np
import pytest
from scipy.optimize import direct

from surehold.optimization.dividing_rectangles import divide_rectangles


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

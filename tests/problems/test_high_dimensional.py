"""Functions of many variables against SciPy and published optima; hidden variables change nothing."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from surehold.problems.high_dimensional import HIGH_DIMENSIONAL, ackley, rosenbrock, styblinski_tang
from surehold.problems.named import NAMES, named_function

TOPS = {
    "hartmann-6": 3.32237,
    "hartmann-6-in-30": 3.32237,
    "hartmann-6-in-100": 3.32237,
    "branin-in-100": -0.397887,
    "ackley-20": 0.0,
    "styblinski-tang-50": 39.16617 * 50,
    "rosenbrock-100": 0.0,
}


@pytest.mark.parametrize("name", HIGH_DIMENSIONAL)
def test_published_optimum(name):
    problem = named_function(name)
    assert name in NAMES
    start = problem._starts[0]
    assert problem(start) == pytest.approx(TOPS[name], abs=1e-3)
    rng = np.random.default_rng(0)
    near = np.clip(
        start + 0.01 * problem.box.widths * rng.standard_normal((50, len(start))), problem.box.lower, problem.box.upper
    )
    assert np.all(problem(near) <= problem(start) + 1e-5), "no point around it is higher"


def test_only_the_hidden_variables_count():
    problem = named_function("hartmann-6-in-30")
    x = np.random.default_rng(1).random((3, 30))
    changed = np.array(
        [np.ptp([problem(x[0] + 0.3 * (k == i) * np.eye(30)[i]) for k in (i, -1)]) > 0 for i in range(30)]
    )
    assert changed.sum() == 6


def test_rosenbrock_is_scipys():
    x = np.random.default_rng(2).normal(size=(4, 7))
    np.testing.assert_allclose(rosenbrock(x), [-rosen(point) for point in x])


def test_ackley_and_styblinski_tang_at_their_tops_are_level():
    for f, top in ((ackley, np.zeros(4)), (styblinski_tang, np.full(4, -2.903534))):
        found = minimize(lambda x, f=f: -f(x[None])[0], top + 1e-3, method="Nelder-Mead")
        assert f(top[None])[0] == pytest.approx(-found.fun, abs=1e-2)

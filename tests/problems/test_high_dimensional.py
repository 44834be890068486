"""Functions of many variables against SciPy and published optima; hidden variables change nothing."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen
from scipy.stats import multivariate_normal

from surehold.errors import InputError
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.hidden import Hidden
from surehold.problems.high_dimensional import HIGH_DIMENSIONAL, ackley, hartmann_6, rosenbrock, styblinski_tang
from surehold.problems.named import NAMES, named_function, robust_problem
from surehold.problems.synthetic import robust_optimum

TOPS = {
    "hartmann-6": 3.32237,
    "hartmann-6-in-30": 3.32237,
    "hartmann-6-in-100": 3.32237,
    "branin-in-100": -0.397887,
    "ackley-20": 0.0,
    "styblinski-tang-50": 39.16617 * 50,
    "styblinski-tang-100": 39.16617 * 100,
    "rosenbrock-100": 0.0,
}


@pytest.mark.parametrize("name", TOPS)
def test_published_optimum(name):
    problem = named_function(name)
    assert name in NAMES
    start = problem.optimum.x if name.startswith(("hartmann", "branin")) else problem._starts[0]
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


def test_every_function_has_its_top_tested():
    assert {*TOPS, "rover-60"} == set(HIGH_DIMENSIONAL)


def test_hartmann_is_its_formula():
    rates = [[10, 3, 17, 3.5, 1.7, 8], [0.05, 10, 17, 0.1, 8, 14], [3, 3.5, 1.7, 10, 17, 8], [17, 8, 0.05, 10, 0.1, 14]]
    tops = [
        [0.1312, 0.1696, 0.5569, 0.0124, 0.8283, 0.5886],
        [0.2329, 0.4135, 0.8307, 0.3736, 0.1004, 0.9991],
        [0.2348, 0.1451, 0.3522, 0.2883, 0.3047, 0.6650],
        [0.4047, 0.8828, 0.8732, 0.5743, 0.1091, 0.0381],
    ]
    x = np.random.default_rng(3).random((5, 6))
    terms = [np.exp(-((x - p) ** 2) @ np.array(a)) for a, p in zip(rates, tops, strict=True)]
    np.testing.assert_allclose(hartmann_6()(x), np.array([1.0, 1.2, 3.0, 3.2]) @ terms, rtol=1e-12)


def test_noise_on_all_variables_acts_through_those_that_count():
    problem = robust_problem("robust-hartmann-6-in-100")
    few = hartmann_6()
    x = np.random.default_rng(4).random((3, 100))
    for row in x:
        near = row[problem.function.places]
        draws = near + 0.1 * multivariate_normal(np.zeros(6), seed=5).rvs(200_000)
        values = few(draws)
        mean, deviation = problem.value(row)[0], problem.function.standard_deviation(row, problem.noise)
        assert mean == pytest.approx(values.mean(), abs=4.0 * values.std() / len(values) ** 0.5)
        assert deviation == pytest.approx(values.std(), rel=0.02)


def test_the_best_robust_place_is_the_one_of_the_six():
    problem = robust_problem("robust-hartmann-6-in-100")
    best = robust_optimum(hartmann_6(), InputNoise.unit(0.1))
    assert problem.optimum.value == pytest.approx(best.value, abs=1e-5)
    assert problem.optimum.x[problem.function.places] == pytest.approx(best.x, abs=1e-4)
    assert float(problem.value(problem.optimum.x)[0]) == pytest.approx(best.value, abs=2e-5)


def test_hidden_functions_refuse_noise_without_a_closed_form():
    with pytest.raises(InputError, match="Gaussian noise"):
        Hidden("h", hartmann_6(), 9).expectation(np.full(9, 0.5), InputNoise.varying(lambda x: np.full(9, 0.1)))


def test_rosenbrock_is_scipys():
    x = np.random.default_rng(2).normal(size=(4, 7))
    np.testing.assert_allclose(rosenbrock(x), [-rosen(point) for point in x])


def test_ackley_and_styblinski_tang_at_their_tops_are_level():
    for f, top in ((ackley, np.zeros(4)), (styblinski_tang, np.full(4, -2.903534))):
        found = minimize(lambda x, f=f: -f(x[None])[0], top + 1e-3, method="Nelder-Mead")
        assert f(top[None])[0] == pytest.approx(-found.fun, abs=1e-2)

import numpy as np
import pytest
from scipy import stats

import surehold as sh
from surehold.errors import InputError
from surehold.problems.formula import Formula
from surehold.problems.named import robust_problem
from surehold.problems.perturbation import robust_score
from surehold.problems.robust import ROBUST, RobustProblem
from surehold.problems.synthetic import robust_optimum


@pytest.mark.parametrize("name", [name for name in ROBUST if not name.endswith(("5", "7"))])
def test_the_highest_peak_is_not_the_answer(name):
    problem = robust_problem(name)
    peak = problem.function.optimum
    safe = robust_optimum(problem.function, problem.noise)
    assert np.linalg.norm(peak.x - safe.x) > 0.1
    assert float(problem.function.expectation(peak.x, problem.noise)) < 0.9 * safe.value
    assert problem.function(safe.x) < 0.8 * peak.value


@pytest.mark.parametrize("name", ["needle-5", "needle-7"])
def test_the_hill_beats_the_needle_in_many_variables(name):
    problem = robust_problem(name)
    d = problem.function.box.dimension
    needle, hill = problem.function.expectation(np.array([np.full(d, 0.72), np.full(d, 0.35)]), problem.noise)
    assert needle < 0.9 * hill
    score = robust_score(problem.function, np.full(d, 0.35), problem.noise, n=2000)
    assert score.mean == pytest.approx(hill, abs=4.0 * score.std / 2000**0.5)


def test_the_safe_place_of_edge_and_corner_is_on_the_border():
    assert robust_optimum(*robust_problem("edge")[:2]).x[0] > 0.93
    assert np.all(robust_optimum(*robust_problem("corner")[:2]).x > 0.93)


def test_unknown_names():
    with pytest.raises(InputError, match="needle-2"):
        robust_problem("nedle-2")


def test_the_value_at_risk_of_a_line_under_each_kind_of_noise():
    """Of x + noise at 0.5, the 1 % quantile: uniform +- 0.1, normal of that deviation, and samples one by one."""
    line, deviation = Formula("line", sh.Box({"x": (0.0, 1.0)}), lambda x: x[:, 0]), 0.1 / 3.0**0.5
    errors = np.linspace(-0.2, 0.0, 100)
    for noise, quantile in (
        (sh.InputNoise.uniform({"x": 0.1}), 0.402),
        (sh.InputNoise({"x": deviation}), 0.5 + deviation * stats.norm.ppf(0.01)),
        (sh.InputNoise.samples(errors), 0.5 + errors[0]),
    ):
        problem = RobustProblem(line, noise, risk="var", alpha=0.01)
        assert problem.value([0.5])[0] == pytest.approx(quantile, abs=2e-4)
    assert line.expectation(np.array([0.5]), sh.InputNoise.samples(errors)) == pytest.approx(0.4)
    with pytest.raises(InputError, match="has no closed form"):
        sh.problems.RKHS().expectation([0.5], sh.InputNoise.samples(errors))

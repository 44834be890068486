import numpy as np
import pytest

from surehold.errors import InputError
from surehold.problems.named import robust_problem
from surehold.problems.perturbation import robust_score
from surehold.problems.robust import ROBUST
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

import numpy as np
import pytest

from surehold.campaigns.plan import ProblemSetup
from surehold.campaigns.problem_setup import build_problem, checked_problem, noise_of, observer, unit_noise_of
from surehold.errors import InputError
from surehold.grasping.wrench.simox import object_wrench_space, simox_quality
from surehold.optimization.box import Box
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.named import robust_problem
from surehold.problems.synthetic import GM


def test_a_synthetic_problem_is_the_function():
    problem = build_problem(ProblemSetup("gm", 8, 5))
    assert problem([0.3, 0.4]) == GM()([0.3, 0.4])


def test_an_own_function_is_loaded(tmp_path):
    (tmp_path / "own.py").write_text("def f(x):\n    return x[0] - x[1]\n")
    problem = build_problem(ProblemSetup(f"{tmp_path}/own.py:f", 8, 5, {"bounds": "a=0:2,b=-1:1"}))
    assert problem.box.names == ("a", "b")
    assert problem([2.0, -1.0]) == 3.0


def test_a_grasp_takes_its_arguments():
    problem = build_problem(ProblemSetup("grasp", 8, 5, {"object": "glass", "variables": ["dx", "s1"]}))
    assert problem.box.names == ("dx", "s1")
    x = problem.box.from_unit([0.3, 0.5])
    assert problem(x) == GraspProblem("glass", variables=("dx", "s1"))(x)


def test_the_simulators_measure_is_that_of_the_contacts():
    arguments = {"object": "bottle", "contact": "single", "closing": "synergy", "quality": "simox"}
    problem = build_problem(ProblemSetup("grasp", 8, 5, arguments))
    assert isinstance(problem, GraspProblem)
    plain = GraspProblem("bottle", contact="single", closing="synergy")
    space = object_wrench_space(plain.object.vertices, plain.object.faces)
    points = problem.box.from_unit(np.random.default_rng(0).random((40, 2)))
    values = problem(points)
    for x, value in zip(points, values, strict=True):
        contacts = plain.grasp(x).contacts
        expected = simox_quality(contacts.points, contacts.normals, space) if len(contacts) > 1 else 0.0
        assert value == expected == problem(x)
    assert values.max() > 0.3, "the published levels are about 0.55"
    assert values.min() == 0.0


def test_noise_of_a_problem():
    box = GM().box
    assert noise_of(ProblemSetup("gm", 8, 5)) is None
    noise = noise_of(ProblemSetup("gm", 8, 5, input_noise=0.1))
    assert noise is not None
    assert noise.unit_covariance(box) == pytest.approx(np.eye(2) * 0.01)


@pytest.mark.parametrize("name", ["nes-polynomial", "qing-branin", "qing-sin-linear-uniform"])
def test_a_robust_problem_brings_its_own_noise(name):
    on = ProblemSetup(name, 8, 5, input_noise="own")
    stated = robust_problem(name)
    box = stated.function.box
    assert build_problem(on).name == name
    noise = noise_of(on)
    assert noise.unit_covariance(box) == pytest.approx(stated.noise.unit_covariance(box))
    unit = unit_noise_of(on)
    assert unit.bounded == stated.noise.bounded
    assert unit.unit_covariance(Box.unit(box.dimension)) == pytest.approx(stated.noise.unit_covariance(box))


def test_samples_of_a_robust_problem_stay_samples():
    """The worst of StableOpt's polynomial is that of a disc of radius 0.5, not of a normal variable."""
    noise, box = robust_problem("stableopt-polynomial").noise, robust_problem("stableopt-polynomial").function.box
    unit = unit_noise_of(ProblemSetup("stableopt-polynomial", 8, 5, input_noise="own"))
    drawn = unit.draws(Box.unit(2), np.full(2, 0.5), 500, np.random.default_rng(0)) * box.widths
    radii = np.hypot(*drawn.T)
    np.testing.assert_allclose(radii[radii > 0.0], 0.5)
    assert unit.unit_covariance(Box.unit(2)) == pytest.approx(noise.unit_covariance(box))


def test_noise_of_its_own_needs_a_problem_that_states_it():
    with pytest.raises(InputError, match="states no input noise"):
        checked_problem("a", ProblemSetup("gm", 8, 5, input_noise="own"))
    with pytest.raises(InputError, match="exact inputs"):
        noise_of(ProblemSetup("rahbo-branin", 8, 5, input_noise="own"))


def test_observation_noise_is_the_absolute_value_of_a_normal_one():
    """Y = f - |e|, e ~ N(0, 0.2^2): mean 0.2 sqrt(2 / pi), never above f."""
    on = ProblemSetup("gf", 8, 5, observation_noise=0.2)
    observe = observer(build_problem(on), on, seed=3)
    told, true = np.array([observe(np.array([0.3, 0.3])) for _ in range(4000)]).T
    assert np.all(told <= true)
    assert np.mean(true - told) == pytest.approx(0.2 * np.sqrt(2.0 / np.pi), abs=0.008)
    assert np.mean((true - told) ** 2) == pytest.approx(0.04, abs=0.003)
    again = observer(build_problem(on), on, seed=3)
    assert again(np.array([0.3, 0.3]))[0] == told[0]

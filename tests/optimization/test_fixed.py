"""Variables that keep their value, beside trials that were made at other ones: a warm start, a value fixed later."""

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer

BOX = Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
A = np.linspace(0.0, 1.0, 7)


def told(optimizer, b, best):
    for a in A:
        optimizer.tell([a, b], best - (a - 0.4) ** 2)
    return optimizer


@pytest.mark.parametrize("noise", [None, InputNoise({"a": 0.02, "b": 0.0})])
def test_an_answer_keeps_fixed_values(noise):
    optimizer = told(told(Optimizer(BOX, fixed={"b": 0.5}, input_noise=noise, seed=0), 0.2, 5.0), 0.5, 0.0)
    assert optimizer.feasible.tolist() == [False] * 7 + [True] * 7
    for where in ("observed", "box"):
        best = optimizer.recommend(where)
        assert best.parameters["b"] == 0.5
        assert best.x[1] == 0.5
        assert best.mean == pytest.approx(0.0, abs=0.02), "of b = 0.2 it would be 5"
        assert "another value of a fixed variable" in best.refused
    assert optimizer.recommend().observed == pytest.approx(-((0.4 - 1 / 3) ** 2))
    assert optimizer.promise() < 0.02


def test_of_many_levels_another_one_is_another_value():
    """505 of 1,000 counted as 500, as rounded by a rig, and 5 was stated to have been observed there."""
    optimizer = Optimizer(Box({"a": (0.0, 1.0), "n": (0, 1000, "int")}), fixed={"n": 500}, seed=0)
    for n, best in ((505, 5.0), (500, 0.0)):
        for a in A:
            optimizer.tell({"a": a, "n": n}, best - (a - 0.4) ** 2)
    found = optimizer.recommend()
    assert (found.parameters["n"], found.observed) == (500, pytest.approx(-((0.4 - 1 / 3) ** 2)))
    assert "another value of a fixed variable" in found.refused


def test_initial_points_of_a_run_whose_variable_is_fixed_later(tmp_path):
    optimizer = Optimizer(BOX, initial_points=[[0.1, 0.25], [0.2, 0.5], [0.3, 0.504]], seed=0)
    for _ in range(4):
        optimizer.tell(asked := optimizer.ask(), -asked[0])
    optimizer.save(tmp_path / "run.json")
    later = Optimizer.load(tmp_path / "run.json", fixed={"b": 0.5})
    assert (len(later.y), later.ask()[1]) == (4, 0.5)
    with pytest.raises(InputError, match="never tried"):
        Optimizer.load(tmp_path / "run.json", fixed={"b": 0.5}, initial_points=[[0.1, 0.25]])


def test_a_guess_of_all_that_is_not_fixed_is_tried_once():
    X = Optimizer(BOX, fixed={"b": 0.5}, guess={"a": 0.3}, n_initial=9, seed=0).ask(9)
    assert len(np.unique(X[:, 0])) == 9
    assert X[0].tolist() == [0.3, 0.5]


def test_a_value_that_strayed_is_answered_as_it_was_fixed():
    optimizer = Optimizer(BOX, fixed={"b": 0.5}, seed=0)
    for a in A:
        optimizer.tell([a, 0.5], -((a - 0.4) ** 2), reached=[a, 0.507])
    best = optimizer.recommend()
    assert best.x.tolist() == [pytest.approx(1 / 3), 0.5]
    assert best.observed == pytest.approx(-((0.4 - 1 / 3) ** 2))


@pytest.mark.parametrize("outcome", ["value", "success"])
def test_nothing_is_answered_before_a_trial_at_the_fixed_values(tmp_path, outcome):
    optimizer = Optimizer(BOX, outcome=outcome, seed=0)
    for a in A:
        optimizer.tell([a, 0.2], **({"success": True} if outcome == "success" else {"y": a}))
    optimizer.save(tmp_path / "run.json")
    later = Optimizer.load(tmp_path / "run.json", fixed={"b": 0.75})
    with pytest.raises(InputError, match="no trial at the values of fixed variables"):
        later.recommend()
    assert later.promise() == np.inf
    asked = later.ask()
    assert asked[1] == 0.75
    later.tell(asked, **({"success": True} if outcome == "success" else {"y": 0.1}))
    assert later.recommend().parameters["b"] == 0.75


@pytest.mark.parametrize(
    ("box", "point", "fixed"),
    [
        (BOX, {"a": 0.1, "b": 0.25}, {"b": 0.5}),
        (Box({"a": (0.0, 1.0), "n": (0, 10, "int")}), {"a": 0.1, "n": 2.5}, None),
        (Box({"a": (0.0, 1.0), "g": ["x", "y"]}), {"a": 0.1, "g": "x"}, {"g": "y"}),
    ],
)
def test_initial_points_that_are_never_tried(box, point, fixed):
    with pytest.raises(InputError, match=r"initial_points hold .* never tried: the nearest that can be is"):
        Optimizer(box, initial_points=[point], fixed=fixed)


def test_initial_points_may_be_rounded():
    box = Box({"a": (0.0, 1.0), "s": (0.1, 1.3, "step=0.3")})
    points = [{"a": 0.5, "s": np.float32(0.7)}, {"a": 0.25, "s": 0.1 + 3 * 0.3}]
    asked = Optimizer(box, initial_points=points, fixed=None, seed=0).ask_trial(2)
    assert [trial.parameters["s"] for trial in asked] == pytest.approx([0.7, 1.0])

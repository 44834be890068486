"""Boxes that hold more than numbers: logarithms, whole numbers, steps and choices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.maximization import maximize
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer

BOX = Box(
    {
        "dx": (-0.05, 0.05),
        "force": (0.1, 10.0, "log"),
        "turn": (-1.0, 1.0, "step=0.25"),
        "fingers": (2, 5, "int"),
        "batch": (1, 1000, "int", "log"),
        "grip": ["pinch", "power", "tripod"],
        "wet": [True, False],
    }
)


def worth(p):
    """Best at force 2, 4 fingers, tripod, dry."""
    loss = np.log(p["force"] / 2.0) ** 2 + 0.3 * (p["fingers"] - 4) ** 2 + 50.0 * p["dx"] ** 2
    return float(-loss - (p["grip"] != "tripod") - 0.5 * p["wet"])


@given(st.integers(0, 2**32 - 1))
def test_what_is_tried_is_in_its_range_and_maps_back(seed):
    u = np.random.default_rng(seed).random(BOX.dimension)
    p = BOX.as_dict(BOX.from_unit(u))
    assert -0.05 <= p["dx"] <= 0.05
    assert 0.1 <= p["force"] <= 10.0
    assert p["turn"] in np.arange(-1.0, 1.1, 0.25)
    assert type(p["fingers"]) is int
    assert 2 <= p["fingers"] <= 5
    assert type(p["batch"]) is int
    assert 1 <= p["batch"] <= 1000
    assert p["grip"] in ("pinch", "power", "tripod")
    assert type(p["wet"]) is bool
    x = BOX.points(p)
    again = BOX.as_dict(x)
    assert {name: again[name] for name in ("fingers", "batch", "grip", "wet", "turn", "dx")} == {
        name: p[name] for name in ("fingers", "batch", "grip", "wet", "turn", "dx")
    }
    assert again["force"] == pytest.approx(p["force"], rel=1e-14)
    np.testing.assert_allclose(BOX.from_unit(BOX.snap(u)), x, rtol=0, atol=1e-9)


def test_a_logarithmic_variable_is_even_in_the_logarithm():
    box = Box({"force": (0.1, 10.0, "log")})
    assert box.as_dict(box.from_unit([0.5]))["force"] == pytest.approx(1.0)
    assert box.as_dict(box.from_unit([0.75]))["force"] == pytest.approx(10.0**0.5)


def test_only_what_can_be_tried_is_asked_and_the_best_of_it_is_found():
    optimizer = Optimizer(BOX, seed=0, fixed={"turn": 0.5, "batch": 10})
    for _ in range(45):
        trial = optimizer.ask_trial()
        assert trial.parameters["turn"] == 0.5
        assert trial.parameters["batch"] == 10
        optimizer.tell(trial, worth(trial.parameters))
    best = optimizer.recommend().parameters
    assert (best["grip"], best["wet"], best["fingers"]) == ("tripod", False, 4)
    assert best["force"] == pytest.approx(2.0, rel=0.2)


def test_functions_and_tables_see_the_names():
    pytest.importorskip("pandas")
    box = Box({"force": (0.1, 10.0, "log"), "grip": ["pinch", "power"]})
    seen = []

    def f(p):
        seen.append(dict(p))
        return -abs(np.log(p["force"])) - (p["grip"] == "pinch")

    result = maximize(f, box, 14, seed=0)
    table = result.to_dataframe()
    assert list(table.columns[:2]) == ["force", "grip"]
    assert table[["force", "grip"]].to_dict("records") == seen
    assert result.recommendation.parameters["grip"] == "power"


def test_dictionaries_and_tables_are_points():
    pandas = pytest.importorskip("pandas")
    box = Box({"force": (0.1, 10.0, "log"), "grip": ["pinch", "power"]})
    rows = [{"grip": "power", "force": 1.0}, {"force": 0.1, "grip": "pinch"}]
    expected = [[0.0, 0.0, 1.0], [np.log(0.1), 1.0, 0.0]]
    np.testing.assert_allclose(box.points(rows), expected)
    np.testing.assert_allclose(box.points(pandas.DataFrame(rows)), expected)
    np.testing.assert_allclose(box.points(pandas.Series(rows[0])), expected[0])
    optimizer = Optimizer(box, initial_points=rows, seed=0)
    assert [trial.parameters for trial in optimizer.ask_trial(2)] == [
        {"force": 1.0, "grip": "power"},
        {"force": pytest.approx(0.1), "grip": "pinch"},
    ]
    optimizer.tell({"force": 1.0, "grip": "power"}, 0.3)
    assert len(optimizer.pending) == 1


def test_noise_is_of_the_numbers(tmp_path):
    noise = InputNoise({"force": 0.1, "fingers": 0.0})
    box = Box({"force": (0.1, 10.0, "log"), "fingers": (2, 5, "int"), "grip": ["pinch", "power"]})
    optimizer = Optimizer(box, input_noise=noise, seed=1)
    deviations = np.sqrt(np.diag(optimizer.input_noise.unit_covariance(box)))
    np.testing.assert_allclose(deviations, [0.1 / np.log(100.0), 0.0, 0.0, 0.0], atol=1e-15)
    optimizer.tell(optimizer.ask_trial(), 0.5)
    optimizer.save(tmp_path / "run.json")
    again = Optimizer.load(tmp_path / "run.json")
    assert again.box == box
    assert again.ask_trial().parameters == optimizer.ask_trial().parameters


def test_such_a_box_hands_out_trials_by_name_only():
    optimizer = Optimizer(BOX)
    with pytest.raises(InputError, match="ask_trial"):
        optimizer.ask()
    assert repr(Box({"n": (2, 5, "int"), "grip": ["a", "b"]})) == "Box({'n': (2, 5, 'int'), 'grip': ['a', 'b']})"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((0.0, 1.0, "log"), "logarithmic variable is positive"),
        ((0.0, 1.5, "int"), "whole numbers"),
        ((0.0, 1.0, "step=2"), "wider than its range"),
        ((0, 3, "int", "step=4"), "wider than its range"),
        ((0.0, 1.0, "step=-1"), "step"),
        ((0.0, 1.0, "step=nan"), "step"),
        ((0.1, 1.0, "log", "step=0.1"), "logarithmic and has steps"),
        ((0.0, 1.0, "lin"), "'log', 'int'"),
        ((0.0, 1.0, 2.0), "'log', 'int'"),
        ((5, 2, "int"), "swap or widen"),
        (["pinch"], "list of texts"),
        (["pinch", "pinch"], "each can be there once"),
        ("ab", "list of texts"),
        (3, "list of texts"),
        ({"a", "b"}, "list of texts"),  # a set has another order in another process
    ],
)
def test_what_is_no_variable_is_said(given, words):
    with pytest.raises(InputError, match=words):
        Box({"v": given})


@pytest.mark.parametrize(
    ("point", "words"),
    [
        ({"force": 1.0}, "name exactly"),
        ({"force": 1.0, "grip": "hook"}, "choice for 'grip'"),
        ({"force": -1.0, "grip": "power"}, "can be reached"),
        ({"force": "strong", "grip": "power"}, "finite number"),
        ({"force": 1.0, "grip": "power", "x": 0.0}, "name exactly"),
    ],
)
def test_points_that_do_not_fit_are_refused(point, words):
    optimizer = Optimizer(Box({"force": (0.1, 10.0, "log"), "grip": ["pinch", "power"]}))
    with pytest.raises(InputError, match=words):
        optimizer.tell(point, 0.0)
    assert len(optimizer.y) == 0


def test_rules_are_of_the_variables_not_of_their_coordinates():
    box = Box({"force": (0.1, 10.0, "log"), "n": (2, 5, "int"), "grip": ["pinch", "power"]})
    seen = []

    def gentle(p):
        seen.append(p)
        return p["grip"] == "power" or p["force"] < 1.0

    optimizer = Optimizer(box, allowed=["force + n <= 5", gentle], n_initial=8, seed=0)
    for _ in range(12):
        trial = optimizer.ask_trial()
        p = trial.parameters
        assert p["force"] + p["n"] <= 5.0 + 1e-9
        assert gentle(p)
        optimizer.tell(trial, p["force"])
    best = optimizer.recommend().parameters
    assert best["force"] > 2.0, "the limit is of the force, not of its logarithm"
    assert isinstance(seen[0]["n"], int)
    with pytest.raises(InputError, match="'grip' is a choice"):
        Optimizer(box, allowed="grip <= 1")
    with pytest.raises(InputError, match="'forc' is unknown"):
        Optimizer(box, allowed="forc <= 1")


def test_a_box_shows_what_nobody_sets():
    box = Box({"x": (0.0, 1.0)}, uncontrolled={"payload": [0.5, 1.0, 1.5]})
    assert repr(box) == "Box({'x': (0, 1), 'payload': (0.5, 1.5)}, uncontrolled: payload)"


def test_half_a_character_is_refused():
    for bounds in ({"\ud800": (0.0, 1.0)}, {"grip": ["pinch", "\udfff"]}):
        with pytest.raises(InputError, match="half a character"):
            Box(bounds)


def test_a_number_names_the_choice_that_is_written_like_it():
    """JSON and tables turn the choice "7" of a command line into the number 7."""
    box = Box({"grip": ["a", "7", "True"]})
    assert [box.as_dict(box.points({"grip": given}))["grip"] for given in (7, np.int64(7), True)] == ["7", "7", "True"]
    with pytest.raises(InputError, match="choice for 'grip' '8' is unknown"):
        box.points({"grip": 8})


def test_the_last_level_of_whole_numbers_is_the_upper_bound():
    box = Box({"n": (0, 10, "int", "step=4")})
    levels = {box.as_dict(box.from_unit([u]))["n"] for u in np.linspace(0.0, 1.0, 25)}
    assert levels == {0, 4, 8}
    assert (box.lower, box.upper) == ([-2.0], [10.0]), "cells of equal width"
    assert box == Box({"n": (0, 8, "int", "step=4")})
    assert Box({"n": (0, 10**15, "int")}).as_dict([1e15])["n"] == 10**15


def test_bounds_that_are_close_are_shown_apart():
    assert repr(Box({"x": (1e12, 1e12 + 0.5)})) == "Box({'x': (1000000000000.0, 1000000000000.5)})"


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        ({"turn": 0.3}, "turn = 0.3 is no level"),
        ({"fingers": 3.4}, "fingers = 3.4 is no level"),
        ({"turn": 1.5}, "turn = 1.5 lies outside its range"),
        ({"force": "strong"}, "force is 'strong'; give a finite number"),
    ],
)
def test_what_is_fixed_can_be_tried(fixed, message):
    with pytest.raises(InputError, match=message):
        Optimizer(BOX, fixed=fixed)


def test_what_nobody_can_command_was_not_tried():
    box = Box({"turn": (-1.0, 1.0, "step=0.25"), "batch": (1, 1000, "int", "log"), "x": (0.0, 1.0)})
    optimizer = Optimizer(box)
    for point, message in (
        ({"turn": 0.3, "batch": 3, "x": 0.5}, "turn = 0.3 is no level; it goes from -1 in steps of 0.25"),
        ({"turn": 0.25, "batch": 2.5, "x": 0.5}, "batch = 2.5 is no level"),
        ([0.25, np.log(2.5), 0.5], "batch = 2.5 is no level"),
    ):
        with pytest.raises(InputError, match=message):
            optimizer.tell(point, 1.0)
    assert len(optimizer.y) == 0
    optimizer.tell({"turn": 0.25, "batch": 3, "x": 0.5}, 1.0, reached={"turn": 0.3, "batch": 2.5, "x": 0.5})
    for k in (1, 2, 7, 999, 1000):
        optimizer.tell(np.float32(box.points({"turn": -0.75, "batch": k, "x": 0.1})), 1.0)
    trial = optimizer.ask_trial()
    optimizer.tell(trial.parameters | {"turn": trial.parameters["turn"] + 0.01}, 1.0)  # what was asked for, rounded
    assert len(optimizer.pending) == 0


def test_the_last_level_is_one_that_the_steps_reach():
    box = Box({"n": (0, 10, "int", "step=3"), "x": (0.0, 1.0, "step=0.3")})
    found = [box.as_dict(box.from_unit([u, u])) for u in np.linspace(0.0, 1.0, 101)]
    assert {row["n"] for row in found} == {0, 3, 6, 9}
    assert sorted({round(row["x"], 9) for row in found}) == [0.0, 0.3, 0.6, 0.9]


def test_correlated_noise_beside_a_choice():
    rng = np.random.default_rng(0)
    box = Box({"x": (-1.0, 3.0), "g": ["p", "q"], "n": (0, 9, "int"), "f": (0.1, 10.0, "log")})
    root = np.array([[0.1, 0.0, 0.0], [0.2, 0.3, 0.0], [0.0, -0.05, 0.1]])
    stated = InputNoise(covariance=root @ root.T)  # of x, n and the logarithm of f
    noise = Optimizer(box, input_noise=stated).input_noise
    own, widths = [0, 3, 4], box.widths[[0, 3, 4]]
    covariance = noise.unit_covariance(box)
    assert covariance[np.ix_(own, own)] * np.outer(widths, widths) == pytest.approx(root @ root.T)
    assert not covariance[1:3].any()
    optimizer = Optimizer(box, seed=0)
    for _ in range(40):
        asked = optimizer.ask_trial()
        x, n, log_f = asked.x[own] + root @ rng.standard_normal(3)
        reached = {"x": x, "g": asked.parameters["g"], "n": n, "f": float(np.exp(log_f))}
        optimizer.tell(asked, 0.0, reached=reached)
    again = Optimizer(box, input_noise=optimizer.estimate_input_noise()).input_noise
    correlations = np.corrcoef(root @ rng.standard_normal((3, 4000)))
    found = again.unit_covariance(box)[np.ix_(own, own)]
    deviations = np.sqrt(np.diag(found))
    assert found / np.outer(deviations, deviations) == pytest.approx(correlations, abs=0.3)

"""The perturbed re-queries of a run's points: how many, said where they are slow, kept at Ctrl-C."""

import io

import numpy as np
import pytest
from rich.console import Console

import surehold as sh
from surehold.cli import requeries
from surehold.cli.requeries import requeried

NOISE = sh.InputNoise.unit(0.03)


class Hill:
    name, box = "hill", sh.Box({"x": (0.0, 1.0)})

    def __init__(self):
        self.asked = 0
        self.limit = np.inf

    def __call__(self, x):
        self.asked += 1
        if self.asked > self.limit:
            raise KeyboardInterrupt
        return -((float(x[0]) - 0.3) ** 2)


@pytest.fixture
def hill():
    problem = Hill()
    result = sh.maximize(problem, problem.box, n_trials=8, input_noise=NOISE, seed=0)
    problem.asked = 0
    return problem, result


def scored(hill, n):
    problem, result = hill
    console = Console(file=io.StringIO(), width=200)
    answers = [("highest", 0), ("recommended", 1)]
    return *requeried(problem, result, NOISE, n, 0, answers, console), console.file.getvalue()


def test_as_many_as_are_asked_for_without_a_word_where_they_are_fast(hill):
    scores, notes, said = scored(hill, 7)
    assert [len(score.values) for score in scores.values()] == [7, 7]
    assert (hill[0].asked, notes, said) == (14, [], "")


def test_slow_ones_are_announced_once(hill, monkeypatch):
    monkeypatch.setattr(requeries, "_SOON", 0.0)
    said = scored(hill, 7)[2]
    assert said.count("Re-querying the highest point and the recommended point 7 times with the noise: 1 of 14") == 1


def test_ctrl_c_leaves_the_rest_out(hill):
    hill[0].limit = 9
    scores, notes, _ = scored(hill, 7)
    assert [score is None for score in scores.values()] == [False, True]
    assert notes == ["The re-queries of the recommended point were interrupted and left out."]


@pytest.mark.parametrize("border", ["keep", "extend"])
def test_re_queries_that_would_have_left_the_box_are_counted(border):
    class Slope(Hill):
        def __init__(self):
            super().__init__()
            self.border = border

        def __call__(self, x):
            return float(x[0])

    problem = Slope()
    result = sh.maximize(problem, problem.box, n_trials=8, initial_points=[[0.2], [1.0]], input_noise=NOISE, seed=0)
    scores, notes, _ = scored((problem, result), 50)
    extended = sh.problems.perturbed_points(result.X[1], problem.box, NOISE, 50, 0, "extend")
    left = int((extended > 1.0).sum())
    assert left > 10
    if border == "keep":
        assert notes == [
            "Re-queries stay in the box: a variable that would have left it kept its commanded value "
            f"(in {left} of 50 of the recommended point)."
        ]
        assert int((scores["recommended", 1].points == 1.0).sum()) == left
    else:
        assert notes == []

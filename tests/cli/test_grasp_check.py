import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from surehold.cli import run
from surehold.cli.grasp_check import verdict_in_words
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.physics.check import LOADS, GraspCheck, GraspChecker, LoadOutcome
from surehold.grasping.physics.explanation import explained
from surehold.grasping.poses import Pose
from surehold.grasping.simulator import Simulator


@pytest.fixture(scope="module")
def bottle_checker():
    return GraspChecker(Simulator("icub-left", shipped_object("bottle")))


def check_of(verdict, settled, settled_turn, worst):
    quiet = [LoadOutcome(name, "held", 0.004, 0.0) for name in LOADS[1:]]
    return GraspCheck(verdict, settled, settled_turn, 0.1, (LoadOutcome(LOADS[0], *worst), *quiet))


@pytest.mark.parametrize(
    ("verdict", "squeeze", "worst", "words"),
    [
        (
            "held",
            (0.001, 0.01),
            ("held", 0.006, 0.01),
            "held, moves 6.0 mm under gravity +x; the squeeze moves it 1.0 mm, quality then 0.100",
        ),
        (
            "slipped",
            (0.001, np.radians(2.0)),
            ("slipped", 0.002, np.radians(25.0)),
            "slipped, moves 2.0 mm and turns 25.0 degrees under gravity +x; the squeeze moves it 1.0 mm and turns it "
            "2.0 degrees, quality then 0.100",
        ),
    ],
)
def test_the_verdict_names_the_load_and_the_motion_that_decide(verdict, squeeze, worst, words):
    assert verdict_in_words(check_of(verdict, *squeeze, worst)) == words


def test_a_squeeze_that_turns_the_object_is_said_to_turn_it(bottle_checker):
    grasp = bottle_checker.simulator.grasp(Pose((0.0, 0.0, 0.0)))
    grasp = replace(grasp, status="ok")
    check = check_of("moved", 0.0012, np.radians(7.04), ("held", 0.001, 0.0))
    assert explained(bottle_checker, grasp, check).startswith("the squeeze moves it 1.2 mm and turns it 7.0 degrees")


def test_no_more_force_is_said_than_was_tried(bottle_checker):
    strong = GraspChecker(bottle_checker.simulator, finger_force=600.0)
    grasp = replace(strong.simulator.grasp(Pose((0.3, 0.0, 0.0))), status="not closed")
    check = check_of("dropped", 0.0, 0.0, ("dropped", np.inf, np.pi))
    assert explained(strong, grasp, check).startswith("not held with 1000 N a finger either")


def test_physics_has_a_say(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert (
        run(["grasp", "bottle", "--trials", "12", "--initial", "10", "--noise", "0.03", "--check", "--out", "bottle"])
        == 0
    )
    assert "physics: " in capsys.readouterr().out
    stored = json.loads((tmp_path / "bottle" / "result.json").read_text())
    assert "physics" in json.dumps(stored), "the verdict is kept"
    page = (tmp_path / "bottle" / "report.html").read_text(encoding="utf-8")
    assert "held, as measured" in page
    assert "thumb 1" in page, "links that touch are counted by finger"


def test_without_mujoco_it_says_so_before_the_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert run(["grasp", "bottle", "--trials", "12", "--initial", "10", "--check", "--out", "bottle"]) != 0
    assert "pip install 'surehold[mujoco]'" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "bottle").exists()

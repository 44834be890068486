"""`surehold grasp`: how often it closes the hand, and what a preset sets."""

import json

import pytest

from surehold.cli import run
from surehold.grasping import Simulator


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_no_grasp_is_closed_twice(here, monkeypatch):
    poses, grasp = [], Simulator.grasp

    def counted(self, pose, s1=0.0):
        poses.append((pose, s1))
        return grasp(self, pose, s1)

    monkeypatch.setattr(Simulator, "grasp", counted)
    assert run(["grasp", "mug", "--trials", "12", "--initial", "11", "--noise", "0.03", "--out", "mug"]) == 0
    assert (here / "mug" / "grasps.yaml").exists()
    assert len(poses) > 100, "12 trials, and the re-queries of one or two candidates"
    assert len(set(poses)) == len(poses)


def test_the_preset_of_the_thesis_grasps_as_the_thesis(here):
    line = "grasp bottle --preset thesis-grasp --trials 3 --initial 3 --noise none --method bo --out b"
    assert run(line.split()) == 0
    settings = json.loads((here / "b" / "result.json").read_text())["settings"]
    assert (settings["contact"], settings["quality"], settings["closing"]) == ("single", "simox", "synergy")
    assert settings["preset"] == "thesis-grasp"
    assert settings["friction"] == "1 in simox, 0.45 in force closure"


def test_the_preset_of_another_problem_is_refused(here, capsys):
    assert run(["grasp", "bottle", "--preset", "thesis-rkhs"]) != 0
    assert "preset of a grasp 'thesis-rkhs' is unknown" in " ".join(capsys.readouterr().err.split())
    assert run(["grasp", "bottle", "--preset", "thesis", "--contact", "patch"]) != 0
    assert "sets contact to 'single'" in " ".join(capsys.readouterr().err.split())


def test_a_run_replaces_what_another_left_in_its_folder(here, capsys):
    (here / "again").mkdir()
    (here / "again" / "notes.txt").write_text("mine")
    short = ["--trials", "3", "--initial", "3", "--noise", "none", "--method", "bo", "--out", "again"]
    line = ["grasp", "bottle", "--facet", "right-front", *short]
    assert run([*line, "--format", "graspgen,dexgraspbench"]) == 0
    assert run(["grasp", "rate", "again/grasps.yaml", "--out", "again"]) == 0
    assert (here / "again" / "graspgen.json").exists(), "a rating adds to what a run has written"
    capsys.readouterr()
    run(["grasp", "glass", *short])
    assert "Removed what an earlier run had left there" in capsys.readouterr().out
    names = {p.name for p in (here / "again").iterdir()}
    assert names >= {"notes.txt", "glass.obj", "grasps.yaml", "report.html", "result.json"}
    assert not names & {"graspgen.json", "dexgraspbench", "bottle.obj"}


def test_initial_trials_of_many_variables_begin_at_the_default_pose(here):
    line = "grasp bottle --variables dx,dy,rx,ry,s1 --trials 6 --initial 6 --requeries 0 --out b"
    assert run(line.split()) == 0
    found = json.loads((here / "b" / "result.json").read_text())
    tried = [x[2:] == pytest.approx([0.0, 0.0, -0.7], abs=1e-12) for x in found["trials"]["x"]]
    assert tried == [True, True, False] * 2
    assert found["settings"]["guess"] == "rx=0, ry=0, s1=-0.7"

"""`surehold grasp rate`: a run's grasps of every format are rated again, and what does not fit is one line."""

import json
import re
from copy import deepcopy

import numpy as np
import pytest
import trimesh
import yaml

from surehold.cli import run
from surehold.grasping import Simulator
from surehold.grasping.formats import read_grasps
from surehold.problems.grasp.stored import described_file, stored_words


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def block(here):
    """Return a folder with the grasps of a run on a mesh, in every format."""
    trimesh.creation.box((0.05, 0.05, 0.12)).export("block.stl")
    line = "grasp block.stl --unit m --mass 0.2 --friction 0.8 --trials 3 --initial 3 --noise none --method bo"
    assert run([*line.split(), "--format", "graspgen,dexgraspbench", "--out", "held"]) == 0
    return here / "held"


def rated(line, capsys):
    capsys.readouterr()
    assert run(["grasp", "rate", *line.split()]) == 0
    return " ".join(capsys.readouterr().out.split())


def test_a_run_is_rated_as_it_was(block, capsys):
    (found,) = json.loads((block / "grasps.json").read_text()).values()
    quality = found["grasp"]["quality"]
    text = rated("held/grasps.yaml", capsys)
    assert "on block, epsilon with graded contacts and friction 0.8" in text
    assert text.count(f"{quality:.3f}") == 2, "before and now"
    (block.parent / "block.stl").unlink()
    assert f"{quality:.3f}" in rated("held/grasps.yaml", capsys), "the mesh beside the file is taken"
    text = rated("held/graspgen.json --samples 4", capsys)
    assert f"{quality:.3f}" in text
    assert "off: mean" in text
    assert "off: 4 poses of each grasp that are off by up to 10 mm along and 5 degrees about each axis" in text
    assert f"{quality:.3f}" in rated("held/dexgraspbench/grasps", capsys)
    assert "friction 0.3" in rated("held/grasps.yaml --friction 0.3", capsys)


def test_what_was_said_of_the_mesh_is_kept_with_the_grasps(here, capsys):
    """A box turned by 45 degrees: its principal axes give another torque length than the axes of the file."""
    box = trimesh.creation.box((0.05, 0.05, 0.12))
    box.apply_transform(trimesh.transformations.rotation_matrix(0.8, (1, 0, 0))).export("turned.stl")
    line = "grasp turned.stl --unit m --frame file --trials 3 --initial 3 --noise none --method bo --variables dx,dy,dz"
    run([*line.split(), "--facet", "top-left", "--seed", "1", "--out", "turned"])
    before = rated("turned/grasps.yaml", capsys)
    assert yaml.safe_load((here / "turned" / "grasps.yaml").read_text())["surehold"]["frame"] == "file"
    (here / "turned.stl").unlink()
    words = described_file("turned/grasps.yaml", {})
    assert words.object.axes.tolist() == np.eye(3).tolist()
    assert before.split("on turned")[1] == rated("turned/grasps.yaml", capsys).split("on turned")[1]


def test_the_mass_of_a_cloud_is_kept():
    assert stored_words({"object": "", "cloud": "scan.ply", "unit": "mm", "mass": 0.7}) == {"mass": 0.7}


def test_an_option_that_is_given_counts_where_it_is_the_default(block, capsys):
    changed(block, lambda c: c["surehold"].update(contact="single"))
    assert "with single contacts" in rated("held/grasps.yaml", capsys)
    assert "with graded contacts" in rated("held/grasps.yaml --contact graded", capsys)


def test_every_format_says_what_its_grasps_were_made_with(here, capsys):
    line = "grasp bottle --facet right-front --trials 3 --initial 3 --contact single --quality volume --friction 0.7"
    run([*line.split(), "--noise", "none", "--method", "bo", "--out", "opt", "--format", "graspgen,dexgraspbench"])
    for file in ("grasps.yaml", "graspgen.json", "dexgraspbench/grasps"):
        text = rated(f"opt/{file}", capsys)
        assert "on bottle, volume with single contacts and friction 0.7." in text, file
        assert "names no options" not in text
    content = json.loads((here / "opt" / "graspgen.json").read_text())
    del content["surehold"]
    (here / "opt" / "graspgen.json").write_text(json.dumps(content))
    text = rated("opt/graspgen.json", capsys)
    assert "epsilon with graded contacts and friction 0.5. The file names no options; those not given have" in text


def test_a_hand_that_is_not_there_is_said_to_be_of_the_file(block, capsys):
    changed(block, lambda c: c["surehold"].update(hand="gone/hand.yaml"))
    capsys.readouterr()
    assert run(["grasp", "rate", "held/grasps.yaml"]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert "was made with hand 'gone/hand.yaml': cannot read" in error
    assert "Give --hand" in error
    assert "of hand icub-left" in rated("held/grasps.yaml --hand icub-left", capsys)


def test_the_check_says_what_it_weighs(block, capsys):
    assert "squeezed with 8 N a finger" in rated("held/grasps.yaml --check", capsys)
    assert ", 0.2 kg." in rated("held/grasps.yaml --check", capsys)
    assert ", 0.2 kg." in rated("held/dexgraspbench/grasps --check", capsys)


def test_a_name_in_brackets_is_shown_whole(block, capsys):
    content = yaml.safe_load((block / "grasps.yaml").read_text())
    content["grasps"] = {"[bold]": next(iter(content["grasps"].values()))}
    (block / "grasps.yaml").write_text(yaml.safe_dump(content))
    assert "[bold]" in rated("held/grasps.yaml", capsys)


@pytest.mark.parametrize("width", [40, 60, 80])
def test_a_narrow_terminal_loses_nothing(block, capsys, monkeypatch, width):
    line = "held/grasps.yaml --samples 3 --check"
    monkeypatch.setenv("COLUMNS", "200")
    assert run(["grasp", "rate", *line.split()]) == 0
    wide = capsys.readouterr().out
    monkeypatch.setenv("COLUMNS", str(width))
    assert run(["grasp", "rate", *line.split()]) == 0
    narrow = capsys.readouterr().out

    def table(text):
        rows = [row for row in text.splitlines() if "│" in row or "┃" in row]
        cells = [[cell.strip() for cell in row.replace("┃", "│").split("│")] for row in rows]
        return sorted("".join(column).replace(" ", "") for column in zip(*cells, strict=True))

    assert table(narrow) == table(wide)
    if width == 80:
        assert "off: mean ┃ closed ┃ physics" in narrow, "headers and numbers are whole"
    assert max(len(row) for row in narrow.splitlines() if "│" in row) <= width
    (told,) = [row for row in wide.splitlines() if row.startswith(("highest", "recommended:"))]
    assert re.search(r"(held|moved|slipped|dropped), .* under ", told)
    assert told in narrow, "a sentence is left to the terminal to wrap"


def test_of_simox_the_friction_is_told_that_it_has(here, capsys):
    line = "grasp mug --preset thesis-grasp --trials 3 --initial 3 --noise none --method bo --out thesis"
    assert run(line.split()) == 0
    text = rated("thesis/grasps.yaml", capsys)
    assert "simox with single contacts and friction 1 in simox, 0.5 in force closure" in text
    assert run(["grasp", "rate", "thesis/grasps.yaml", "--friction", "0.3"]) == 2
    assert "friction is 0.3, but the quality 'simox'" in " ".join(capsys.readouterr().err.split())


def test_rated_grasps_are_written_in_another_format(block, capsys):
    rated("held/grasps.yaml --out again --format graspgen", capsys)
    before, now = read_grasps(block / "grasps.yaml"), read_grasps(block.parent / "again" / "grasps.yaml")
    assert [g.position for g in now.grasps] == [pytest.approx(g.position, abs=1e-12) for g in before.grasps]
    assert now.settings == before.settings
    assert (block.parent / "again" / "graspgen.json").exists()


def changed(block, change):
    content = yaml.safe_load((block / "grasps.yaml").read_text())
    change(content)
    (block / "grasps.yaml").write_text(yaml.safe_dump(content))


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (lambda c: c.update(format_version=2.0), "", "has format_version '2.0'; version 1.0 is supported"),
        (lambda c: c["surehold"].update(tool="rm"), "", "surehold.tool is none of object, unit"),
        (lambda c: c["surehold"].update(friction="x"), "", "friction is 'x'; it must be a number"),
        (lambda c: c["surehold"].update(hand=["x"]), "", "it must be a text"),
        (lambda c: c["surehold"].update(contact="x"), "", "contact model 'x' is unknown"),
        (
            lambda c: [g["cspace_position"].update(elbow=0.1) for g in c["grasps"].values()],
            "",
            "joints elbow are none of hand",
        ),
        (
            lambda c: next(iter(c["grasps"].values())).update(posture=[0.1, 0.2]),
            "",
            "grasp 'recommended': 2 amplitudes are given",
        ),
        (lambda c: c.update(object_file="../../elsewhere.obj", surehold={}), "", "is not beside it"),
        (lambda c: c.update(object_file="", surehold={}), "", "names no object; give one with --object"),
        (lambda c: None, "--object nothing", "object 'nothing' is unknown"),
        (lambda c: None, "--format step", "isaac, graspgen, dexgraspbench"),
        (lambda c: None, "--samples -1", "number of disturbed trials is -1"),
    ],
)
def test_what_does_not_fit_is_one_line(block, capsys, change, line, words):
    changed(block, change)
    capsys.readouterr()
    assert run(["grasp", "rate", "held/grasps.yaml", *line.split()]) == 2
    captured = capsys.readouterr()
    assert words in " ".join(captured.err.split())
    assert captured.err.count("error:") == 1


def test_a_file_that_is_none(here, capsys):
    assert run(["grasp", "rate", "nothing.yaml"]) == 2
    assert "cannot read 'nothing.yaml'" in capsys.readouterr().err
    assert run(["grasp", "mug", "--format", "step", "--out", "x"]) == 2
    assert "format of grasps 'step' is unknown" in " ".join(capsys.readouterr().err.split())
    assert not (here / "x").exists(), "said before the run"


def test_what_was_rated_before_an_interruption_is_said(block, capsys, monkeypatch):
    changed(block, lambda c: c["grasps"].update(second=deepcopy(next(iter(c["grasps"].values())))))
    grasp, closed = Simulator.grasp, []

    def interrupted(self, pose, s1=0.0):
        closed.append(pose)
        if len(closed) == 2:
            raise KeyboardInterrupt
        return grasp(self, pose, s1)

    monkeypatch.setattr(Simulator, "grasp", interrupted)
    said = rated("held/grasps.yaml", capsys)
    assert "Interrupted: 1 of 2 grasps are rated." in said
    assert "held/grasps.yaml: 1 grasp of hand" in said

"""`surehold scene`, and `surehold grasp` with files: what a user types and gets."""

import json

import pytest
import trimesh
import yaml

from surehold.cli import run
from surehold.grasping.formats import read_isaac_grasps

GRIPPER = """
<mujoco><worldbody><body name="palm"><geom type="box" size=".02 .05 .01" pos="0 0 -.01"/>
  <body name="l" pos="-.05 0 0"><joint name="left" type="slide" axis="1 0 0" range="0 .05"/>
    <geom type="box" size=".006 .015 .035" pos="0 0 .035"/></body>
  <body name="r" pos=".05 0 0"><joint name="right" type="slide" axis="-1 0 0" range="0 .05"/>
    <geom type="box" size=".006 .015 .035" pos="0 0 .035"/></body>
</body></worldbody></mujoco>
"""
DESCRIBED = {
    "name": "gripper",
    "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
    "fingers": {"left": ["left"], "right": ["right"]},
    "preshapes": {"pinch": {"closed": {"left": 0.05, "right": 0.05}}},
}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((30.0, 40.0, 60.0)).export("block.stl")
    (tmp_path / "gripper.xml").write_text(GRIPPER)
    (tmp_path / "gripper.yaml").write_text(yaml.safe_dump(DESCRIBED))
    return tmp_path


def surehold(line):
    return run(line.split())


def test_a_facet_has_four_modes_and_the_best_comes_first(here, capsys):
    assert surehold("scene bottle --facet right --contact single --out seen") == 0
    assert "4 modes" in capsys.readouterr().out
    page = (here / "seen" / "scene.html").read_text()
    assert page.count("data-view=") == 4
    stored = json.loads((here / "seen" / "scene.json").read_text())
    assert [g["mode"] for g in stored["grasps"]] == ["right-front", "right-back", "right-top", "right-bottom"]
    qualities = [g["grasp"]["quality"] for g in stored["grasps"]]
    assert f'"first":{qualities.index(max(qualities))}' in page
    assert all(0.3 <= g["free"] <= 0.7 for g in stored["grasps"]), "as the default pose promises"
    assert (here / "seen" / "scene.png").read_bytes().startswith(b"\x89PNG")


def test_a_scene_is_a_grid_over_two_offsets_whatever_the_command_line_says(here, capsys):
    assert surehold("scene bottle --variables dx,dy,dz,rx") == 2
    assert "--variables" in capsys.readouterr().err


def test_a_mesh_and_a_hand_of_ones_own(here, capsys):
    line = "grasp block.stl --unit mm --mass 0.2 --hand gripper.xml --hand-config gripper.yaml"
    assert surehold(f"{line} --trials 14 --initial 10 --noise 0.02 --out held") == 0
    assert "block.stl: 12 triangles, 30.0 x 40.0 x 60.0 mm, 200 g" in capsys.readouterr().out
    result = json.loads((here / "held" / "result.json").read_text())
    assert max(result["trials"]["y"]) > 0.0
    file = read_isaac_grasps(here / "held" / "grasps.yaml")
    assert (file.gripper_frame, file.gripper_file) == ("palm", "gripper.xml")
    assert set(file.grasps[0].joints) == {"left", "right"}
    assert json.loads((here / "held" / "grasps.json").read_text())
    assert (here / "held" / "grasp.png").exists()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("scene foo", "object 'foo' is unknown"),
        ("scene mug --facet up", "facet 'up' is unknown"),
        ("scene mug --facet right-left", "right-front, right-back, right-top, right-bottom"),
        ("scene block.stl", "give --unit mm"),
        ("scene mug --unit mm", "unit is for mesh files"),
        ("grasp mug --mass 0", "mass is for mesh files"),
        ("grasp block.stl --unit mm --mass nan", "mass is nan"),
        ("grasp block.stl --unit mm --friction -1", "friction is -1"),
        ("grasp block.stl --unit mm --friction 1e9", "friction is 1000000000"),
        ("grasp nowhere.stl --unit mm", "cannot read 'nowhere.stl'"),
        ("grasp mug --hand gripper.xml", "hand-config: a YAML file"),
        ("grasp mug --hand-config gripper.yaml", "hand-config describes a model file"),
        ("grasp mug --hand gripper.xml --hand-config nowhere.yaml", "cannot read 'nowhere.yaml'"),
        ("grasp mug --hand gripper --out x", "hand 'gripper' is unknown"),
        ("grasp mug --hand gripper.xml --hand-config gripper.yaml --variables s1", "no posture variable"),
        ("grasp mug --preshape hook", "power, tripod, pinch"),
        ("grasp mug --closing fast", "adaptive, synergy"),
    ],
)
def test_what_does_not_fit_is_one_line(line, words, capsys):
    assert surehold(line) == 2
    captured = capsys.readouterr()
    message = " ".join(captured.err.split())
    assert words in message
    assert captured.err.count("error:") == 1
    assert "Traceback" not in captured.err


def test_a_scene_or_an_exploration_that_is_interrupted_leaves_no_empty_folder(here, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("surehold.cli.scene._best", interrupted)
    monkeypatch.setattr("surehold.cli.explore._Run.look", interrupted)
    (here / "mine").mkdir()
    for line in ("scene mug --facet right-front", "scene mug --facet right-front --out mine", "explore mug"):
        assert surehold(line) == 130
    assert list((here / "runs").iterdir()) == []
    assert (here / "mine").is_dir()
    assert "interrupted" in capsys.readouterr().err

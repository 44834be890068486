"""`surehold hand new` and `hand show`: what a user types and gets, and a grasp with what was written."""

import json

import pytest
import yaml

from surehold.cli import run
from tests.grasping.hand_models import SLIDING, five_fingers


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "five.xml").write_text(five_fingers())
    (tmp_path / "models" / "slide.xml").write_text(SLIDING)
    return tmp_path


def surehold(line):
    return run(line.split())


def test_a_hand_is_described_shown_and_grasped_with(here, capsys):
    assert surehold("hand new models/five.xml") == 0
    said = capsys.readouterr().out
    assert "a hand of 5 fingers (index, middle, ring, little, thumb) on palm; thumb is opposed" in said
    assert "index_bend_1" in said
    assert "Warning" not in said
    assert "surehold grasp mug --hand five.yaml" in said
    page = (here / "runs" / "hand-five" / "hand.html").read_text()
    assert page.count("<td>thumb_bend_2</td>") == 1
    assert "http" not in page.split("<script>")[0], "nothing is fetched"
    line = "grasp bottle --hand five.yaml --contact single --trials 12 --initial 12 --noise none --method bo --out held"
    assert surehold(line) == 0
    grasps = json.loads((here / "held" / "grasps.json").read_text())
    touching = {name.split("_")[0] for grasp in grasps.values() for name in grasp["grasp"]["contacts"]["names"]}
    assert {"thumb", "index", "middle"} <= touching


def test_a_description_elsewhere_finds_its_model(here, capsys, monkeypatch):
    (here / "descriptions").mkdir()
    assert surehold("hand new models/slide.xml --out descriptions/gripper.yml") == 0
    written = yaml.safe_load((here / "descriptions" / "gripper.yml").read_text())
    assert written["model"] == {"file": "../models/slide.xml"}
    (here / "other").mkdir()
    monkeypatch.chdir(here / "other")
    capsys.readouterr()
    assert surehold("hand show ../descriptions/gripper.yml --out page") == 0
    assert "0.0 to 40.0 mm │ 40.0 │ 0.0" in capsys.readouterr().out
    assert (here / "other" / "page" / "hand.html").exists()


def test_a_built_in_hand_and_a_model_with_its_description(here, capsys):
    assert surehold("hand show icub-left") == 0
    said = capsys.readouterr().out
    assert said.count("thumb_distal") == 3, "in each of its preshapes"
    assert "Warning" not in said
    assert surehold("hand new models/slide.xml") == 0
    assert surehold("hand show models/slide.xml --hand-config slide.yaml") == 0


def test_what_looks_wrong_is_said_and_advised_where_nothing_closes(here, capsys):
    assert surehold("hand new models/slide.xml") == 0
    text = (here / "slide.yaml").read_text()
    assert "z: [0, 0, 1]" in text
    (here / "wrong.yaml").write_text(text.replace("z: [0, 0, 1]", "z: [0, 0, -1]"))
    capsys.readouterr()
    assert surehold("hand show wrong.yaml") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Warning: In 'pinch' the fingertips close behind the palm" in said
    assert "close behind the palm" in (here / "runs" / "hand-slide" / "hand.html").read_text()
    line = "grasp mug --hand wrong.yaml --contact single --trials 4 --initial 4 --noise none --method bo --out none"
    assert surehold(line) == 3
    said = " ".join(capsys.readouterr().out.split())
    assert "None of 4 trials succeeded" in said
    assert "The hand looks wrong: In 'pinch' the fingertips close behind the palm" in said
    line = "grasp mug --hand slide.yaml --contact single --trials 4 --initial 4 --noise none --method bo --out wide"
    assert surehold(line) == 3, "the mug is wider than this gripper"
    assert "The hand looks wrong" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("hand new nowhere.xml", "cannot read 'nowhere.xml'"),
        ("hand new old.yaml", "'old.yaml' is a description, not a model; look at it with: surehold hand show old.yaml"),
        ("hand new text.stl", "no model of a hand"),
        ("hand new text.xml", "not a model that MuJoCo can read"),
        ("hand new models/five.xml --out old.yaml", "'old.yaml' exists already; name another file with --out"),
        ("hand new models/five.xml --out five.txt", "a description is a .yaml file"),
        ("hand new models/five.xml --out no/five.yaml", "cannot be written"),
        ("hand new models/five.xml --palm plam", "body 'plam' is unknown; did you mean 'palm'"),
        ("hand new models/five.xml --palm thumb_0", "1 finger found below body 'thumb_0'"),
        ("hand show nobody", "hand 'nobody' is unknown"),
        ("hand show old.yaml", "is no hand description"),
        ("hand show lost.yaml", "cannot read 'lost.xml'"),
        ("hand show models/five.xml", "hand-config"),
    ],
)
def test_what_does_not_fit_is_one_line(here, line, words, capsys):
    (here / "old.yaml").write_text("- 1\n")
    (here / "text.xml").write_text("solid teapot")
    surehold("hand new models/slide.xml --out lost.yaml")
    (here / "lost.yaml").write_text((here / "lost.yaml").read_text().replace("models/slide.xml", "lost.xml"))
    capsys.readouterr()
    assert surehold(line) == 2
    captured = capsys.readouterr()
    message = " ".join(captured.err.split())
    assert words in message
    assert captured.err.count("error:") == 1
    assert "Traceback" not in captured.err
    assert (here / "old.yaml").read_text() == "- 1\n"
    assert not (here / "five.yaml").exists()

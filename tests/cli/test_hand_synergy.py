"""`surehold hand synergy`: what a user types and gets, and a grasp with it."""

from pathlib import Path

import pytest

from surehold.cli import run
from surehold.grasping.formats import read_isaac_grasps

RECORDED = Path(__file__).parents[2] / "examples" / "synergies" / "icub_postures.csv"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_synergy_is_learned_and_grasped_with(here, capsys):
    assert run(["hand", "synergy", str(RECORDED), "--components", "3", "--out", "s.yaml"]) == 0
    text = capsys.readouterr().out
    assert "joints of icub-left; the components explain" in text
    assert text.count(" %") == 4
    line = "grasp bottle --preshape s.yaml --variables dx,s1,s2 --contact single --trials 3 --initial 3"
    assert run([*line.split(), "--noise", "none", "--method", "bo", "--out", "b"]) == 0
    file = read_isaac_grasps(here / "b" / "grasps.yaml")
    assert len(file.grasps[0].posture) == 2
    assert file.settings["preshape"] == "s.yaml"
    quality = file.grasps[0].quality
    capsys.readouterr()
    assert run(["grasp", "rate", "b/grasps.yaml"]) == 0
    assert capsys.readouterr().out.count(f"{quality:.3f}") >= 2, "before and now"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("hand synergy nothing.csv", "cannot read 'nothing.csv'"),
        (f"hand synergy {RECORDED} --components 9", "components are 9"),
        ("hand synergy subjects.csv", "column 'subject' is no joint of the hand"),
        ("hand synergy degrees.csv", "give radians, or say --degrees"),
        (f"hand synergy {RECORDED} --hand nobody", "hand 'nobody' is unknown"),
        ("grasp mug --preshape nothing.yaml", "cannot read 'nothing.yaml'"),
    ],
)
def test_what_does_not_fit_is_one_line(line, words, capsys, here):
    rows = RECORDED.read_text().splitlines()
    (here / "degrees.csv").write_text("index_proximal,thumb_knuckle\n10,115\n80,90\n45,60\n")
    (here / "subjects.csv").write_text("\n".join(f"{row},{'ann' if i else 'subject'}" for i, row in enumerate(rows)))
    assert run(line.split()) == 2
    assert words in " ".join(capsys.readouterr().err.split())

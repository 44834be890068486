import json
import sys

from surehold.cli import run


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

import json

from surehold.cli import run


def test_a_run_without_a_feasible_trial_says_so_first(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.py").write_text(
        "def press(x):\n    return x[0], {'torque': 3.3 + x[0] + x[1], 'heat': 1.0, 'seen': 2.0}\n"
    )
    options = ["--bounds", "a=0:1,b=0:1", "--method", "bo", "--noise", "none", "--trials", "9", "--out", "out"]
    code = run(["maximize", "rig.py:press", *options, "--initial", "6", "--constraint", "torque<=3"])
    told = " ".join(capsys.readouterr().out.split())
    assert code == 3
    assert "No feasible trial in 9; the nearest missed torque by 0.3" in told.split("observed")[0]
    assert "best value found" not in told
    assert json.loads((tmp_path / "out" / "result.json").read_text())
    assert "No feasible trial in 9" in (tmp_path / "out" / "report.html").read_text()
    code = run(
        ["maximize", "rig.py:press", *options, "--initial", "6", "--constraint", "torque<=4", "--constraint", "heat"]
    )
    told = " ".join(capsys.readouterr().out.split())
    assert code == 0
    assert json.loads((tmp_path / "out" / "result.json").read_text())["settings"]["constraints"] == "torque<=4, heat"
    assert "torque&lt;=4, heat" in (tmp_path / "out" / "report.html").read_text()
    assert "heat 1" in told
    assert "No feasible trial" not in told


def test_a_guess_of_some_variables_is_kept_by_two_of_three_initial_trials(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.py").write_text("def press(x):\n    return x[0] * x[1]\n")
    line = "maximize rig.py:press --bounds a=0:1,b=0:1 --noise 0.03 --trials 6 --initial 6 --requeries 0 --out out"
    assert run([*line.split(), "--guess", "b=0.5"]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [x[1] == 0.5 for x in result["trials"]["x"]] == [True, True, False] * 2
    assert result["settings"]["guess"] == "b=0.5"
    assert not {"constraints", "allowed", "safety", "outcome"} & result["settings"].keys(), "what was not given"
    assert run([*line.split(), "--guess", "c=0.5"]) == 2
    assert "guess variable 'c' is unknown; choose one of: a, b." in " ".join(capsys.readouterr().err.split())

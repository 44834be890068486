import json
import signal
import subprocess
import sys
import time

import pytest

import surehold as sh
from surehold.cli import run

OWN = """
def hill(x):
    return 1.0 - float(((x - 0.3) ** 2).sum())
def by_name(p):
    return p["n"] - (p["grip"] == "power")
def unplugged(x):
    raise RuntimeError("no robot here")
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "twice.csv").write_text("dx,dy,value,value\n0.0,0.0,1.0,2.0\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SUREHOLD_STORAGE", raising=False)
    return tmp_path


@pytest.fixture
def study(capsys):
    """Call `surehold study` and return its exit code and its answer in JSON."""

    def call(line, code=0):
        capsys.readouterr()
        found = run(["study", *line.split(), "--json"])
        out, err = capsys.readouterr()
        assert found == code, err
        return json.loads(out) if out.strip() else err

    return call


CREATE = "create mug --parameters dx=-0.05:0.05,dy=-0.03:0.03 --noise dx=0.003,dy=0.003 --units dx=m,dy=m --initial 4"


def test_a_robot_by_commands(study, here):
    made = study(CREATE)
    assert made["input_noise"] == {"standard_deviations": {"dx": 0.003, "dy": 0.003}}
    for k in range(6):
        asked = study("ask mug")
        assert asked["id"] == k
        assert asked["units"] == {"dx": "m", "dy": "m"}
        x = asked["parameters"]
        told = study(f"tell mug {k} {1.0 - 40.0 * abs(x['dx'] - 0.01) - 20.0 * abs(x['dy'])!r}")
        assert told == {"id": k, "state": "complete", "value": told["value"], "already": False, "of": 1}
        assert study(f"tell mug {k} {told['value']!r}")["already"]
    assert "told before" in study("tell mug 0 7", code=2)
    failed = study("ask mug --worker arm")
    assert study("ask mug --worker arm") == failed | {"again": True}
    assert study("tell mug 6 --failed")["state"] == "failed"
    reached = study("ask mug")
    study(f"tell mug {reached['id']} 0.9 --reached dx=0.0101")
    preview = study("next mug")
    assert preview["expected_improvement"] > 0.0
    assert study("ask mug")["parameters"] == preview["parameters"]
    best = study("recommend mug")
    assert best["n"] == 7
    shown = study("status mug")
    assert (shown["complete"], shown["failed"], shown["running"]) == (7, 1, 1)
    assert shown["pending"][0]["parameters"] == preview["parameters"]
    exported = study("export mug")
    assert exported["recommendation"]["trial"] == best["trial"]
    assert len(exported["trials"]) == 9
    assert run(["study", "export", "mug", "--out", "trials.csv"]) == 0
    lines = (here / "trials.csv").read_text().splitlines()
    assert lines[0].startswith("id,state,value,dx,dy,reached_dx,reached_dy")
    assert len(lines) == 10


def test_executions_that_leave_the_ranges_are_named(study, capsys):
    study("create rig --parameters x=0:1 --noise x=0.05 --initial 4")
    for k in range(6):
        x = study("ask rig")["parameters"]["x"]
        study(f"tell rig {k} {x!r}")
    assert study("recommend rig")["outside"]["x"] > 0.2
    assert run(["study", "recommend", "rig"]) == 0
    assert " along x leave it. Nothing was" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--guess fingers=2,speed=0.5", "--first fingers=2,speed=0.5,x=0.25"])
def test_a_choice_may_be_a_number(study, option):
    """Of 2 came 2.0, which is none of the choices."""
    study(f"create hand --parameters fingers=2/3/5,speed=0.5/inf,x=0:1 --noise none {option}")
    asked = study("ask hand")["parameters"]
    assert (asked["fingers"], asked["speed"]) == ("2", "0.5")
    study("create fast --parameters speed=0.5/inf,x=0:1 --noise none --guess speed=inf")
    assert study("ask fast")["parameters"]["speed"] == "inf"


def test_a_robot_stops_at_the_border(study):
    """What it says is what an optimizer says that is told so."""
    assert study("create edge --parameters x=0:1 --noise x=0.1 --border clip")["optimizer"]["border"] == "clip"
    other = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), input_noise=sh.InputNoise({"x": 0.1}), border="clip", seed=0)
    for k in range(9):
        study(f"add edge --at x={k / 8} {k / 8}")
        other.tell([k / 8], k / 8)
    found, same = study("recommend edge"), other.recommend()
    assert (found["outside"], found["parameters"]) == ({}, {"x": 1.0})
    assert found["mean"] == pytest.approx(same.mean, abs=1e-9)
    assert found["mean"] < 0.98, "half of the executions stop at the border, the others fall short of it"


def test_stop_says_when_asking_ends(study, capsys):
    study(CREATE)
    for options, words in (
        ("--trials 3", "open, ends after 3 trials in all\n"),
        ("--trials 3 --improvement 0.01", "open, ends after 3 trials in all, or when 3 trials in a row promise less"),
        ("--hours 1", "open, ends at 2"),
        ("", "open, never ends by itself"),
    ):
        assert run(["study", "stop", "mug", *options.split()]) == 0
        assert words in capsys.readouterr().out


def test_people_by_commands(study):
    study(CREATE)
    study("ask mug")
    assert study("veto mug 0 --reason table")["state"] == "vetoed"
    assert study("add mug --at dx=0.01,dy=0 0.8")["id"] == 1
    study("pause mug --reason lunch")
    assert study("ask mug", code=1) == {"id": None, "state": "paused", "reason": study("ask mug", code=1)["reason"]}
    assert study("next mug", code=1) == study("ask mug", code=1)
    study("resume mug")
    assert study("stop mug --trials 3")["stopped"] is False
    study("ask mug")
    assert study("ask mug", code=1)["state"] == "stopped"
    assert study("status mug")["state"] == "stopped"
    assert study("stop mug --hours 1 --improvement 0.01 --asks 2")["stop_rule"]["asks"] == 2
    assert study("stop mug")["stop_rule"]["trials"] is None
    assert study("ask mug")["id"] == 3


def test_a_fault_of_the_rig_and_a_wild_reading(study, capsys):
    study(CREATE)
    study("ask mug")
    assert study("tell mug 0 --rig")["state"] == "waiting"
    assert study("ask mug")["again"]
    for value in (0.1, 0.5, -30, 0.3, 0.4):
        study(f"add mug {value} --at dx={0.04 * abs(value) % 0.05},dy=0")
    assert run(["study", "recommend", "mug"]) == 0
    assert "Trial 3 gave a value so far on the bad side" in " ".join(capsys.readouterr().out.split())


def test_plain_answers_are_for_people(capsys):
    for line in (CREATE, "ask mug", "tell mug 0 0.5", "status mug", "next mug", "recommend mug", "pause mug"):
        assert run(["study", *line.split()]) == 0
    out = capsys.readouterr().out
    assert "trial 0\n  dx = " in out
    assert " m\n" in out
    assert "study mug in runs/mug/journal.log: open" in out
    assert "expect" in out


def test_parameters_of_every_kind(study):
    text = "f=0.1:100:log,n=1:9:int:step=2,k=1:1000:int:log,t=0:1:step=0.25,grip=pinch|power"
    made = study(f"create all --parameters {text} --noise none")
    assert made["parameters"]["k"]["attributes"]["log"] is True
    parameters = study("ask all")["parameters"]
    assert parameters["n"] in (1, 3, 5, 7, 9)
    assert parameters["grip"] in ("pinch", "power")
    study("tell all 0 1.5 --reached grip=power,f=0.5")
    study("add all --at f=1,n=3,k=10,t=0.5,grip=pinch 2")
    assert study("recommend all")["n"] == 2


def test_a_worker_by_command(study, capsys):
    study("create hill --parameters x=0:1,y=0:1 --problem own.py:hill --initial 5")
    study("stop hill --trials 8")
    assert run(["study", "work", "hill", "--trials", "3"]) == 0
    assert run(["study", "work", "hill"]) == 0
    assert study("status hill")["complete"] == 8
    study("create named --parameters n=1:5:int,grip=pinch|power --noise none --initial 4")
    assert run(["study", "work", "named", "--function", "own.py:by_name", "--trials", "6"]) == 0
    assert study("recommend named")["parameters"]["grip"] == "pinch"
    study("create r --problem rkhs --initial 3")
    assert run(["study", "work", "r", "--trials", "3"]) == 0
    assert "Done: 3 trials" in capsys.readouterr().out
    study("stop r --trials 3")
    assert run(["study", "work", "r"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "Done: 0 trials by this worker: the study has stopped, the budget of 3 trials is used up." in told


def test_a_worker_all_of_whose_trials_failed_says_so(study, capsys):
    study("create dead --parameters a=0:1 --initial 6 --problem own.py:unplugged")
    assert run(["study", "work", "dead", "--trials", "2"]) == 1
    assert "Done: 2 trials by this worker, all failed." in capsys.readouterr().out
    assert run(["study", "work", "dead", "--trials", "1", "--function", "own.py:hill"]) == 0


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGINT])
def test_a_worker_that_is_ended_lets_its_trial_go(ending, study, here):
    (here / "slow.py").write_text("import time\n\ndef f(x):\n    time.sleep(60.0)\n")
    study("create slow --parameters x=0:1 --problem slow.py:f --noise none")
    command = [sys.executable, "-m", "surehold", "study", "work", "slow"]
    worker = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while study("status slow")["running"] == 0:
        assert worker.poll() is None
        time.sleep(0.1)
    time.sleep(0.3)
    worker.send_signal(ending)
    out, err = worker.communicate(timeout=600)
    assert (worker.returncode, err) == (130, "")
    assert "the one under way is let go" in out
    assert study("status slow")["pending"][0]["worker_alive"] is False


def test_warm_start_from_a_file_and_from_a_study(study, here):
    study(CREATE)
    (here / "rig.csv").write_text("x [m],dy,quality,state\n0.01,0.0,0.9,ok\n-0.02,0.01,,\n0.03,0.01,0.2,running\n")
    columns = '--columns "dx=x [m]"'
    assert run(["study", "import", "mug", "rig.csv", "--columns", "dx=x [m]", "--value", "quality"]) == 0, columns
    shown = study("status mug")
    assert (shown["complete"], shown["failed"]) == (1, 1)
    (here / "bad.csv").write_text("dx,dy,value\n0.01,0.0,0.9\n0.5,0.0,0.9\n")
    assert "bad.csv, line 3: parameters: dx = 0.5 lies outside" in study("import mug bad.csv", code=2)
    assert study("status mug")["trials"] == 2
    found = study("import mug bad.csv --skip-bad")
    assert found["imported"] == 1
    assert len(found["left_out"]) == 1
    study("create other --parameters u=-0.05:0.05,dy=-0.03:0.03 --noise none --storage sqlite:///other.db")
    assert study("import other --study mug --columns u=dx --storage sqlite:///other.db")["imported"] == 3
    exported = study("export other --storage sqlite:///other.db")["trials"]
    assert [t["value"] for t in exported] == [0.9, None, 0.9]
    assert exported[0]["note"] == "from mug, trial 0"
    again = here / "again.csv"
    assert run(["study", "export", "mug", "--out", str(again)]) == 0
    study("create third --parameters dx=-0.05:0.05,dy=-0.03:0.03")
    assert study("import third again.csv")["imported"] == 3


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("ask gone", "does not exist in this folder \\('/"),
        ("tell mug abc 1", "Invalid value for 'id': 'abc' is no whole number. See surehold study tell --help."),
        ("status --jsn", "See surehold study status --help."),
        ("create a --parameters dx=a", "'a' is neither a range nor a choice"),
        ("ask ../mug", "study name"),
        ("ask cup --storage runs/mug", "there are mug"),
        ("create mug --parameters dx=0:1", "exists in"),
        ("create a", "--parameters are missing"),
        ("create a --parameters dx=1:0", "smaller"),
        ("create a --parameters dx=0", "not understood"),
        ("create a --parameters dx=0:1:cubic", "none of log, int"),
        ("create a --parameters dx=0:1,dx=0:2", "named twice"),
        ("create a --parameters dx=0:1:log", "not understood .a logarithmic range lies above 0"),
        ("create a --parameters dx=a/a", "each can be there once"),
        ("create a --parameters dx=a/", "a choice is empty"),
        ("create a --parameters dx=0:1 --initial -1", "n_initial is -1"),
        ("create a --parameters dx=0:1 --feasible 0", "feasible is 0.0; give a probability"),
        ("create a --parameters dx=0:1 --constraint t<=3 --safety 0 --first dx=0.5", "safety is 0.0"),
        ("create a --parameters dx=0:1 --noise none --border clip", "--border clip is of executions under input noise"),
        ("create a --parameters dx=0:1 --border clop", "did you mean 'clip'"),
        ("create a --parameters dx=0:1:step=2", "wider than its range"),
        ("create a --parameters dx=0:1:step=0", "a step of 0 leads nowhere.; write NAME="),
        ("create a --parameters dx=0:1:step=z", "not understood"),
        ("create a --parameters grip=a/b --noise grip=0.1", "--noise is grip=0.1, but all parameters are choices"),
        ("create a --parameters value=0:1", "parameter 'value' has the name of a column"),
        ("create a --parameters dx=0.5:3:int", "give whole numbers"),
        ("create a --parameters dx=0:inf", "not understood|finite"),
        ("create a --parameters dx=0:1 --noise dy=0.1", "'dy' is unknown"),
        ("create a --parameters dx=0:1 --units dz=m", "'dz'"),
        ("create a --parameters dx=0:1 --criterion good", "criterion"),
        ("create a --parameters dx=0:1 --seed -1", "seed"),
        ("create a --parameters dx=0:1 --initial 0", "n_initial"),
        ("create a --problem rkh", "did you mean 'rkhs'"),
        ("create a --parameters x=0:1 --problem own.py:hil", "did you mean 'hill'"),
        ("create a --parameters dx=0:1 --storage mysql://x/y", "of no kind that is known"),
        ("create a --parameters dx=0:1 --storage own.py", "is no journal"),
        ("stop mug --hours -1", "--hours is -1"),
        ("stop mug --hours nan", "--hours is nan"),
        ("stop mug --asks 5", "--asks 5 is how often .* --improvement; give that"),
        ("tell mug 0 --failed --rig", "--failed says .*, --rig .*; give one of the two"),
        ("tell mug 0", "has no value"),
        ("tell mug 0 nan", "finite"),
        ("tell mug 0 inf", "finite"),
        ("tell mug 0 good", "finite"),
        ("tell mug 0 1 --failed", "leave one of the two out"),
        ("tell mug 1 1", "trial 1 is not in study 'mug'; the last one is 0"),
        ("tell mug -1 1", "0 or more"),
        ("tell mug 0 1 --reachd dx=0", "reachd"),
        ("tell mug 0 1 --reached dx=1e300", "can be reached"),
        ("tell mug 0 1 --reached dz=0", "'dz' is unknown"),
        ("tell mug 0 1 --reached dx", "not of the form"),
        ("veto mug 5", "not in study"),
        ("add mug --at dx=0 1", "say nothing about dy"),
        ("add mug --at dx=0,dy=0", "has no value"),
        ("stop mug --trials 0", "budget"),
        ("stop mug --improvement nan", "improvement"),
        ("import mug", "give either"),
        ("import mug gone.csv", "cannot be read"),
        ("import mug own.py", "has no column"),
        ("import mug twice.csv", "2 columns 'value'"),
        ("import mug --study gone", "does not exist"),
        ("recommend mug", "no trial has given a value yet"),
        ("work mug", "says nothing about what its trials are"),
        ("serve mug --token-file own.py", "chmod 600"),
        ("create new --parameters n=0:1" + "0" * 400 + ":int", "both must be finite numbers"),
        ("create new --parameters x=0:1e308", "bounds are finite numbers up to 1e.100"),
        ("create new --parameters x=0:1 --initial 1000000000", "100,000 trials at most"),
        ("tell mug 0 1e308", "another unit"),
        ("tell mug 0 1" + "0" * 5000, "finite"),
        ("serve mug --port 70000", "65535"),
        ("create new --parameters x=0:1 --outcome success --direction minimize", "success is maximized"),
        ("create new --parameters x=0:1 --constraint f<=1 --safety 0.9", r"needs constraints= .*\(--first\)"),
        ("create new --parameters x=0:1 --constraint x<=0.5", r"allowed='x <= 3' \(--allowed\)"),
    ],
)
def test_bad_input_is_refused_in_one_line(line, message, capsys):
    import re

    assert run(["study", *CREATE.split()]) == 0
    assert run(["study", "ask", "mug"]) == 0
    capsys.readouterr()
    assert run(["study", *line.split()]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert re.search(message, error), error
    assert run(["study", "tell", "mug", "0", "1"]) == 0, "something was lost"


def test_negative_numbers_and_ids(study):
    study(CREATE)
    study("ask mug")
    study("tell mug 0 -1.5")
    study("add mug --at dx=-0.01,dy=-0.01 -2.5e-3")
    assert study("status mug")["best_value"] == -2.5e-3


def test_a_process_of_its_own(here):
    """As another language would call it."""
    command = [sys.executable, "-m", "surehold", "study"]
    for line in (CREATE, "ask mug --json"):
        done = subprocess.run([*command, *line.split()], capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""
    assert json.loads(done.stdout)["id"] == 0


OWN_RUN = "maximize own.py:hill --bounds x=0:1,y=0:1 --initial 5 --study hill"


def test_the_trial_that_was_interrupted_is_not_said_to_be_done(study, here, capsys):
    (here / "cut.py").write_text(
        "from pathlib import Path\ndef hill(x):\n    with Path('calls').open('a') as f: f.write('.')\n"
        "    if Path('calls').stat().st_size == 3: raise KeyboardInterrupt\n    return -float(x[0] ** 2)\n"
    )
    command = ["maximize", "cut.py:hill", "--bounds", "x=0:1", "--initial", "4", "--trials", "4", "--study", "cut"]
    assert run(command) == 0
    assert study("status cut")["complete"] == 2
    capsys.readouterr()
    assert run([*command, "--constraint", "T"]) == 2
    assert "Give what is in the study, or leave out what is not, to resume it" in capsys.readouterr().err
    assert run(command) == 0
    assert "Resuming study cut: 2 trials are done." in capsys.readouterr().out
    assert study("status cut")["complete"] == 4


def test_a_run_is_kept_and_resumed(study, here, capsys):
    assert run([*OWN_RUN.split(), "--trials", "7"]) == 0
    assert (here / "runs" / "hill" / "report.html").exists()
    assert study("status hill")["complete"] == 7
    assert run([*OWN_RUN.split(), "--trials", "10"]) == 0
    assert "Resuming study hill: 7 trials are done" in capsys.readouterr().out
    whole = "maximize own.py:hill --bounds x=0:1,y=0:1 --initial 5 --trials 10 --study whole --storage sqlite:///w.db"
    assert run(whole.split()) == 0
    values = [
        [t["value"] for t in study(line)["trials"]] for line in ("export hill", "export whole --storage sqlite:///w.db")
    ]
    assert values[0] == values[1]
    results = [json.loads((here / "runs" / name / "result.json").read_text()) for name in ("hill", "whole")]
    assert results[0]["candidates"][-1]["x"] == results[1]["candidates"][-1]["x"]
    assert study("stop hill --trials 11")["stopped"] is False
    assert run(["study", "work", "hill"]) == 0
    assert study("status hill")["complete"] == 11


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("--seed 1", "seed: 0 in the study, 1 now"),
        ("--noise 0.1", "input noise"),
        ("--method bo", "input noise: .* nothing now"),
        ("--bounds x=0:2,y=0:1", "parameter x: 0:1 in the study, 0:2 now"),
        ("--initial 6", "n_initial: 5 in the study, 6 now"),
        ("--study ../hill", "study name"),
    ],
)
def test_a_run_with_other_settings_is_refused(change, message, capsys):
    import re

    assert run([*OWN_RUN.split(), "--trials", "5"]) == 0
    capsys.readouterr()
    assert run([*OWN_RUN.split(), "--trials", "7", *change.split()]) == 2
    assert re.search(message, capsys.readouterr().err)


def test_a_run_goes_on_in_a_folder_that_was_moved(study, here, capsys, monkeypatch):
    (here / "before").mkdir()
    (here / "own.py").rename(here / "before" / "own.py")
    monkeypatch.chdir(here / "before")
    assert run([*OWN_RUN.split(), "--trials", "5"]) == 0
    (here / "before").rename(here / "now")
    monkeypatch.chdir(here / "now")
    assert run(["study", "work", "hill"]) == 2
    assert "its folder was moved, say where it is now: --function" in capsys.readouterr().err
    assert run([*OWN_RUN.split(), "--trials", "6"]) == 0
    assert study("status hill")["complete"] == 6
    (here / "now" / "own.py").rename(here / "now" / "other.py")
    capsys.readouterr()
    assert run([*OWN_RUN.replace("own.py", "other.py").split(), "--trials", "7"]) == 2
    assert "with other settings: function: " in capsys.readouterr().err


def test_a_storage_needs_a_study(capsys):
    assert run(["maximize", "rkhs", "--trials", "3", "--initial", "3", "--storage", "a.log"]) == 2
    assert "no --study" in capsys.readouterr().err


@pytest.mark.parametrize(
    "line", ["study create a --parameters x=0:1", "maximize rkhs --trials 3 --initial 3 --study a"], ids=str.split
)
def test_what_is_gone_with_the_command_is_no_storage(line, capsys, monkeypatch, here):
    assert run([*line.split(), "--storage", "memory"]) == 2
    assert "--storage memory is gone when this command ends; give a file, such as" in capsys.readouterr().err
    monkeypatch.setenv("SUREHOLD_STORAGE", "memory")
    assert run(line.split()) == 2
    assert not (here / "runs" / "a" / "report.html").exists()


def test_a_grasp_is_kept_and_worked_on(study):
    line = "grasp mug --quality volume --closing synergy --trials 4 --initial 4 --study mug"
    assert run(line.split()) == 0
    assert study("status mug")["complete"] == 4
    study("stop mug --trials 6")
    assert run(["study", "work", "mug"]) == 0
    trials = study("export mug")["trials"]
    assert len(trials) == 6
    assert study("status mug")["units"] == {"dx": "m", "dy": "m"}
    problem = sh.problems.GraspProblem("mug", quality="volume", closing="synergy")
    for trial in trials[3:]:  # one made by the command, two by the worker from what the study says of the problem
        assert trial["value"] == problem([trial["dx"], trial["dy"]])


def test_tokens_are_not_taken_from_the_command_line_in_silence(tmp_path, monkeypatch, capsys):
    from surehold.studies.service import Server

    monkeypatch.setattr(Server, "run", lambda self, application: None)
    assert run(["study", "create", "rig", "--parameters", "x=0:1"]) == 0
    capsys.readouterr()
    assert run(["study", "serve", "rig", "--port", "0", "--token", "0123456789abcdef"]) == 0
    assert "all users of this machine see the token" in capsys.readouterr().err
    monkeypatch.setenv("SUREHOLD_TOKEN", "0123456789abcdef")
    assert run(["study", "serve", "rig", "--port", "0"]) == 0
    assert capsys.readouterr().err == ""
    monkeypatch.delenv("SUREHOLD_TOKEN")
    secret = tmp_path / "secret"
    secret.write_text("0123456789abcdef\n")
    secret.chmod(0o640)
    assert run(["study", "serve", "rig", "--port", "0", "--token-file", str(secret)]) == 2
    assert "mode 640" in capsys.readouterr().err
    secret.chmod(0o600)
    assert run(["study", "serve", "rig", "--port", "0", "--token-file", str(secret)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert "0123456789abcdef" not in captured.out
    assert run(["study", "serve", "rig", "--port", "0", "--token-file", "gone"]) == 2
    assert "cannot be read" in capsys.readouterr().err


def test_texts_that_a_spreadsheet_would_compute(here, capsys):
    create = ["--parameters", "x=-1:1,grip==SUM(A1)|-2|@home", "--noise", "none"]
    assert run(["study", "create", "rig", *create]) == 0
    assert run(["study", "add", "rig", "--at", "x=-0.5,grip==SUM(A1)", "-0.25"]) == 0
    assert run(["study", "add", "rig", "--at", "x=0.5,grip=-2", "0.25"]) == 0
    assert run(["study", "ask", "rig"]) == 0
    assert run(["study", "veto", "rig", "2", "--reason", "=HYPERLINK(1)"]) == 0
    assert run(["study", "export", "rig", "--out", "rig.csv"]) == 0
    text = (here / "rig.csv").read_text()
    assert ",-0.25,-0.5,'=SUM(A1)," in text, "a negative number is a number"
    assert "'=HYPERLINK(1)" in text
    assert run(["study", "create", "again", *create]) == 0
    assert run(["study", "import", "again", "rig.csv"]) == 0
    capsys.readouterr()
    assert run(["study", "export", "again", "--json"]) == 0
    trials = json.loads(capsys.readouterr().out)["trials"]
    assert [t["grip"] for t in trials[:2]] == ["=SUM(A1)", "-2"]


def test_choices_need_no_quotes(capsys):
    """A "|" is a pipe in a shell."""
    assert run(["study", "create", "rig", "--parameters", "x=0:1,grip=pinch/power", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["parameters"]["grip"]["attributes"]["choices"] == ["pinch", "power"]
    assert run(["study", "create", "old", "--parameters", "grip=a/b|c", "--noise", "none", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["parameters"]["grip"]["attributes"]["choices"] == ["a/b", "c"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "create rig --parameters x=0:1 --risk cvar=0.1 --noise none",
            "--risk cvar=0.1 is of executions under input noise",
        ),
        ("create rig --parameters x=0:1,y=0:1:log", "or NAME=this/that"),
        ("work rig --trials 0", "--trials is 0; give 1 or more"),
    ],
)
def test_what_cannot_be_is_said_in_words_of_the_command(line, words, capsys):
    assert run(["study", *line.split()]) == 2
    assert words in " ".join(capsys.readouterr().err.split())


def test_counts_of_successes(study, capsys):
    study("create rig --parameters x=0:1 --outcome success")
    study("ask rig")
    for wrong, why in (("8/7", "8 of 7"), ("-1/3", "successes is -1"), ("x/3", "'x/3' is no count"), ("0.7", "7/10")):
        assert why in study(f"tell rig 0 {wrong}", code=2)
    told = study("tell rig 0 7/10")
    assert told == {"id": 0, "state": "complete", "value": 0.7, "already": False, "of": 10}
    study("add rig 3/4 --at x=0.5")
    assert run(["study", "tell", "rig", "0", "7/10"]) == 0
    assert "trial 0: value 0.7 of 10 executions, as told before" in capsys.readouterr().out
    assert run(["study", "export", "rig"]) == 0
    header, first, second = capsys.readouterr().out.splitlines()
    assert header.startswith("id,state,value,of,x,")
    assert first.startswith("0,complete,0.7,10,")
    assert second.startswith("1,complete,0.75,4,0.5,")
    study("add rig 200/200 --at x=0.6")
    sure = study("recommend rig")["sure"]
    assert 0.0 < sure["0.99"] < sure["0.9"] < 1.0
    assert run(["study", "recommend", "rig"]) == 0
    expected = "% of executions succeed; 95% sure of at least"
    told = capsys.readouterr().out
    assert expected in told
    assert f"{sure['0.9']:.0%} sure of at least 90%" in told


def test_an_output_that_could_not_be_measured(study):
    study("create press --parameters x=0:1 --constraint force<=0.5")
    study("ask press")
    assert "(--constraints force=VALUE)" in study("tell press 0 0.3", code=2)
    assert "force=none" in study("tell press 0 0.3 --constraints force=much", code=2)
    study("tell press 0 0.3 --constraints force=none")
    study("add press 0.2 --at x=0.4 --constraints force=0.1")
    assert study("recommend press")["trial"] == 1


def test_an_answer_that_nobody_can_hear_is_an_error_in_words(study, monkeypatch, capsys):
    study(CREATE)
    capsys.readouterr()
    with monkeypatch.context() as closed:
        closed.setattr(sys, "stdout", None)  # as Python starts with >&-
        for line in ("ask mug", "status mug --json", "export mug"):
            assert run(["study", *line.split()]) == 1
            assert "the answer cannot be written (the standard output is closed)" in capsys.readouterr().err
    assert study("status mug")["running"] == 1, "what was stored before is kept"

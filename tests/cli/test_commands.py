import json
import os
import re
import signal
import subprocess
import sys

import pytest
import yaml

from surehold.cli import run
from surehold.optimization import assembly
from surehold.optimization.success import SUCCESS_SURROGATES
from surehold.optimization.surrogates.named import SURROGATES
from surehold.reports import files

OWN = """
import os, signal
calls = 0

def hill(x):
    return 1.0 - float(((x - 0.3) ** 2).sum())

def needle(x):
    if x[0] > 0.7:
        raise RuntimeError("the gripper\\nslipped")
    return float(x[0])

def hopeless(x):
    raise ValueError("no robot here")

def stopped(x):
    global calls
    calls += 1
    if calls == 9:
        os.kill(os.getpid(), signal.SIGINT)
    return float(-x[0])

def terminated(x):
    global calls
    calls += 1
    if calls == 9:
        os.kill(os.getpid(), signal.SIGTERM)
    return float(-x[0])

def ended_later(x):
    global calls
    calls += 1
    if calls == 14:
        os.kill(os.getpid(), signal.SIGKILL)
    return 1.0 - float((x[0] - 0.3) ** 2)

def near_the_edge(x):
    if x[0] > 0.5:
        raise RuntimeError("over the edge")
    return float(x[0])

def stopped_at_once(x):
    os.kill(os.getpid(), signal.SIGINT)
    return 0.0

def wanders(x):
    os.makedirs("work", exist_ok=True)
    os.chdir("work")
    return -x[0]
"""


def surehold(line):
    return run(line.split())


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("maximize rkh", "did you mean 'rkhs'"),
        ("maximize rkhs --method bu", "choose one of: ubo, bo"),
        ("maximize rkhs --initial 60", "--initial is 60, but --trials is 50"),
        ("maximize rkhs --trials 0", "--trials is 0"),
        ("maximize rkhs --seed -1", "seed is -1"),
        ("maximize rkhs --noise -0.1", "-0.1"),
        ("maximize rkhs --noise nan", "nan"),
        ("maximize rkhs --noise lots", "is not a number"),
        ("maximize rkhs --noise none", "needs input noise"),
        ("maximize rkhs --risk cvarr", "did you mean 'cvar'"),
        ("maximize rkhs --risk cvar=2", "strictly between 0 and 1"),
        ("maximize rkhs --risk cvar --method bo", "which method 'bo' does not know"),
        ("maximize rkhs --risk cvar --preset thesis", "leave one out"),
        ("maximize own.py:hill --bounds a=0:1 --risk cvar --outcome success", "--risk cvar is of values"),
        ("grasp mug --risk cvarr", "did you mean 'cvar'"),
        ("grasp mug --risk cvar --outcome held", "--risk cvar is of values"),
        ("maximize gm --noise x1=0.1", "says nothing about x2"),
        ("maximize gm --noise x1=0.1,y=0.1", "'y' is unknown"),
        ("maximize gm --bounds a=0:1", "has its own bounds"),
        ("maximize rkhs --out own.py", "cannot be written"),
        ("maximize rkhs --preset thesi", "did you mean 'thesis'"),
        ("maximize own.py:hill", "--bounds are missing"),
        ("maximize own.py:hill --bounds a=1:0", "smaller"),
        ("maximize own.py:hill --bounds a=0:inf", "finite"),
        ("maximize own.py --bounds a=0:1", "say which of its functions, behind a colon, for example 'own.py:quality'"),
        ("study create rig --problem own.py", "problem 'own.py' is a file"),
        ("maximize own.py:hil --bounds a=0:1", "did you mean 'hill'"),
        ("maximize gone.py:hill --bounds a=0:1", "does not exist"),
        ("maximize rkhs --colour red", "--colour"),
        ("maximize rkhs --study=", "option --study is given an empty text; give a value, or leave the option out"),
        ("maximize rkhs --feasible 0", "feasible is 0.0; give a probability"),
        ("maximize", "Missing argument 'problem'"),
        ("maximise rkhs", "'maximise'. Did you mean 'maximize', 'minimize'? See surehold --help."),
        ("grasp mugg", "did you mean 'mug'"),
        ("grasp mug --facet rihgt-front", "did you mean 'right"),
        ("grasp mug --facet right-left", "right-front"),
        ("grasp mug --variables dx,dq", "'dq' is unknown"),
        ("grasp mug --variables dx,dx", "each once"),
        ("grasp mug --contact hard", "choose one of"),
        ("grasp mug --quality best", "choose one of"),
        ("grasp mug --initial 101", "--initial is 101"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, message, capsys):
    assert surehold(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith("error: ")
    assert message in captured.err


def test_a_variable_of_the_shell_that_is_not_set_is_no_value(here, capsys):
    """The run went on, and was kept in no study."""
    assert run(["maximize", "rkhs", "--trials", "5", "--study", ""]) == 2
    assert capsys.readouterr().err == (
        "error: option --study is given an empty text; give a value, or leave the option out.\n"
    )
    assert not (here / "runs").exists()


def test_an_own_function_from_start_to_report(here, capsys):
    line = "maximize own.py:hill --bounds a=0:1,b=0:1 --trials 14 --initial 8 --noise 0.05 --seed 3 --out results"
    assert surehold(line) == 0
    out = capsys.readouterr().out
    assert "recommended" in out
    assert "results/report.html" in out
    data = json.loads((here / "results" / "result.json").read_text())
    assert len(data["trials"]["y"]) == 14
    assert data["seed"] == 3
    assert data["settings"]["method"] == "ubo"
    assert len(data["candidates"][-1]["requeries"]["values"]) == 100
    first = {p.name: p.read_bytes() for p in (here / "results").rglob("*") if p.is_file()}
    assert surehold(line) == 0
    again = {p.name: p.read_bytes() for p in (here / "results").rglob("*") if p.is_file()}
    assert first == again, "the same run writes the same files"


def test_plain_method_is_scored_under_the_noise_too(here, capsys):
    assert surehold("maximize rkhs --method bo --trials 10 --seed 1 --preset thesis-rkhs") == 0
    data = json.loads((here / "runs" / "rkhs-bo-seed1" / "result.json").read_text())
    assert data["robust"] is None
    assert len(data["candidates"][0]["requeries"]["values"]) == 100
    capsys.readouterr()


def test_without_re_queries_the_model_is_asked(here, capsys):
    line = "maximize own.py:hill --bounds a=0:1,b=0:1 --trials 12 --initial 8 --noise 0.05 --requeries 0 --out out"
    assert surehold(line) == 0
    assert "the model expects" in " ".join(capsys.readouterr().out.split())
    data = json.loads((here / "out" / "result.json").read_text())
    assert all(candidate["predicted_mean"] is not None for candidate in data["candidates"])


def test_re_queries_that_fail_are_no_merit(here, capsys):
    line = "maximize own.py:near_the_edge --bounds x=0:1 --trials 14 --initial 6 --noise 0.03 --method bo --out out"
    assert surehold(f"{line} --tolerate-failures") == 0
    said = " ".join(capsys.readouterr().out.split())
    failed = json.loads((here / "out" / "result.json").read_text())["candidates"][-1]["requeries"]["failed"]
    assert failed > 10
    assert f"no value at worst when the input is off. {failed} of 100 re-queries" in said


def test_a_run_that_is_killed_while_it_is_queried_again_is_kept(here):
    command = "maximize own.py:ended_later --bounds x=0:1 --trials 12 --initial 6 --noise 0.03 --out out"
    code = f"from surehold.cli import run; run({command.split()!r})"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, cwd=here, check=False)
    assert ended.returncode == -signal.SIGKILL
    data = json.loads((here / "out" / "result.json").read_text())
    assert len(data["trials"]["y"]) == 12
    assert data["candidates"][-1]["predicted_mean"] is not None


def test_no_noise_at_all(here, capsys):
    assert surehold("maximize gf --method bo --noise none --trials 22") == 0
    data = json.loads((here / "runs" / "gf-bo-seed0" / "result.json").read_text())
    assert data["candidates"][0]["requeries"]["values"] == []
    assert "No re-queries" in (here / "runs" / "gf-bo-seed0" / "report.html").read_text(encoding="utf-8")
    capsys.readouterr()


def test_a_run_is_judged_by_the_risk_measure_it_was_asked_for(here, capsys):
    line = "maximize rkhs --trials 9 --initial 7 --noise 0.03 --out out --requeries 40"
    assert surehold(f"{line} --risk cvar=0.2 --study s") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "asked for is the mean of the worst 20 %" in told
    assert "mean of the worst 20 % of them" in told
    data = json.loads((here / "out" / "result.json").read_text())
    assert data["settings"]["risk"] == "cvar=0.2"
    answer = data["candidates"][-1]
    assert answer["worth"] == pytest.approx(sum(sorted(answer["requeries"]["values"])[:8]) / 8)
    assert data["robust"][-1] == answer["predicted_worth"]
    assert surehold("study recommend s --json") == 0
    stored = json.loads(capsys.readouterr().out)
    assert stored["by_risk"] == pytest.approx(answer["predicted_worth"])
    assert stored["risk"] == "mean of the worst 20 %"
    assert surehold("study recommend s") == 0
    assert f"mean of the worst 20 % {answer['predicted_worth']:.4g}" in capsys.readouterr().out


def test_a_published_problem_that_clips_its_inputs_is_modelled_so(here, monkeypatch):
    borders, built = [], assembly.strategy_named

    def strategy_named(*arguments, **settings):
        borders.append(settings["border"])
        return built(*arguments, **settings)

    monkeypatch.setattr(assembly, "strategy_named", strategy_named)
    for words, border in (("nes-polynomial", "clip"), ("nes-polynomial --method bo", "extend"), ("nes-gmm", "extend")):
        borders.clear()
        assert surehold(f"maximize {words} --trials 6 --initial 5 --requeries 0") == 0
        assert set(borders) == {border}


def test_a_published_problem_is_run_under_its_own_risk_measure(here, capsys):
    assert surehold("maximize qing-branin --trials 6 --initial 5 --out out --requeries 10") == 0
    assert "asked for is the mean less 0.5 variances" in " ".join(capsys.readouterr().out.split())
    assert surehold("maximize qing-branin --trials 6 --initial 5 --out out --requeries 10 --risk mean") == 0
    assert "asked for" not in capsys.readouterr().out
    assert surehold("maximize qing-branin --trials 6 --initial 5 --out out --requeries 0 --preset thesis") == 0
    assert "asked for" not in capsys.readouterr().out
    assert surehold("maximize rahbo-sine-1 --noise 0.03 --trials 6 --initial 5 --out out --requeries 0") == 0
    assert "asked for" not in capsys.readouterr().out, "its measure is of noisy observations, not of noisy inputs"


def test_trials_that_raise_are_failures_and_the_run_goes_on(here, capsys):
    assert surehold("maximize own.py:needle --bounds a=0:1 --trials 10 --initial 6 --noise 0.02") == 0
    assert "the gripper" in capsys.readouterr().out
    data = json.loads((here / "runs" / "needle-ubo-seed0" / "result.json").read_text())
    assert None in data["trials"]["y"]


def test_all_trials_failed(capsys):
    line = "maximize own.py:hopeless --bounds a=0:1 --trials 6"
    assert surehold(line) != 0
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "first 3 trials failed" in error
    assert "give --tolerate-failures" in error
    assert surehold(f"{line} --tolerate-failures") == 1
    error = capsys.readouterr().err
    assert "all 6 trials failed" in error
    assert "no robot here" in error


def test_interrupt_keeps_what_was_done(here, capsys):
    assert surehold("maximize own.py:stopped --bounds a=0:1 --trials 30 --initial 6") == 0
    assert "Interrupted after 8 of 30 trials" in capsys.readouterr().out
    folder = here / "runs" / "stopped-ubo-seed0"
    data = json.loads((folder / "result.json").read_text())
    assert data["interrupted"]
    assert len(data["trials"]["y"]) == 8
    assert "was interrupted after 8" in (folder / "report.html").read_text(encoding="utf-8")


def test_sigterm_keeps_what_was_done(here):
    line = "maximize own.py:terminated --bounds a=0:1 --trials 30 --initial 6"
    done = subprocess.run(
        [sys.executable, "-m", "surehold", *line.split()], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    data = json.loads((here / "runs" / "terminated-ubo-seed0" / "result.json").read_text())
    assert data["interrupted"]
    assert len(data["trials"]["y"]) == 8


def test_another_run_gets_another_folder(here, capsys):
    line = "maximize own.py:hill --bounds a=0:1 --trials 8 --initial 6 --method bo --noise none"
    assert surehold(line) == 0
    before = (here / "runs" / "hill-bo-seed0" / "result.json").read_bytes()
    assert surehold(line.replace("a=0:1", "a=0:2")) == 0
    assert surehold(line) == 0
    assert "runs/hill-bo-seed0-3/report.html" in capsys.readouterr().out
    assert (here / "runs" / "hill-bo-seed0" / "result.json").read_bytes() == before
    assert (here / "runs" / "hill-bo-seed0-2" / "result.json").read_bytes() != before
    assert (here / "runs" / "hill-bo-seed0-3" / "result.json").read_bytes() == before


def test_a_function_that_goes_to_another_folder_takes_no_files_along(here, capsys):
    assert surehold("maximize own.py:wanders --bounds a=0:1 --trials 4 --initial 4 --method bo --noise none") == 0
    assert "Report: runs/wanders-bo-seed0/report.html" in capsys.readouterr().out
    written = {path.parent for path in here.rglob("r*.*") if path.name in ("report.html", "result.json")}
    assert written == {here / "runs" / "wanders-bo-seed0"}


def test_a_run_that_gave_nothing_leaves_no_empty_folder(here, capsys):
    assert surehold("maximize own.py:hopeless --bounds a=0:1 --trials 6") != 0
    assert not list((here / "runs").iterdir())
    capsys.readouterr()


def test_interrupt_before_anything(capsys):
    assert surehold("maximize own.py:stopped_at_once --bounds a=0:1") == 130
    assert "interrupted; what was finished before is kept" in capsys.readouterr().err


def test_interrupt_while_writing_waits(here, capsys, monkeypatch):
    write_run = files.write_run

    def interrupted(report, folder):
        signal.raise_signal(signal.SIGINT)
        return write_run(report, folder)

    monkeypatch.setattr(files, "write_run", interrupted)
    assert surehold("maximize own.py:hill --bounds a=0:1 --trials 8 --initial 6") == 0
    assert "Writing what was found" in capsys.readouterr().out
    assert (here / "runs" / "hill-ubo-seed0" / "report.html").is_file()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_short_grasp_run(here, capsys):
    assert surehold("grasp mug --trials 12 --initial 10 --noise 0.03 --out mug") == 0
    out = capsys.readouterr().out
    assert "quality (epsilon)" in out
    assert "palm at" in out
    grasps = yaml.safe_load((here / "mug" / "grasps.yaml").read_text())
    assert grasps["format"] == "isaac_grasp"
    assert "recommended" in grasps["grasps"]
    assert len(grasps["grasps"]["recommended"]["cspace_position"]) == 20
    page = (here / "mug" / "report.html").read_text(encoding="utf-8")
    assert "scene-data" in page
    assert "the hand is off" in page


def test_a_run_without_any_grasp_says_so_first(here, capsys):
    line = "grasp mug --friction 0.001 --contact single --trials 3 --initial 3 --out slippery"
    assert surehold(line) == 3
    out = " ".join(capsys.readouterr().out.split())
    assert "None of 3 trials succeeded" in out
    assert "× not closed" in out
    assert "Try another --facet" in out
    assert "refused" not in out
    assert out.index("None of 3 trials") < out.index("pose")
    page = (here / "slippery" / "report.html").read_text(encoding="utf-8")
    assert '<p class="headline">None of 3 trials succeeded' in page
    assert "No success: the highest trial" in page
    assert "no success: the highest trial" in out
    told = re.sub(r"<script.*?</script>|<style.*?</style>|<dl.*?</dl>", "", page, flags=re.DOTALL)
    assert "ecommended" not in told + out
    assert "Recommended" not in page


def test_doctor_compiles_for_images(capsys, monkeypatch):
    from surehold.optimization import compilation
    from surehold.optimization.surrogates.named import SURROGATES

    told = []
    # The runs themselves are tested beside `compilation`; all of them take two minutes.
    monkeypatch.setattr(compilation, "_compile", lambda key, settings: told.append(settings))
    assert run(["doctor", "--warm"]) == 0
    assert {settings.get("surrogate") for settings in told} >= {None, *SURROGATES}
    assert {settings["input_noise"] for settings in told} == {"", "constant"}
    assert "compiled kernels" in capsys.readouterr().out


def test_doctor_version_and_help(capsys):
    assert run(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "numba" in out
    kept, kernels = map(int, re.search(r"(\d+) of (\d+) are in the cache", out).groups())
    assert kept <= kernels
    assert kernels > 60, "the kernels of all rooms are counted"
    assert "extra grasp" in out
    assert "pip install" not in out, "everything is installed where the tests run"
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.startswith("surehold 0.")
    assert run(["grasp", "--help"]) == 0
    assert "--facet" in capsys.readouterr().out


def test_doctor_says_how_to_install_what_is_missing(capsys, monkeypatch):
    monkeypatch.setattr("surehold.extras.missing", lambda extra: ["libigl"] if extra == "mesh" else [])
    assert run(["doctor"]) == 0
    assert "without libigl: pip install 'surehold[mesh]'" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(("group", "command"), [("", "maximize"), ("campaign", "report"), ("study", "recommend")])
def test_a_group_alone_prints_its_help(group, command, capsys):
    assert surehold(group) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert captured.out.startswith(f"Usage: surehold {group}".rstrip())
    assert any(line.split()[:1] == [command] for line in captured.out.splitlines())


def test_the_module_is_the_command(here):
    done = subprocess.run(
        [sys.executable, "-m", "surehold", "maximize", "nothing"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: problem 'nothing' is unknown")
    assert done.stdout == ""


def test_a_warning_is_one_line_without_the_place_in_the_program(here):
    (here / "loud.py").write_text("import warnings\n\ndef hill(x):\n    warnings.warn('hot')\n    return x[0]\n")
    line = "maximize loud.py:hill --bounds a=0:1 --noise a=3 --trials 1 --requeries 0"
    done = subprocess.run(
        [sys.executable, "-m", "surehold", *line.split()], capture_output=True, text=True, check=True
    ).stderr.splitlines()
    assert done[0].startswith("warning: input noise of a has a standard deviation of 3, 3.0 times the box: ")
    assert done[1].endswith("loud.py:4: UserWarning: hot"), "of a function of theirs users are told where"


def test_a_closed_pipe_does_not_end_the_run(here):
    line = [sys.executable, "-m", "surehold", "maximize", "gf", "--trials", "22", "--out", "piped"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 0
    assert (here / "piped" / "report.html").is_file()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_output_does_not_end_the_run(here):
    line = [sys.executable, "-m", "surehold", "maximize", "gf", "--trials", "22", "--out", "full"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(line, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.stderr.count("\n") == 1, done.stderr
    assert "the output cannot be written (No space left on device)" in done.stderr
    assert done.returncode == 0
    assert (here / "full" / "report.html").is_file()


def test_an_output_that_is_closed_does_not_end_the_run(here, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", None)  # as Python starts with >&-
    assert surehold("maximize own.py:hill --bounds a=0:1 --trials 8 --initial 6 --out closed") == 0
    assert (here / "closed" / "report.html").is_file()
    assert capsys.readouterr().err == ""


def test_output_in_ascii(here):
    line = [sys.executable, "-m", "surehold", "maximize", "gf", "--trials", "22", "--out", "plain"]
    done = subprocess.run(line, capture_output=True, env={**os.environ, "PYTHONIOENCODING": "ascii"}, check=False)
    assert done.returncode == 0, done.stderr
    text = done.stdout.decode("ascii")
    assert "+/-" in text
    assert (here / "plain" / "report.html").is_file()


def test_minimize_answers_in_the_users_sign(here, capsys):
    (here / "cost.py").write_text("def cost(x):\n    return float((x[0] - 0.3) ** 2) + 2.0\n")
    assert surehold("minimize cost.py:cost --bounds x=0:1 --trials 12 --out down") == 0
    printed = capsys.readouterr().out
    assert "Minimize cost" in printed
    assert "lowest" in printed
    assert "highest" not in printed
    data = json.loads((here / "down" / "result.json").read_text())
    assert data["settings"]["direction"] == "minimize"
    assert data["best"][-1] == min(data["trials"]["y"]) < 2.01
    assert abs(data["candidates"][-1]["x"][0] - 0.3) < 0.1


def test_a_study_minimizes(here, capsys):
    assert surehold("study create down --parameters x=0:1 --initial 3 --direction minimize") == 0
    for trial, value in enumerate((3.0, 1.0, 2.0)):
        assert surehold("study ask down") == 0
        assert surehold(f"study tell down {trial} {value}") == 0
    capsys.readouterr()
    assert surehold("study status down") == 0
    assert "lowest value 1 (trial 1)" in capsys.readouterr().out
    assert surehold("study recommend down") == 0
    assert surehold("study create up --parameters x=0:1 --direction sideways") == 2
    assert "maximize" in capsys.readouterr().err


def test_the_surrogate_is_chosen_by_name(here, capsys):
    (here / "rig.py").write_text("def held(x):\n    return bool(0.4 < x[0] < 0.8)\n")
    assert surehold("maximize --help") == 0
    shown = capsys.readouterr().out
    for name in (*SURROGATES, *SUCCESS_SURROGATES):
        assert name in shown, name
    line = "--bounds x=0:1 --noise 0.03 --trials 6 --initial 4"
    assert surehold(f"maximize rig.py:held {line} --surrogate tpg") == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "'tpg' is unknown; did you mean 'tgp'? Choose one of: two_scales, gp, tgp, local_global." in told
    assert surehold(f"maximize rig.py:held {line} --outcome success --surrogate beta") == 2
    assert "hoose one of: probit, beta_process." in " ".join(capsys.readouterr().err.split())
    assert surehold(f"maximize rig.py:held {line} --outcome success --surrogate beta_process --out found") == 0
    found = json.loads((here / "found" / "result.json").read_text())
    assert found["settings"]["surrogate"] == "beta_process"
    assert surehold(f"maximize rig.py:held {line} --outcome success --out probit") == 0
    assert json.loads((here / "probit" / "result.json").read_text())["trials"] != found["trials"]


def test_a_run_of_successes_speaks_of_shares(here, capsys):
    (here / "rig.py").write_text("def held(x):\n    return bool(0.4 < x[0] < 0.8)\n\ndef never(x):\n    return False\n")
    line = "--outcome success --bounds x=0:1 --noise 0.03 --trials 14 --initial 8 --out"
    assert surehold(f"maximize rig.py:held {line} found") == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert re.search(r"expected to succeed in [\d.]+ % of executions; of 100 tried again when the input is off", shown)
    assert "sure that at least 90 % of executions" in shown
    page = (here / "found" / "report.html").read_text()
    for words in ("refused", "highest observed", "hit exactly", "worst of"):
        assert words not in shown, words
        assert words not in page, words
    assert surehold(f"maximize rig.py:never {line} nothing") == 3
    assert "None of 14 trials succeeded." in capsys.readouterr().out

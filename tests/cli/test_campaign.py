import json
import os
import signal
import subprocess
import sys
import time

import pytest

from surehold.campaigns.plan_file import shipped_plans
from surehold.cli import run
from surehold.cli.campaign import duration

PLAN = """
title: A cheap plan
runs: 3
problems:
  hill: {function: gf, trials: 6, initial: 5}
methods:
  random: {optimizer: random}
  GP: {surrogate: gp}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    (tmp_path / "cheap.yaml").write_text(PLAN)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def surehold(line):
    return run(line.split())


def plain(capsys):
    told = capsys.readouterr()
    return " ".join((told.out + told.err).split())


def test_run_continue_report(here, capsys):
    assert surehold("campaign run cheap.yaml --runs 1") == 0
    assert "2 runs in runs/campaigns/cheap" in plain(capsys)
    assert surehold("campaign run cheap.yaml") == 0
    assert "2 of 6 runs are in runs/campaigns/cheap already" in plain(capsys)
    lines = (here / "runs/campaigns/cheap/table.jsonl").read_text().splitlines()
    assert len(lines) == 7
    assert json.loads(lines[0])["plan"] == "cheap"
    assert surehold("campaign report --out here") == 0
    assert "Report: here/campaigns.html" in plain(capsys)
    assert "A cheap plan" in (here / "here/campaigns.html").read_text()
    assert (here / "here/tables/cheap.csv").exists()
    assert surehold("campaign report runs/campaigns/cheap") == 0
    assert (here / "runs/campaigns/campaigns.html").exists()
    assert surehold("campaign report cheap.yaml --out there") == 0, "a plan is named as it was for campaign run"
    assert "A cheap plan" in (here / "there/campaigns.html").read_text()


def test_shares_and_parts(here, capsys):
    assert surehold("campaign run cheap.yaml --shard 2/3 --out share --only GP") == 0
    (line,) = (here / "share/table-2-of-3.jsonl").read_text().splitlines()[1:]
    assert (json.loads(line)["method"], json.loads(line)["seed"]) == ("GP", 1)


def test_failures_are_told(here, capsys):
    (here / "own.py").write_text("def fails(x):\n    raise RuntimeError('no power')\n")
    (here / "cheap.yaml").write_text(
        PLAN.replace("function: gf", "function: 'own.py:fails', arguments: {bounds: 'x=0:1'}")
    )
    assert surehold("campaign run cheap.yaml --runs 1") == 1
    assert "2 runs failed; the first: random on hill, seed 0" in plain(capsys)


@pytest.mark.parametrize(
    ("function", "arguments", "message"),
    [
        ("own.py:ful", "bounds: 'x=0:1'", "did you mean 'fun'"),
        ("own.py:fun", "bounds: 'x=1:0'", "problem 'hill'"),
        ("grasp", "facet: lefft", "facet 'lefft' is unknown"),
    ],
)
def test_a_problem_that_cannot_be_built_is_refused_before_any_run(here, capsys, function, arguments, message):
    (here / "own.py").write_text("def fun(x):\n    return x[0]\n")
    (here / "cheap.yaml").write_text(
        PLAN.replace("function: gf", f"function: '{function}', arguments: {{{arguments}}}")
    )
    assert surehold("campaign run cheap.yaml") == 2
    assert message in plain(capsys)
    assert not (here / "runs").exists()


def test_list_shows_every_plan(capsys):
    assert surehold("campaign list") == 0
    told = plain(capsys)
    for name in shipped_plans():
        assert name in told


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("campaign run table-4.6", "did you mean 'table-4."),
        ("campaign run gone.yaml", "cannot be read"),
        ("campaign run cheap.yaml --runs 0", "runs is 0"),
        ("campaign run cheap.yaml --workers 0", "workers is 0"),
        ("campaign run cheap.yaml --shard 3/2", "shard is 3/2"),
        ("campaign run cheap.yaml --backend dusk", "did you mean 'dask'"),
        ("campaign run cheap.yaml --only hil", "did you mean 'hill'"),
        ("campaign run cheap.yaml --out cheap.yaml", "cannot be written"),
        ("campaign report", "holds no table"),
        ("campaign report gone", "holds no table"),
        ("campaign report gone.yaml", "'runs/campaigns/gone' holds no table of a campaign; run one first"),
        ("campaign rum", "rum"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, message, capsys):
    assert surehold(arguments) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.startswith("error: ")
    assert told.count("\n") == 1


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_keeps_what_is_finished(here, workers):
    (here / "cheap.yaml").write_text(PLAN.replace("runs: 3", "runs: 400"))
    command = [sys.executable, "-m", "surehold", "campaign", "run", "cheap.yaml", "--workers", str(workers)]
    table = here / "runs/campaigns/cheap/table.jsonl"
    told = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 600.0
    while time.monotonic() < deadline and not (table.exists() and table.read_bytes().count(b"\n") > 4):
        time.sleep(0.05)
    os.kill(told.pid, signal.SIGINT)
    out, _ = told.communicate(timeout=600)
    assert told.returncode == 130
    assert "The same command continues" in " ".join(out.split())
    rows = table.read_text().splitlines()
    assert 5 <= len(rows) < 800
    assert all(json.loads(row) for row in rows)


def test_durations():
    assert [duration(s) for s in (None, 0.4, 59.6, 3599.0, 7322.0)] == [
        "?",
        "0 s",
        "1 min 00 s",
        "59 min 59 s",
        "2 h 02 min",
    ]

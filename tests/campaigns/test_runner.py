import gc
import json
import os
import signal
import subprocess
import sys
import time
import tracemalloc
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import replace

import pytest

from surehold.campaigns import runner
from surehold.campaigns.plan import MethodSetup, ProblemSetup, Task
from surehold.campaigns.runner import Progress, checked_backend, run_campaign
from surehold.campaigns.single_run import TIMES
from surehold.campaigns.table import opened, read_folder
from surehold.errors import InputError

OWN = """
import os

def fails(x):
    raise RuntimeError("no power")

def dies(x):
    os._exit(3)

def threads(x):
    from threadpoolctl import threadpool_info
    import numpy
    numpy.linalg.inv(numpy.eye(3))
    return float(max([pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]))
"""


def rows_without_times(folder):
    """All lines of the table in the order of the file, times left out."""
    lines = (folder / "table.jsonl").read_text().splitlines()
    return [{name: value for name, value in json.loads(line).items() if name not in TIMES} for line in lines]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, cheap):
    folder = tmp_path_factory.mktemp("undisturbed")
    run_campaign(cheap, folder)
    return folder


def test_all_runs_are_made_in_order(undisturbed, cheap):
    rows = rows_without_times(undisturbed)[1:]
    assert [(row["problem"], row["method"], row["seed"]) for row in rows] == [
        (task.cell.problem, task.cell.method, task.seed) for task in cheap.tasks()
    ]
    assert {row["status"] for row in rows} == {"done"}


def test_a_second_call_makes_nothing_again(undisturbed, cheap):
    before = (undisturbed / "table.jsonl").read_bytes()
    seen = []
    run_campaign(cheap, undisturbed, observer=lambda progress, row: seen.append(row))
    assert seen == [None]
    assert (undisturbed / "table.jsonl").read_bytes() == before


@pytest.mark.parametrize("workers", [1, 2])
def test_two_kills_and_a_cut_line_leave_no_trace(tmp_path, undisturbed, cheap_text, workers):
    """Kill -9 in mid-campaign, twice, the second time with half a row on the disk: then it is finished."""
    (tmp_path / "cheap.yaml").write_text(cheap_text)
    table = tmp_path / "out" / "table.jsonl"
    command = [sys.executable, "-m", "surehold", "campaign", "run", str(tmp_path / "cheap.yaml"), "--out"]
    command += [str(tmp_path / "out"), "--workers", str(workers)]
    for enough in (3, 8):
        run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        deadline = time.monotonic() + 600.0
        while run.poll() is None and time.monotonic() < deadline:
            if table.exists() and table.read_bytes().count(b"\n") > enough:
                os.killpg(run.pid, signal.SIGKILL)
                break
            time.sleep(0.01)
        assert run.wait(timeout=600) == -signal.SIGKILL, "the campaign ended before it was killed"
    with open(table, "ab") as file:
        file.write(b'{"problem":"hill","method":"BO","se')
    made = read_folder(tmp_path / "out")
    assert 0 < len(made.rows) < 16
    told = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    assert "was dropped" in " ".join(told.stdout.split())
    assert rows_without_times(tmp_path / "out") == rows_without_times(undisturbed)


def test_shares_together_are_the_whole(tmp_path, undisturbed, cheap):
    for i in (1, 2, 3):
        run_campaign(cheap, tmp_path, shard=(i, 3))
    assert len(list(tmp_path.glob("table-*-of-3.jsonl"))) == 3

    def plain(folder):
        rows = read_folder(folder).rows
        return {key: {n: v for n, v in row.items() if n not in TIMES} for key, row in rows.items()}

    assert plain(tmp_path) == plain(undisturbed)


def test_two_workers_make_the_same_table(tmp_path, undisturbed, cheap):
    run_campaign(cheap, tmp_path, workers=2)
    assert rows_without_times(tmp_path) == rows_without_times(undisturbed)


def test_a_local_cluster_of_two_makes_the_same_rows(tmp_path, undisturbed, cheap_text):
    """In a process of its own: cluster libraries leave threads, and warn when they end."""
    (tmp_path / "cheap.yaml").write_text(cheap_text)
    out = tmp_path / "out"
    command = [sys.executable, "-m", "surehold", "campaign", "run", str(tmp_path / "cheap.yaml"), "--runs", "1"]
    command += ["--workers", "2", "--backend", "dask", "--out", str(out)]
    subprocess.run(command, timeout=600, check=True, capture_output=True)
    assert rows_without_times(out)[1:] == rows_without_times(undisturbed)[1:5]


def test_a_failing_run_is_recorded_and_does_not_stop_the_rest(tmp_path, cheap):
    (tmp_path / "own.py").write_text(OWN)
    broken = ProblemSetup(f"{tmp_path}/own.py:fails", 6, 5, {"bounds": "x=0:1"})
    flat = replace(cheap.problems["flat"], trials=6)
    plan = replace(cheap, problems={"broken": broken, "flat": flat}, methods={"random": MethodSetup("random")}, runs=2)
    for workers in (1, 2):
        folder = tmp_path / f"w{workers}"
        counts: list[tuple[int, int]] = []
        records = run_campaign(
            plan, folder, workers=workers, observer=lambda p, row, counts=counts: counts.append((p.done, p.failed))
        )
        assert len(records.done) == len(records.failed) == 2
        assert "all 6 trials failed" in records.failed["broken", "random", 0]["error"]
        assert counts[-1] == (4, 2)
    seen = []
    run_campaign(plan, folder, observer=lambda p, row: seen.append(row))
    assert seen == [None], "a failed run was made again without being asked for"
    run_campaign(plan, folder, retry=True, observer=lambda p, row: seen.append(row))
    assert [row["problem"] for row in seen[2:]] == ["broken", "broken"]
    assert len(read_folder(folder).rows) == 4


def test_a_worker_that_dies_ends_with_a_plain_error_and_keeps_the_rest(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "plan.yaml").write_text(
        "title: t\nruns: 1\nproblems:\n  good: {function: gf, trials: 6, initial: 6}\n"
        f"  bad: {{function: '{tmp_path}/own.py:dies', trials: 6, initial: 6, arguments: {{bounds: 'x=0:1'}}}}\n"
        "methods:\n  random: {optimizer: random}\n"
    )
    command = [sys.executable, "-m", "surehold", "campaign", "run", str(tmp_path / "plan.yaml"), "--workers", "2"]
    told = subprocess.run([*command, "--out", str(tmp_path / "o")], capture_output=True, text=True, timeout=600)
    assert told.returncode == 1
    assert "a worker process died" in " ".join(told.stderr.split())
    read_folder(tmp_path / "o")


@pytest.mark.parametrize("workers", [1, 2])
def test_one_thread_of_linear_algebra_a_worker(tmp_path, cheap, workers):
    (tmp_path / "own.py").write_text(OWN)
    problem = ProblemSetup(f"{tmp_path}/own.py:threads", 6, 6, {"bounds": "x=0:1"})
    plan = replace(cheap, problems={"a": problem}, methods={"m": MethodSetup("random")}, runs=2)
    records = run_campaign(plan, tmp_path / "o", workers=workers)
    assert [row["best"] for row in records.done.values()] == [[[0, 1.0]]] * 2


def test_only_some_cells(tmp_path, cheap):
    records = run_campaign(cheap, tmp_path, runs=1, only=["flat", "BO"])
    assert list(records.rows) == [("flat", "BO", 0)]


def test_the_remaining_time_weighs_runs_by_their_kind():
    progress = Progress(10, 0, 0, workers=2, waiting={("a", "m"): 3, ("b", "m"): 1, ("c", "m"): 1})
    assert progress.remaining_seconds is None
    progress.finish({"problem": "a", "method": "m", "status": "done", "seconds": 2.0})
    progress.learn({"problem": "b", "method": "m", "status": "done", "seconds": 10.0})
    assert progress.remaining_seconds == pytest.approx((2 * 2.0 + 10.0 + 6.0) / 2)


def test_memory_stays_flat(tmp_path, cheap):
    """What a run leaves behind is its row: far less than its model, which would be hundreds of kilobytes."""
    sizes = {}

    def weigh(progress, row):
        if progress.done in (4, 24):
            gc.collect()
            sizes[progress.done] = tracemalloc.get_traced_memory()[0]

    plan = replace(cheap, problems={"hill": cheap.problems["hill"]}, runs=12)
    run_campaign(plan, tmp_path / "warm", runs=1)
    tracemalloc.start()
    try:
        run_campaign(plan, tmp_path / "out", observer=weigh)
    finally:
        tracemalloc.stop()
    assert sizes[24] - sizes[4] < 20 * 20_000, f"{(sizes[24] - sizes[4]) / 20:.0f} bytes stay behind a run"


def test_bad_arguments_are_refused(tmp_path, cheap):
    for arguments in ({"workers": 0}, {"workers": 1.5}, {"runs": 0}, {"shard": (3, 2)}, {"backend": "dusk"}):
        with pytest.raises(InputError):
            run_campaign(cheap, tmp_path, **arguments)
    with pytest.raises(InputError, match="did you mean 'dask'"):
        checked_backend("dusk")
    for settings in ({"criterion": "eii"}, {"risk": "wurst"}, {"surrogate": "tgp", "min_leaf": -1}):
        with pytest.raises(InputError, match="method 'odd'"):
            run_campaign(replace(cheap, methods={"odd": MethodSetup(robust=True, settings=settings)}), tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_locked_folder_is_refused(tmp_path, cheap):
    with opened(tmp_path, cheap), pytest.raises(InputError, match="another process"):
        run_campaign(cheap, tmp_path)


def test_short_runs_travel_together_and_long_ones_alone(monkeypatch):
    """A parcel ends in time, what it has not begun comes back, and every run is made once."""
    clock, sizes = [0.0], []
    seconds = {seed: 0.01 if seed < 60 else 5.0 for seed in range(70)}

    def run(cell, seed):
        clock[0] += seconds[seed]
        return {"seed": seed}

    class Here(Executor):
        def submit(self, function, *arguments):
            future = Future()
            sizes.append(len(arguments[0]))
            future.set_result(function(*arguments))
            return future

    @contextmanager
    def pool(*_):
        yield Here(), lambda: 1

    monkeypatch.setattr(runner, "run_once", run)
    monkeypatch.setattr(runner, "_pool", pool)
    monkeypatch.setattr(runner.time, "monotonic", lambda: clock[0])
    rows = list(runner._spread([Task(None, seed) for seed in seconds], 1, "loky", ""))
    assert sorted(row["seed"] for row in rows) == list(seconds)
    assert max(sizes) > 10, "short runs travelled alone"
    assert sizes[-1] <= 2, "long runs travelled together"


def test_runs_of_another_text_of_the_function_are_not_mixed(tmp_path, cheap, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text("def f(x):\n    return -float((x[0] - 0.3) ** 2)\n")
    own = replace(cheap, problems={"own": ProblemSetup("own.py:f", 6, 5, {"bounds": "x=0:1"}, 0.05)}, runs=1)
    run_campaign(own, tmp_path / "out", only=["BO"])
    (tmp_path / "own.py").write_text("def f(x):\n    return -float((x[0] - 0.9) ** 2)\n")
    with pytest.raises(InputError, match="BO on own with another function_file than the plan"):
        run_campaign(own, tmp_path / "out", runs=2, only=["BO"])


def test_a_parameter_of_a_measure_that_is_not_named_is_refused(tmp_path, cheap):
    share = replace(cheap, methods={"worst share": MethodSetup(robust=True, settings={"alpha": 0.1})})
    with pytest.raises(InputError, match=r"alpha is 0\.1, but no risk is given"):
        run_campaign(share, tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "import os\nos.chdir('lab')\ndef f(x):\n    return -x[0]\n",
        "import os\ndef f(x):\n    os.chdir('/')\n    return -x[0]\n",
    ],
    ids=["when it is loaded", "when it is called"],
)
def test_the_run_after_one_that_has_gone_to_another_folder_finds_its_function(tmp_path, cheap, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab").mkdir()
    (tmp_path / "own.py").write_text(text)
    own = replace(cheap, problems={"own": ProblemSetup("own.py:f", 6, 5, {"bounds": "x=0:1"}, 0.05)}, runs=2)
    run_campaign(own, "out", only=["BO"])
    rows = read_folder(tmp_path / "out").rows.values()  # refuses rows of different settings
    assert [row["status"] for row in rows] == ["done", "done"]

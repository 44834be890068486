"""The stored table of benchmarks: what is written is read again, and a loss is marked. Nothing is timed here.

Rows of runs that stand in the repository are printed by their benchmark without a run, as the pages have them.
"""

import shutil
import sys
from pathlib import Path

import pytest

from benchmarks import smooth_regret, stored, success_outcomes
from benchmarks.regret_causes import cause
from benchmarks.stored import Row

RESULTS = Path(__file__).parents[1] / "results" / "benchmarks"


def test_a_stored_table_is_compared_in_yardsticks(tmp_path):
    assert stored.last(tmp_path) == {}
    path = stored.store([Row("ask", 0.02, asked=0.1), Row("grasp", 0.001)], 1e-4, 1.5, tmp_path)
    assert path.parent == tmp_path
    before = stored.last(tmp_path)
    assert before == {"ask": 200.0, "grasp": 10.0}
    assert stored.read(tmp_path)["rows"]["ask"] == {"seconds": 0.02, "asked": 0.1}
    rows = [Row("ask", 0.03, asked=0.06, floor=0.001), Row("grasp", 0.0021, asked=0.002), Row("more", 1.0)]
    head, ask, grasp, new = stored.lines(rows, 2e-4, before)
    assert "to the last" in head
    assert ask.split()[-3:] == ["0.5", "30", "0.75"], "the machine is half as fast: it is a gain"
    assert grasp.endswith(" 1.05  OVER")
    assert new.endswith("new")
    (_, lost) = stored.lines([Row("ask", 0.03)], 1e-4, before)
    assert lost.endswith("1.50  SLOWER")


@pytest.mark.parametrize(
    ("full", "tried", "climb", "z", "expected"),
    [
        (0.9, 0.9, 0.0, 9.0, "found"),
        (1.5, 0.9, 0.0, 9.0, "answer"),
        (1.5, 1.2, 0.9, 9.0, "climb"),
        (1.5, 1.2, 1.1, 2.9, "search"),
        (1.5, 1.2, 1.1, 3.1, "model"),
    ],
)
def test_the_first_cause_that_is_true_is_that_of_a_regret(full, tried, climb, z, expected):
    assert cause({"full": full, "tried": tried, "climb": climb, "z": z}) == expected


def printed(benchmark, folder, options, tmp_path, monkeypatch, capsys):
    """Return the lines that a benchmark prints of a copy of the rows in a folder, which it must not add to."""
    rows = shutil.copy(RESULTS / folder / "rows.jsonl", tmp_path)
    monkeypatch.setattr(sys, "argv", ["benchmark", "--rows", str(rows), *options.split()])
    benchmark.main()
    assert Path(rows).read_bytes() == (RESULTS / folder / "rows.jsonl").read_bytes()
    return capsys.readouterr().out.splitlines()


def test_kept_runs_of_successes_are_printed_as_published(tmp_path, monkeypatch, capsys):
    options = "--seeds 100 --trials 80 --no-time"
    lines = printed(success_outcomes, "success-outcomes", options, tmp_path, monkeypatch, capsys)
    assert len(lines) == 15
    assert set(lines) <= set((RESULTS / "success-outcomes" / "README.md").read_text(encoding="utf-8").splitlines())


def test_kept_runs_of_other_libraries_are_printed_without_them(tmp_path, monkeypatch, capsys):
    options = "--first-seed 50 --functions branin --methods default optuna-gp botorch --processes 1"
    lines = printed(smooth_regret, "smooth-functions", options, tmp_path, monkeypatch, capsys)
    page = (RESULTS.parents[1] / "docs" / "results" / "smooth-functions.md").read_text(encoding="utf-8")
    half, full = (line for line in page.splitlines() if line.startswith("| Branin"))
    for line in lines[2:]:
        cells = line.split(maxsplit=2)[2]
        for row, part in ((half, cells[:15]), (full, cells[15:30])):
            assert " ".join(part.split()).replace("( ", "(") in row
    monkeypatch.setattr(smooth_regret, "installed_peers", dict)
    with pytest.raises(SystemExit):
        printed(smooth_regret, "smooth-functions", options.replace("50", "49"), tmp_path, monkeypatch, capsys)
    assert "botorch is not installed, and some of its runs have to be made; pip install" in capsys.readouterr().err

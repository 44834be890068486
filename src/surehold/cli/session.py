"""One run from the command line: progress while it goes, re-queries, the files, and the table at the end."""

import re
import time
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from surehold.cli.compilation import announced, warm_up
from surehold.cli.terminal import terminal
from surehold.errors import InputError
from surehold.optimization.input_noise import InputNoise
from surehold.optimization.maximization import Result, Trial, maximize
from surehold.problems.perturbation import robust_score
from surehold.problems.problem import Problem
from surehold.reports import files, gather, page
from surehold.reports.run_report import Candidate, RunReport
from surehold.reports.verdict import number, verdict

__all__ = ["folder_for", "run_session"]

REQUERIES = 100  # perturbed re-queries of a candidate; they score and are no part of the budget


def folder_for(name: str, method: str, seed: int, out: str) -> Path:
    """Return the folder for a run's files, created and writable: `out`, or runs/NAME-METHOD-seedN."""
    slug = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "run"
    return files.checked_folder(out or Path("runs") / f"{slug}-{method}-seed{seed}")


def run_session(
    problem: Problem,
    *,
    title: str,
    method: str,
    noise: InputNoise | None,
    trials: int,
    initial: int,
    seed: int,
    preset: str,
    folder: Path,
    open_report: bool,
    settings: Mapping[str, Any],
    describe: Callable[[Candidate], Candidate] = lambda candidate: candidate,
    also_write: Callable[[RunReport, Path], None] = lambda report, folder: None,
    units: Mapping[str, str] | None = None,
    quality_name: str = "value",
    disturbance: str = "the input is off",
    console: Console | None = None,
) -> RunReport:
    """Maximize, score, write and show; Ctrl-C keeps what was done.

    `describe` adds to a candidate what the problem knows of it; `also_write` writes further files.

    Raises
    ------
    InputError
        For bad settings.
    SureholdError
        If every trial failed.
    KeyboardInterrupt
        If Ctrl-C comes before any trial has given a value.
    """
    console = console or terminal()
    for name, count in (("trials", trials), ("initial", initial)):
        if count < 1:
            raise InputError(f"--{name} is {count}; give 1 or more.")
    if initial > trials:
        raise InputError(
            f"--initial is {initial}, but --trials is {trials}; give at least as many trials as initial ones."
        )
    options: dict[str, Any] = {
        "input_noise": noise if method == "ubo" else None,
        "n_initial": initial,
        "seed": seed,
        "preset": preset or None,
    }
    if noise is not None:
        noise.unit_covariance(problem.box)  # names and sizes are checked before anything runs
    console.print(f"[bold]{_plain(title)}[/bold]: {trials} trials ({initial} initial), method {method}, seed {seed}")
    started = time.perf_counter()
    with announced(console):
        warm_up(problem, options)
    result = _with_progress(problem, trials, options, console)
    if result.interrupted:
        console.print(f"Interrupted after {len(result.y)} of {trials} trials; keeping what was done.")
    notes = _failures(result)
    candidates = []
    for label, index in gather.answers(result).items():
        score = None
        if noise is not None:
            try:
                score = robust_score(problem, result.X[index], noise, n=REQUERIES, seed=seed)
            except KeyboardInterrupt:
                notes = [*notes, f"The re-queries of the {label} point were interrupted and left out."]
        candidates.append(describe(gather.candidate(result, label, index, score)))
    report = gather.report_of(
        result,
        candidates,
        title=title,
        settings={**settings, "method": method, "trials": trials, "initial trials": initial, "preset": preset or None},
        noise=noise,
        units=units,
        quality_name=quality_name,
        disturbance=disturbance,
        planned_trials=trials,
        notes=notes,
    )
    path = files.write_run(report, folder)
    also_write(report, folder)
    _show(report, path, time.perf_counter() - started, console)
    if open_report:
        webbrowser.open(path.resolve().as_uri())
    return report


def _with_progress(problem: Problem, trials: int, options: dict[str, Any], console: Console) -> Result:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("highest [bold]{task.fields[best]}[/bold]"),
        TextColumn("{task.fields[robust]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=not console.is_terminal) as progress:
        task = progress.add_task("initial design", total=trials, best="–", robust="")

        def show(trial: Trial) -> None:
            told = trial.recommendation
            robust = "" if told is None or options["input_noise"] is None else f"recommended {number(told.mean)}"
            phase = "initial design" if trial.index + 1 < options["n_initial"] else "optimizing"
            progress.update(task, advance=1, description=phase, best=number(trial.best), robust=robust)
            if not console.is_terminal and (trial.index + 1) % 10 == 0:
                console.print(f"trial {trial.index + 1} of {trials}: highest {number(trial.best)} {robust}".rstrip())

        return maximize(problem, problem.box, trials, callback=show, **options)


def _failures(result: Result) -> list[str]:
    failed = [trial for trial in result.trials if trial.failure]
    if not failed:
        return []
    first = failed[0]
    return [f"{len(failed)} of {len(result.y)} trials failed; the first, trial {first.index + 1}: {first.failure}"]


def _show(report: RunReport, path: Path, seconds: float, console: Console) -> None:
    table = Table(title=None, show_edge=False, pad_edge=False, header_style="bold")
    table.add_column("")
    for candidate in report.candidates:
        alone = len(report.candidates) == 1
        table.add_column("highest observed = recommended" if alone else candidate.label, overflow="fold")
    for name, cells in page.table_rows(report):
        table.add_row(_plain(name), *(_plain(cell) for cell in cells))
    console.print()
    console.print(table)
    console.print()
    console.print(_plain(verdict(report).headline))
    for note in report.notes:
        console.print(f"Note: {_plain(note)}")
    failed = int(np.sum(report.failed))
    rest = f", {failed} failed" if failed else ""
    console.print(f"{report.y.size} trials{rest} in {seconds:.1f} s. Report: {_plain(str(path))}", soft_wrap=True)


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)

"""One run from the command line: progress while it goes, re-queries, the files, and the table at the end."""

import os
import time
import webbrowser
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from surehold.amounts import amount
from surehold.cli.compilation import announced, warm_up
from surehold.cli.folders import folder_of, removed_on_error
from surehold.cli.interruption import terminable, undisturbed
from surehold.cli.options import METHODS, REQUERIES, lasting
from surehold.cli.requeries import requeried
from surehold.cli.terminal import terminal
from surehold.errors import InputError, SureholdError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.maximization import Result, Trial, maximize
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.perturbation import RobustScore
from surehold.problems.problem import Problem
from surehold.reports import files, gather, page
from surehold.reports.run_report import Candidate, RunReport, Surface
from surehold.reports.verdict import verdict
from surehold.reports.wording import number
from surehold.store.atomic import checked_folder
from surehold.store.leftovers import listed_writes

__all__ = ["NO_SUCCESS", "Kept", "folder_for", "run_session"]

NO_SUCCESS = 3  # exit code of a run whose trials all gave a value, none of which is a success

_MOST_TRIALS = 100_000  # a model of more is out of reach


@dataclass(frozen=True)
class Kept:
    """Where a run is kept as a study, and what workers on other machines need to know of it."""

    study: str = ""
    """name; empty for a run that is not kept"""
    storage: str = ""
    """URL, see `surehold.studies.storage`; empty for SUREHOLD_STORAGE, or the journal of the study"""
    problem: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.storage and not self.study:
            raise InputError(f"--storage {self.storage} is given, but no --study; name the study to keep there.")
        if self.study:
            lasting(self.url)

    @property
    def url(self) -> str:
        """Of the storage; empty for the journal of the study."""
        return self.storage or os.environ.get("SUREHOLD_STORAGE", "")


def folder_for(name: str, method: str, seed: int, out: str, study: str = "") -> Path:
    """Return the folder for a run's files, created and writable: `out`, runs/STUDY, or a new one in runs/."""
    if study and not out:
        from surehold.studies.storage import checked_name

        return checked_folder(Path("runs") / checked_name(study))
    return folder_of(out, f"{name[:100]}-{method}-seed{seed}")


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
    quality_name: str = "",
    disturbance: str = "the input is off",
    tolerate_failures: bool = False,
    direction: str = "maximize",
    outcome: str = "value",
    success_above: float | None = None,
    outcomes: Callable[[Result], Mapping[str, int]] = lambda result: {},
    advice: str = "",
    kept: Kept | None = None,
    required: Mapping[str, Any] | None = None,
    risk: Risk | None = None,
    requeries: int = REQUERIES,
    console: Console | None = None,
) -> RunReport:
    """Optimize, score, write and show; Ctrl-C and SIGTERM keep what was done.

    A run that is kept as a study is resumed where that exists.

    `required` are further settings of an `Optimizer`: surrogate, and those of constraints and failures. `risk` is what
    is asked of the outcome under the noise, by default its mean. `requeries` are those of each point that is shown,
    with the noise.

    `describe` adds to a candidate what the problem knows of it; `also_write` writes further files. Where no trial is
    worth more than `success_above`, the report says so first, with the counts of `outcomes` and `advice`; what the
    caller returns then is `NO_SUCCESS` as exit code.

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
    started = time.perf_counter()
    place = folder.absolute()  # a function may go to another folder
    with terminable() as ended, removed_on_error(folder):
        for name, count, least in (("trials", trials, 1), ("initial", initial, 1), ("requeries", requeries, 0)):
            if count < least:
                raise InputError(f"--{name} is {count}; give {least} or more.")
            if count > _MOST_TRIALS:
                raise InputError(f"--{name} is {count}; give {_MOST_TRIALS:,} at most.")
        if initial > trials:
            raise InputError(
                f"--initial is {initial}, but --trials is {trials}; give at least as many trials as initial ones."
            )
        risk = risk or Risk()
        options: dict[str, Any] = {
            "input_noise": noise if method == "ubo" else None,
            "n_initial": initial,
            "seed": seed,
            "preset": preset or None,
            "direction": direction,
            **(required or {}),
        }
        if outcome != "value":
            options["outcome"] = outcome
        if risk.name != "mean":
            options["risk"] = risk
        if noise is not None:
            noise.unit_covariance(problem.box)  # names and sizes are checked before anything runs
        measure = f"; asked for is the {risk.words(direction == 'minimize')}" * (risk.name != "mean")
        console.print(
            f"[bold]{_plain(title)}[/bold]: {amount(trials, 'trial')} ({initial} initial), seed {seed}; "
            f"method {method} {METHODS[method]}{measure}"
        )
        with announced(console):
            warm_up(problem, options, console)
        if kept is None or not kept.study:
            try:
                result = _with_progress(problem, trials, options, tolerate_failures, console)
            except SureholdError as error:  # which names the option as Python spells it
                raise type(error)(
                    str(error).replace("say tolerate_failures=True", "give --tolerate-failures")
                ) from None
        else:
            result = _as_study(kept, problem, trials, options, units or {}, console)
        if result.interrupted:
            console.print(f"Interrupted after {len(result.y)} of {amount(trials, 'trial')}; keeping what was done.")

        def reported(
            scores: Mapping[tuple[str, int], RobustScore | None],
            missing: list[str],
            surfaces: tuple[Surface, ...] | None = None,
        ) -> RunReport:
            return gather.report_of(
                result,
                [describe(gather.candidate(result, label, i, score)) for (label, i), score in scores.items()],
                title=title,
                settings={
                    **settings,
                    "method": method,
                    "direction": direction,
                    "trials": trials,
                    "initial trials": initial,
                    "preset": preset or None,
                    "study": kept.study if kept and kept.study else None,
                },
                noise=noise,
                units=units,
                quality_name=quality_name,
                disturbance=disturbance,
                planned_trials=trials,
                notes=[*_failures(result), *missing],
                success_above=success_above,
                outcomes={} if _any_above(result, success_above) else outcomes(result),
                advice=advice,
                surfaces=surfaces,
            )

        shown = gather.answers(result).items()
        asked = None if ended or not requeries else noise
        unasked = ["The run was ended from outside; nothing was queried again."]
        with undisturbed(console):
            report = reported(dict.fromkeys(shown), unasked * bool(ended and requeries and noise is not None))
            if asked is not None:  # what follows may take as long as the trials did
                files.write_result(report, place)
        scores: dict[tuple[str, int], RobustScore | None] = {}
        missing: list[str] = []
        if asked is not None:
            scores, missing = requeried(problem, result, asked, requeries, seed, shown, console)
        with undisturbed(console):
            if scores:
                report = reported(scores, missing, report.surfaces)
            with listed_writes(place, replacing=True) as removed:
                path = files.write_run(report, place)
                also_write(report, place)
    _show(report, folder / path.name, time.perf_counter() - started, console)
    if removed:
        more = ", ..." * (len(removed) > 3)
        console.print(
            f"Removed what an earlier run had left there: {amount(len(removed), 'file')} "
            f"({', '.join(removed[:3])}{more}).",
            markup=False,
            soft_wrap=True,
        )
    if open_report:
        webbrowser.open(path.resolve().as_uri())
    return report


def _with_progress(
    problem: Problem, trials: int, options: dict[str, Any], tolerate_failures: bool, console: Console
) -> Result:
    with _progress(trials, options, console) as show:

        def told(trial: Trial) -> None:
            robust = None if trial.recommendation is None else trial.recommendation.worth
            show(trial.index + 1, trial.best, robust)

        function = getattr(problem, "trial", problem)
        return maximize(function, problem.box, trials, callback=told, tolerate_failures=tolerate_failures, **options)


def _as_study(
    kept: Kept, problem: Problem, trials: int, options: dict[str, Any], units: Mapping[str, str], console: Console
) -> Result:
    """Make the trials that a stored study lacks."""
    from optuna import logging

    from surehold.studies.replay import result_of
    from surehold.studies.robot import RobotStudy
    from surehold.studies.search_space import SearchSpace
    from surehold.studies.settings import StudySettings
    from surehold.studies.stop_rule import StopRule
    from surehold.studies.trial_function import trial_function
    from surehold.studies.worker import work

    logging.set_verbosity(logging.WARNING)
    others = ("input_noise", "direction")
    optimizer = {name: value for name, value in options.items() if name not in others and value is not None}
    space = SearchSpace(problem.box)
    settings = StudySettings(space, options["input_noise"], units, optimizer, kept.problem, options["direction"])
    study = RobotStudy.create(kept.study, settings, kept.url, resume=True)
    if study.paused is not None:
        raise InputError(f"study '{study.name}' is paused ({study.paused}); resume it with: surehold study resume.")
    done = sum(trial.state.is_finished() for trial in study.trials())
    if done:
        console.print(f"Resuming study {study.name}: {done} trial{'s are' if done > 1 else ' is'} done.", markup=False)
    study.set_stop_rule(StopRule(trials=trials))
    interrupted = False
    best = min if options["direction"] == "minimize" else max
    with _progress(trials, options, console) as show:

        def told(*_: Any) -> None:
            finished = [t for t in study.trials() if t.state.is_finished()]
            values = [t.values[0] for t in finished if t.values]
            modelled = values and len(finished) >= options["n_initial"]
            robust = study.recommend(write=False).worth if modelled else None
            show(len(finished), best(values, default=np.nan), robust)

        try:
            work(study, trial_function(getattr(problem, "trial", problem), space), after=told)
        except KeyboardInterrupt:
            interrupted = True
    if not any(t.values for t in study.trials()):
        if interrupted:
            raise KeyboardInterrupt
        raise SureholdError(f"all {len(study.trials())} trials of study '{study.name}' failed.")
    study.recommend()
    return result_of(study, interrupted)


@contextmanager
def _progress(
    trials: int, options: dict[str, Any], console: Console
) -> Iterator[Callable[[int, float, float | None], None]]:
    """Show progress; yields what is told (trials done, best value, value of the recommendation)."""
    extreme = "lowest" if options["direction"] == "minimize" else "highest"
    counted = options.get("outcome") == "success"  # of which the highest says nothing
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        *([] if counted else [TextColumn(f"{extreme} [bold]{{task.fields[best]}}[/bold]")]),
        TextColumn("{task.fields[robust]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=not console.is_terminal) as progress:
        task = progress.add_task("initial design", total=trials, best="–", robust="")

        def show(done: int, best: float, recommended: float | None) -> None:
            robust = (
                "" if recommended is None or options["input_noise"] is None else f"recommended {number(recommended)}"
            )
            phase = "initial design" if done < options["n_initial"] else "optimizing"
            progress.update(task, completed=done, description=phase, best=number(best), robust=robust)
            if not console.is_terminal and done % 10 == 0:
                best_so_far = "" if counted else f"{extreme} {number(best)} "
                console.print(f"{done} of {amount(trials, 'trial')}: {best_so_far}{robust}".rstrip())

        yield show


def _failures(result: Result) -> list[str]:
    failed = [trial for trial in result.trials if trial.failure]
    if not failed:
        return []
    first = failed[0]
    return [
        f"{len(failed)} of {amount(len(result.y), 'trial')} failed; the first, trial {first.index}: {first.failure}"
    ]


def _show(report: RunReport, path: Path, seconds: float, console: Console) -> None:
    table = Table(title=None, show_edge=False, pad_edge=False, header_style="bold")
    table.add_column("")
    for candidate in report.candidates:
        table.add_column(report.called(candidate), overflow="fold")
    for name, cells in page.table_rows(report):
        table.add_row(_plain(name), *(_plain(cell) for cell in cells))
    told = verdict(report)
    if not report.succeeded:
        console.print(f"\n[bold]{_plain(told.headline)}[/bold] {_plain(told.text)}")
    console.print()
    console.print(table)
    console.print()
    if report.succeeded:
        console.print(_plain(told.headline))
    for note in report.notes:
        console.print(f"Note: {_plain(note)}")
    failed = int(np.sum(report.failed))
    rest = f", {failed} failed" if failed else ""
    console.print(
        f"{amount(report.y.size, 'trial')}{rest} in {seconds:.1f} s. Report: {_plain(str(path))}", soft_wrap=True
    )


def _any_above(result: Result, limit: float | None) -> bool:
    return limit is None or bool(np.nanmax(result.y) > limit)


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)

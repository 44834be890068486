"""Pictures and the page of a result, for those who work in Python."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from surehold.extras import require
from surehold.optimization.maximization import Result
from surehold.problems.function import Function
from surehold.problems.perturbation import RobustScore, robust_score
from surehold.reports import figures, files, gather
from surehold.reports.run_report import Candidate, RunReport

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot", "result_report", "write_report"]

_REQUERIES: Final = 100


def plot(result: Result, function: Callable[[Any], float] | None = None) -> "Figure":
    """Return one picture of a run: the model, its average over the input noise, and what happens when the input is off.

    Parameters
    ----------
    function
        What was optimized, to be queried 100 times around the best observed and around the recommended input. By
        default the model's expectation stands for it, and there are no histograms.

    Raises
    ------
    MissingExtra
        If matplotlib is not installed.
    """
    require("report", "plot")
    return figures.overview(result_report(result, function))


def write_report(
    result: Result, folder: str | Path, function: Callable[[Any], float] | None = None, *, title: str = "Optimization"
) -> Path:
    """Write report.html, result.json and the figures of a run into a folder, and return the path of the page.

    `function` as in `plot`. Raises InputError if the folder cannot be written, MissingExtra without matplotlib.
    """
    require("report", "write_report")
    return files.write_run(replace(result_report(result, function), title=title), folder)


def result_report(result: Result, function: Callable[[Any], float] | None = None) -> RunReport:
    """Return the report of a result, as plain data; see `plot`."""
    optimizer = result.optimizer
    box, noise = optimizer.box, optimizer.input_noise
    disturbed = [*["the input is off"] * (noise is not None), *["conditions differ"] * (box.uncontrolled is not None)]
    candidates: list[Candidate] = []
    scores: dict[tuple[str, int], RobustScore | None] = {}
    for label, index in gather.answers(result).items():
        score = None
        if function is not None and disturbed:
            problem = Function(function if box.plain else lambda x: function(box.as_dict(x)), box)
            score = robust_score(problem, result.X[index], noise, _REQUERIES, optimizer.seed)
        scores[label, index] = score
        candidates.append(gather.candidate(result, label, index, score))
    plain = [box.as_dict(x) for x in result.X]
    texts = [variable.name for variable in box.variables if variable.name not in box.names]
    units = {v.name: "log" for v in box.variables if v.name in box.names and getattr(v, "log", False)}
    return gather.report_of(
        result,
        candidates,
        title="Optimization",
        settings={"direction": optimizer.direction, "trials": len(result.y)},
        noise=noise,
        disturbance=" and ".join(disturbed) or "the input is off",
        units=units,
        notes=gather.kept_in_box(scores, result),
        choices={name: tuple(str(row[name]) for row in plain) for name in texts},
        hidden=[name for name in box.names if name not in [variable.name for variable in box.variables]],
    )

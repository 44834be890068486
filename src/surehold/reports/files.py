"""The files of a run: report.html, result.json and the figures, each written whole or not at all."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from surehold.reports import figures, page
from surehold.reports.run_report import Candidate, RunReport
from surehold.store.atomic import checked_folder, write_file

__all__ = ["result_data", "write_result", "write_run"]


def write_run(report: RunReport, folder: str | Path) -> Path:
    """Write report.html, result.json and figures/*.svg, *.png into the folder; return the path of the page.

    Raises
    ------
    InputError
        If the folder cannot be written, or a scene of the report is malformed.
    """
    path = checked_folder(folder)
    pictures = checked_folder(path / "figures")
    write_result(report, path)
    drawn = figures.figures(report)
    drawings = {name: figures.svg_text(figure, name) for name, figure in drawn.items()}
    write_file(path / "report.html", page.render(report, drawings))
    for name, figure in drawn.items():
        write_file(pictures / f"{name}.svg", figures.on_white(drawings[name]))
        write_file(pictures / f"{name}.png", figures.png_bytes(figure))
    return path / "report.html"


def write_result(report: RunReport, folder: str | Path) -> None:
    """Write result.json alone; raises InputError if the folder cannot be written."""
    text = json.dumps(result_data(report), indent=2, allow_nan=False) + "\n"
    write_file(checked_folder(folder) / "result.json", text)


def result_data(report: RunReport) -> dict[str, Any]:
    """Return the run as JSON-ready data; missing numbers are null.

    `parameters` are the inputs by name, in the user's units; `x` and all that belongs to it, the noise included, are
    coordinates of the variables: the same numbers, but for a logarithmic one the logarithm, and without the choices.
    """
    from surehold import __version__

    return _plain(
        {
            "format": "surehold run 1",
            "surehold": __version__,
            "title": report.title,
            "seed": report.seed,
            "settings": dict(report.settings),
            "interrupted": report.interrupted,
            "planned_trials": report.planned_trials,
            "variables": [
                {"name": v.name, "lower": v.lower, "upper": v.upper, "unit": v.unit} for v in report.variables
            ],
            "input_noise_covariance": report.noise,
            "quality": report.quality_name,
            "n_initial": report.n_initial,
            "trials": {
                "number": report.numbers,
                "x": report.X,
                "y": report.y,
                "parameters": report.parameters,
                "outputs": dict(report.outputs),
                "feasible": ~report.failed if report.feasible is None else report.feasible,
            },
            "best": report.best_trace,
            "robust": report.robust_trace,
            "candidates": [_candidate(report, c) for c in report.candidates],
        }
    )


def _candidate(report: RunReport, candidate: Candidate) -> dict[str, Any]:
    return {
        "label": candidate.label,
        "x": candidate.x,
        "parameters": report.parameters[candidate.trial] if report.parameters and candidate.trial is not None else None,
        "trial": None if candidate.trial is None else report.numbers[candidate.trial],
        "quality": candidate.quality,
        "mean": candidate.mean,
        "worth": candidate.worth,
        "worst": candidate.worst,
        "std": candidate.std,
        "requeries": {"points": candidate.points, "values": candidate.values, "failed": candidate.n_failed},
        "predicted_mean": candidate.predicted_mean,
        "predicted_std": candidate.predicted_std,
        "predicted_worth": candidate.predicted_worth,
        "status": candidate.status,
        "pose": candidate.pose,
        "details": dict(candidate.details),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)

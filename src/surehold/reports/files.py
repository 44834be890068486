"""The files of a run: report.html, result.json and the figures, each written whole or not at all."""

import itertools
import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from surehold.errors import InputError
from surehold.reports import figures, page
from surehold.reports.run_report import Candidate, RunReport

__all__ = ["checked_folder", "new_folder", "result_data", "write_file", "write_run"]


def checked_folder(folder: str | Path) -> Path:
    """Create the folder if needed and return its path, after a trial write.

    Raises
    ------
    InputError
        If it cannot be created or written, or a file stands in its place.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise _unwritable(path, error) from None
    return path


def new_folder(folder: str | Path) -> Path:
    """Create a folder that did not exist and return its path: FOLDER, or the first that is free of FOLDER-2, ...

    Raises
    ------
    InputError
        If it cannot be created or written.
    """
    path = Path(folder)
    checked_folder(path.parent)
    for number in itertools.count(1):
        new = path if number == 1 else path.with_name(f"{path.name}-{number}")
        try:
            new.mkdir()
            return checked_folder(new)
        except FileExistsError:
            continue
        except OSError as error:
            raise _unwritable(new, error) from None
    raise AssertionError("counting does not end")


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file whole: under a temporary name beside it, then renamed over what was there.

    Raises
    ------
    InputError
        If the file cannot be written; what was there before stays.
    """
    raw = content.encode("utf-8") if isinstance(content, str) else content
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(raw)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)  # mkstemp makes files that only their owner reads
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise InputError(
            f"file '{path}' cannot be written ({error.strerror or error}); free the place or choose another."
        ) from None


def write_run(report: RunReport, folder: str | Path) -> Path:
    """Write report.html, result.json and figures/*.svg, *.png into the folder; return the path of the page.

    Raises
    ------
    InputError
        If the folder cannot be written, or a scene of the report is malformed.
    """
    path = checked_folder(folder)
    pictures = checked_folder(path / "figures")
    write_file(path / "result.json", json.dumps(result_data(report), indent=2, allow_nan=False) + "\n")
    drawn = figures.figures(report)
    drawings = {name: figures.svg_text(figure, name) for name, figure in drawn.items()}
    write_file(path / "report.html", page.render(report, drawings))
    for name, figure in drawn.items():
        write_file(pictures / f"{name}.svg", figures.on_white(drawings[name]))
        write_file(pictures / f"{name}.png", figures.png_bytes(figure))
    return path / "report.html"


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"output folder '{path}' cannot be written ({error.strerror or error}); choose another (--out).")


def result_data(report: RunReport) -> dict[str, Any]:
    """Return the run as JSON-ready data in the units of the box; missing numbers are null."""
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
            "trials": {"x": report.X, "y": report.y},
            "best": report.best_trace,
            "robust": report.robust_trace,
            "candidates": [_candidate(c) for c in report.candidates],
        }
    )


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "label": candidate.label,
        "x": candidate.x,
        "trial": candidate.trial,
        "quality": candidate.quality,
        "mean": candidate.mean,
        "worst": candidate.worst,
        "std": candidate.std,
        "requeries": {"points": candidate.points, "values": candidate.values, "failed": candidate.n_failed},
        "predicted_mean": candidate.predicted_mean,
        "predicted_std": candidate.predicted_std,
        "status": candidate.status,
        "pose": candidate.pose,
        "details": dict(candidate.details),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
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

"""The trials of a run as rows of a table."""

from typing import Any

import numpy as np

from surehold.reports.run_report import RunReport
from surehold.reports.wording import coordinate, number, worth

__all__ = ["trial_rows"]


def trial_rows(report: RunReport) -> list[dict[str, Any]]:
    """Return what is said of each trial of a run: number, place, choices, value, further outputs, and a note."""
    rows = []
    for i, (x, y) in enumerate(zip(report.X, report.y, strict=True)):
        notes, style = (["initial"] if i < report.n_initial else []), ""
        if report.observed.trial == i and not report.counted:
            notes.append(f"{report.extreme} observed")
            style = "best"
        if report.recommended.trial == i:
            notes.append("recommended" if report.succeeded else "shown")
            style = "chosen"
        failed = not np.isfinite(y)
        if report.feasible is not None and not failed and not report.feasible[i]:
            notes.append("not feasible")
        rows.append(
            {
                "number": int(report.numbers[i]),
                "x": [coordinate(v, value, 4) for v, value in zip(report.variables, x, strict=True)],
                "choices": [texts[i] for texts in report.choices.values()],
                "y": "failed" if failed else worth(report, float(y), 4),
                "outputs": [_output(values[i]) for values in report.outputs.values()],
                "note": ", ".join(notes),
                "style": style,
            }
        )
    return rows


def _output(value: Any) -> str:
    if value is None:
        return "–"
    plain = isinstance(value, bool | np.bool_ | str)
    try:
        return str(value) if plain else number(float(value), 4)
    except (TypeError, ValueError):  # what a function returns besides may be anything
        return str(value)

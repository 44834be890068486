"""Plots of one run as plotly.js draws them: plain data, made from the run's report."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.reports.run_report import RunReport, Surface

__all__ = ["interactive_plots"]

_HIGHEST, _ANSWER, _TRIAL = "#d1495b", "#2a7f62", "#5b6573"


def interactive_plots(report: RunReport) -> dict[str, str]:
    """Return plots by name as JSON {data, layout}: progress, the model, and its average over the input noise."""
    plots = {"surehold-1-progress": _progress(report)}
    for surface in report.surfaces[:1]:  # a person can zoom into it
        if len(surface.variables) == 1:
            plots["surehold-2-model"] = _line(report, surface)
            continue
        plots["surehold-2-model"] = _map(
            report, surface, surface.mean, "Model: expected value where the input is exact"
        )
        if surface.robust_mean is not None:
            title = "Model averaged over the input noise"
            plots["surehold-3-under-noise"] = _map(report, surface, surface.robust_mean, title)
    return {name: json.dumps(plot, allow_nan=False) for name, plot in plots.items()}


def _progress(report: RunReport) -> dict[str, Any]:
    number = report.numbers
    data = [
        _points(number, report.y, "trial", {"color": _TRIAL, "size": 6}),
        _curve(number, report.best_trace, f"{report.extreme} observed", _HIGHEST, shape="hv"),
    ]
    if report.robust_trace is not None:
        known = np.isfinite(report.robust_trace)
        data.append(
            _curve(
                number[known], report.robust_trace[known], f"recommended, {report.expected_name}", _ANSWER, shape="hv"
            )
        )
    return _plot(f"{report.extreme.capitalize()} observed and robust value", data, "trial", report.axis_name)


def _line(report: RunReport, surface: Surface) -> dict[str, Any]:
    variable = report.variables[surface.variables[0]]
    grid = variable.shown(surface.axes[0])
    data = [_curve(grid, surface.mean, "model", _TRIAL)]
    if surface.std is not None:
        band = np.concatenate([surface.mean + 2.0 * surface.std, (surface.mean - 2.0 * surface.std)[::-1]])
        shade = {"fill": "toself", "line": {"width": 0}, "fillcolor": "rgba(91,101,115,0.18)", "hoverinfo": "skip"}
        around = np.concatenate([grid, grid[::-1]])
        data.insert(0, _curve(around, band, "± 2 standard deviations", _TRIAL) | shade)
    if surface.robust_mean is not None:
        data.append(_curve(grid, surface.robust_mean, "averaged over the input noise", _ANSWER))
    column = variable.shown(report.X[:, surface.variables[0]])
    data.append(_points(column, report.y, "trials", {"color": _TRIAL, "size": 6}))
    for x, y, name, color in _candidates(report):
        spot = variable.shown(x[surface.variables[0] : surface.variables[0] + 1])
        data.append(_points(spot, y, name, _mark(color)))
    return _plot("Model" + _aside(surface), data, variable.label, report.axis_name, log=(variable.log, False))


def _map(report: RunReport, surface: Surface, values: NDArray[np.floating], title: str) -> dict[str, Any]:
    first, second = (report.variables[k] for k in surface.variables)
    across, up = (v.shown(axis) for axis, v in zip(surface.axes, (first, second), strict=True))
    data: list[dict[str, Any]] = [
        {
            "type": "heatmap",
            "x": _numbers(across),
            "y": _numbers(up),
            "z": [_numbers(row) for row in values.T],
            "colorscale": "Viridis",
            "colorbar": {"title": {"text": report.axis_name}},
        }
    ]
    a, b = surface.variables
    marker = {"color": "white", "size": 5, "line": {"color": "black", "width": 1}}
    data.append(_points(first.shown(report.X[:, a]), second.shown(report.X[:, b]), "trials", marker))
    for x, _, name, color in _candidates(report):
        spot = first.shown(x[a : a + 1]), second.shown(x[b : b + 1])
        data.append(_points(*spot, name, _mark(color)))
    return _plot(title + _aside(surface), data, first.label, second.label, log=(first.log, second.log))


def _aside(surface: Surface) -> str:
    return f" ({surface.note})" if surface.note else ""


def _candidates(report: RunReport) -> list[tuple[NDArray[np.floating], NDArray[np.floating], str, str]]:
    found = [(report.recommended, "recommended", _ANSWER)]
    if report.observed is not report.recommended:
        found.insert(0, (report.observed, f"{report.extreme} observed", _HIGHEST))
    return [(c.x, np.array([c.quality]), name, color) for c, name, color in found]


def _mark(color: str) -> dict[str, Any]:
    return {"color": color, "size": 14, "symbol": "star", "line": {"color": "white", "width": 1}}


def _points(x: NDArray[Any], y: NDArray[Any], name: str, marker: dict[str, Any]) -> dict[str, Any]:
    return {"type": "scatter", "mode": "markers", "x": _numbers(x), "y": _numbers(y), "name": name, "marker": marker}


def _curve(x: NDArray[Any], y: NDArray[Any], name: str, color: str, shape: str = "linear") -> dict[str, Any]:
    line = {"color": color, "shape": shape}
    return {"type": "scatter", "mode": "lines", "x": _numbers(x), "y": _numbers(y), "name": name, "line": line}


def _plot(
    title: str, data: list[dict[str, Any]], across: str, up: str, log: tuple[bool, bool] = (False, False)
) -> dict[str, Any]:
    layout = {
        "title": {"text": title, "x": 0.02, "font": {"size": 14}},  # beside the buttons at the right
        "xaxis": {"title": {"text": across}} | ({"type": "log"} if log[0] else {}),
        "yaxis": {"title": {"text": up}} | ({"type": "log"} if log[1] else {}),
        "modebar": {"remove": ["select2d", "lasso2d", "zoomIn2d", "zoomOut2d", "autoScale2d"]},
        "margin": {"t": 56, "r": 24, "b": 60 + 19 * len(data)},  # the names below each other, where it is narrow
        "legend": {"orientation": "h", "yref": "container", "y": 0.0, "yanchor": "bottom"},
    }
    return {"data": data, "layout": layout}


def _numbers(values: NDArray[Any]) -> list[float | None]:
    """Return five significant digits of each: what a screen can show."""
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in np.asarray(values, dtype=np.float64)]

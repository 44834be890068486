"""Figures of one run with matplotlib's object-oriented interface: what shaking does, the model, and the progress.

Every color comes from `PALETTE`; in a page the same figure follows light and dark mode, because `inline_svg` replaces
these colors by CSS variables of the same names.
"""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from surehold.reports.drawing import PALETTE, draw_line, draw_map, draw_shake, draw_trace, style
from surehold.reports.run_report import Candidate, RunReport, Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "figures",
    "inline_svg",
    "on_white",
    "overview",
    "png_bytes",
    "shake",
    "shake_name",
    "surface",
    "surface_names",
    "svg_text",
    "trace",
]


def figures(report: RunReport) -> dict[str, "Figure"]:
    """Return every figure of the run by name: trace, shake_*, surface_*, and the overview."""
    drawn = {"trace": trace(report)}
    for candidate in report.candidates:
        if candidate.values.size:
            drawn[shake_name(candidate)] = shake(report, candidate)
    for i, view in enumerate(report.surfaces):
        for robust, name in surface_names(report, i).items():
            drawn[name] = surface(report, view, robust)
    drawn["overview"] = overview(report)
    return drawn


def shake_name(candidate: Candidate) -> str:
    """Return the name of a candidate's histogram among the figures."""
    return f"shake_{candidate.label.replace(' ', '_')}"


def surface_names(report: RunReport, index: int) -> dict[bool, str]:
    """Return the names of the figures of a surface: of the model, and (True) of its average over the input noise."""
    view = report.surfaces[index]
    end = "_close" if index else ""
    if len(view.variables) == 1:
        return {False: f"surface{end}"}  # one figure shows both lines
    names = {False: f"surface_mean{end}"}
    return names if view.robust_mean is None else names | {True: f"surface_averaged{end}"}


def shake(report: RunReport, candidate: Candidate) -> "Figure":
    """Return the histogram of a candidate's re-queries, on the axes that all candidates share."""
    with style("shake"):
        figure, axes = _figure(4.5, 1.7)
        draw_shake(axes, report, candidate)
    return figure


def surface(report: RunReport, view: Surface, robust: bool) -> "Figure":
    """Return the model over one or two variables with the trials on it; `robust`: averaged over the input noise."""
    with style("surface"):
        figure, axes = _figure(4.5, 3.9) if len(view.variables) == 2 else _figure(5.6, 3.3)
        if len(view.variables) == 2:
            draw_map(axes, report, view, robust)
        else:
            draw_line(axes, report, view)
    return figure


def trace(report: RunReport) -> "Figure":
    """Return best and robust value by trial, over the values of the single trials."""
    with style("trace"):
        figure, axes = _figure(5.2, 3.0)
        draw_trace(axes, report)
    return figure


def overview(report: RunReport) -> "Figure":
    """Return one picture of the whole run: the model, its average under the noise, and what shaking does."""
    from matplotlib.figure import Figure

    shaken = [c for c in report.candidates if c.values.size]
    with style("overview"):
        view = report.surfaces[0] if report.surfaces else None
        maps: list[Callable[[Axes], None]] = []
        if view is not None and len(view.variables) == 1:
            maps = [lambda axes: draw_line(axes, report, view)]
        elif view is not None:
            maps = [lambda axes: draw_map(axes, report, view, False)]
            if view.robust_mean is not None:
                maps.append(lambda axes: draw_map(axes, report, view, True))
        rows = (1 if maps else 0) + (1 if shaken else 0)
        if rows == 0:
            figure = Figure(figsize=(6.4, 3.2), layout="constrained", facecolor="white")
            draw_trace(figure.add_subplot(), report)
            return figure
        figure = Figure(figsize=(10.0, 4.2 * bool(maps) + 1.9 * bool(shaken)), layout="constrained", facecolor="white")
        ratios = [4.2, 1.9] if rows == 2 else [1.0]
        parts = figure.subfigures(rows, 1, height_ratios=ratios, hspace=0.04, squeeze=False)[:, 0]
        for part in parts:
            part.set_facecolor("none")
        if maps:
            for axes, draw in zip(np.ravel(parts[0].subplots(1, len(maps), squeeze=False)), maps, strict=True):
                draw(axes)
        if shaken:
            for axes, candidate in zip(
                np.ravel(parts[-1].subplots(1, len(shaken), squeeze=False)), shaken, strict=True
            ):
                draw_shake(axes, report, candidate)
                axes.set_title(
                    f"{candidate.label.capitalize()}: {candidate.values.size} re-queries when {report.disturbance}"
                )
    return figure


def svg_text(figure: "Figure", name: str) -> str:
    """Return the figure as an SVG document without background, the same bytes every time."""
    with style(name):
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
        figure.set_layout_engine("none")  # the layout is found; a second search, for the PNG, would take as long again
    return buffer.getvalue()


def on_white(text: str) -> str:
    """Return an SVG document with a white background, so that it can stand alone."""
    start = text.index(">", text.index("<svg")) + 1
    return f'{text[:start]}\n <rect width="100%" height="100%" fill="#ffffff"/>{text[start:]}'


def png_bytes(figure: "Figure") -> bytes:
    """Return the figure as PNG on white, 160 dots an inch, the same bytes every time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    with style("png"):
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=160, facecolor="white", metadata={"Software": None})
    return buffer.getvalue()


def inline_svg(text: str, name: str, description: str, hover: Mapping[str, Sequence[str]] | None = None) -> str:
    """Return an SVG document as an `<svg>` element for a page: as wide as its place, its colors CSS variables.

    `name` keeps its identifiers apart from those of the other figures of the page. `hover` are texts of the marks of
    groups, by the group's identifier.
    """
    from markupsafe import escape

    text = text[text.index("<svg") :]
    for group, texts in (hover or {}).items():
        text = _titled(text, group, texts)
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    for css, color in PALETTE.items():
        text = text.replace(color, f"var(--{css})")
    return text.replace("<svg", f'<svg role="img" aria-label="{escape(description)}"', 1)


def _titled(text: str, group: str, titles: Sequence[str]) -> str:
    """Return an SVG document in which each mark of a group has a title, which browsers show beside the pointer."""
    from markupsafe import escape

    start = text.find(f'<g id="{group}">')
    if start < 0 or not titles:  # Matplotlib 3.10 draws one mark, out of sight, for a group that has none
        return text
    start = max(start, text.find("</defs>", start, text.find("<g id=", start + 1)))
    end = text.find("<g id=", start + 1) if "<g id=" in text[start + 1 :] else len(text)
    left = iter(titles)
    marks = re.sub(
        r"<(use|path)\b([^>]*)/>",
        lambda found: f"<{found[1]}{found[2]}><title>{escape(next(left))}</title></{found[1]}>",
        text[start:end],
    )
    return text[:start] + marks + text[end:]


def _figure(width: float, height: float) -> tuple["Figure", "Axes"]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.add_subplot()

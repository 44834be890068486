"""Figures of one run with matplotlib's object-oriented interface: what shaking does, the model, and the progress.

Every color comes from `PALETTE`; in a page the same figure follows light and dark mode, because `inline_svg` replaces
these colors by CSS variables of the same names.
"""

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from surehold.reports.run_report import Candidate, RunReport, Surface
from surehold.reports.verdict import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "PALETTE",
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

#: Okabe and Ito's vermilion and blue (told apart by color-blind readers), darkened for contrast on white.
PALETTE: Final = {"ink": "#1b1f25", "muted": "#68707b", "grid": "#d8dce2", "high": "#c24e00", "answer": "#0a65b3"}
_MARKERS: Final = {"high": "^", "answer": "o"}
_STYLE: Final = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    "text.color": PALETTE["ink"],
    "text.parse_math": False,  # a user's "$" is a "$"
    "axes.edgecolor": PALETTE["muted"],
    "axes.labelcolor": PALETTE["ink"],
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "xtick.color": PALETTE["muted"],
    "ytick.color": PALETTE["muted"],
    "xtick.labelcolor": PALETTE["ink"],
    "ytick.labelcolor": PALETTE["ink"],
    "grid.color": PALETTE["grid"],
    "legend.frameon": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "svg.fonttype": "none",  # text stays text: small, searchable, in the reader's font
}


@contextmanager
def _style(salt: str) -> Iterator[None]:
    import matplotlib

    style: dict[Any, Any] = {**_STYLE, "svg.hashsalt": salt}
    with matplotlib.rc_context(style):
        yield


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
    end = f"_{index + 1}" if len(report.surfaces) > 1 else ""
    if len(view.variables) == 1:
        return {False: f"surface{end}"}  # one figure shows both lines
    names = {False: f"surface_mean{end}"}
    return names if view.robust_mean is None else names | {True: f"surface_unscented{end}"}


def shake(report: RunReport, candidate: Candidate) -> "Figure":
    """Return the histogram of a candidate's re-queries, on the axes that all candidates share."""
    with _style("shake"):
        figure, axes = _figure(4.5, 1.7)
        _draw_shake(axes, report, candidate)
    return figure


def surface(report: RunReport, view: Surface, robust: bool) -> "Figure":
    """Return the model over one or two variables with the trials on it; `robust`: averaged over the input noise."""
    with _style("surface"):
        figure, axes = _figure(4.5, 3.9) if len(view.variables) == 2 else _figure(5.6, 3.3)
        if len(view.variables) == 2:
            _draw_map(axes, report, view, robust)
        else:
            _draw_line(axes, report, view)
    return figure


def trace(report: RunReport) -> "Figure":
    """Return best and robust value by trial, over the values of the single trials."""
    with _style("trace"):
        figure, axes = _figure(5.2, 3.0)
        _draw_trace(axes, report)
    return figure


def overview(report: RunReport) -> "Figure":
    """Return one picture of the whole run: the model, its average under the noise, and what shaking does."""
    from matplotlib.figure import Figure

    shaken = [c for c in report.candidates if c.values.size]
    with _style("overview"):
        view = report.surfaces[0] if report.surfaces else None
        maps: list[Callable[[Axes], None]] = []
        if view is not None and len(view.variables) == 1:
            maps = [lambda axes: _draw_line(axes, report, view)]
        elif view is not None:
            maps = [lambda axes: _draw_map(axes, report, view, False)]
            if view.robust_mean is not None:
                maps.append(lambda axes: _draw_map(axes, report, view, True))
        rows = (1 if maps else 0) + (1 if shaken else 0)
        if rows == 0:
            figure = Figure(figsize=(6.4, 3.2), layout="constrained", facecolor="white")
            _draw_trace(figure.add_subplot(), report)
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
                _draw_shake(axes, report, candidate)
                axes.set_title(
                    f"{candidate.label.capitalize()}: {candidate.values.size} re-queries when {report.disturbance}"
                )
    return figure


def svg_text(figure: "Figure", name: str) -> str:
    """Return the figure as an SVG document without background, the same bytes every time."""
    with _style(name):
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
    with _style("png"):
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=160, facecolor="white", metadata={"Software": None})
    return buffer.getvalue()


def inline_svg(text: str, name: str, description: str) -> str:
    """Return an SVG document as an `<svg>` element for a page: as wide as its place, its colors CSS variables.

    `name` keeps its identifiers apart from those of the other figures of the page.
    """
    from markupsafe import escape

    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    for css, color in PALETTE.items():
        text = text.replace(color, f"var(--{css})")
    return text.replace("<svg", f'<svg role="img" aria-label="{escape(description)}"', 1)


def _figure(width: float, height: float) -> tuple["Figure", "Axes"]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.add_subplot()


def _role(report: RunReport, candidate: Candidate) -> str:
    return "high" if candidate is report.highest and len(report.candidates) > 1 else "answer"


def _draw_shake(axes: "Axes", report: RunReport, candidate: Candidate) -> None:
    from matplotlib.ticker import MaxNLocator

    everything = np.concatenate([np.append(c.values, c.quality) for c in report.candidates])
    everything = everything[np.isfinite(everything)]
    low, high = float(everything.min()), float(everything.max())
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    color = PALETTE[_role(report, candidate)]
    edges = np.linspace(low - margin, high + margin, 28)
    tallest = max(np.histogram(c.values, edges)[0].max() for c in report.candidates)
    counts, _ = np.histogram(candidate.values, edges)
    axes.bar(edges[:-1], counts, np.diff(edges), align="edge", color=color, alpha=0.75, linewidth=0)
    axes.axvline(candidate.quality, color=PALETTE["ink"], linestyle=(0, (4, 2)), linewidth=1.2)
    axes.plot(candidate.mean, 0, marker="D", color=color, markeredgecolor=PALETTE["ink"], clip_on=False, zorder=5)
    right = candidate.quality > 0.6 * high + 0.4 * low
    axes.annotate(
        "hit exactly",
        (candidate.quality, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(-4 if right else 4, 0),
        textcoords="offset points",
        ha="right" if right else "left",
        va="top",
        fontsize=8.5,
    )
    axes.set_xlim(edges[0], edges[-1])
    axes.set_ylim(0.0, 1.18 * tallest)
    axes.set_xlabel(f"{report.quality_name} (◆ mean {number(candidate.mean)})")
    axes.set_ylabel("re-queries")
    axes.yaxis.set_major_locator(MaxNLocator(nbins=3, integer=True))


def _draw_map(axes: "Axes", report: RunReport, view: Surface, robust: bool) -> None:
    values = view.robust_mean if robust and view.robust_mean is not None else view.mean
    both = [v for v in (view.mean, view.robust_mean) if v is not None]
    low, high = min(float(v.min()) for v in both), max(float(v.max()) for v in both)
    i, j = view.variables
    first, second = report.variables[i], report.variables[j]
    a, b = view.axes[0] * first.factor, view.axes[1] * second.factor
    extent = (_edge(a, 0), _edge(a, -1), _edge(b, 0), _edge(b, -1))
    image = axes.imshow(
        values.T,
        origin="lower",
        extent=extent,
        aspect="auto",
        cmap="viridis",
        vmin=low,
        vmax=high,
        interpolation="bicubic",
    )
    if high > low:
        axes.contour(
            a,
            b,
            values.T,
            levels=np.linspace(low, high, 9)[1:-1],
            colors="white",
            linewidths=0.5,
            linestyles="solid",
            alpha=0.4,
        )
    sliced = len(report.variables) > 2
    X = report.X[:, [i, j]] * [first.factor, second.factor]
    initial = np.arange(report.y.size) < report.n_initial
    ok = ~report.failed
    alpha = 0.45 if sliced else 0.95
    axes.scatter(*X[ok & initial].T, s=15, facecolors="none", edgecolors="white", linewidths=1.0, alpha=alpha)
    axes.scatter(*X[ok & ~initial].T, s=11, c="white", edgecolors="black", linewidths=0.4, alpha=alpha)
    axes.scatter(*X[~ok].T, s=18, c="white", marker="x", linewidths=1.0, alpha=alpha)
    for candidate in report.candidates:
        _draw_candidate(axes, report, candidate, (i, j))
    axes.set(xlabel=first.label, ylabel=second.label, xlim=extent[:2], ylim=extent[2:])
    axes.set_title("Unscented mean (over the input noise)" if robust else "Model mean (input hit exactly)")
    bar = axes.figure.colorbar(image, ax=axes, fraction=0.05, pad=0.02, aspect=25)
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    bar.set_label(report.quality_name)


def _draw_candidate(axes: "Axes", report: RunReport, candidate: Candidate, pair: tuple[int, int]) -> None:
    from matplotlib.patches import Ellipse

    role = _role(report, candidate)
    scale = np.array([report.variables[k].factor for k in pair])
    center = candidate.x[list(pair)] * scale
    if report.noise is not None:
        covariance = report.noise[np.ix_(pair, pair)] * np.outer(scale, scale)
        values, vectors = np.linalg.eigh(covariance)
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        width, height = 4.0 * np.sqrt(np.maximum(values[::-1], 0.0))  # two standard deviations to each side
        for line, color in ((2.6, "white"), (1.4, PALETTE[role])):
            axes.add_patch(
                Ellipse(
                    tuple(center), width, height, angle=angle, fill=False, edgecolor=color, linewidth=line, zorder=4
                )
            )
    axes.plot(
        *center,
        marker=_MARKERS[role],
        color=PALETTE[role],
        markersize=9,
        markeredgecolor="white",
        markeredgewidth=1.4,
        zorder=6,
    )


def _draw_line(axes: "Axes", report: RunReport, view: Surface) -> None:
    (i,) = view.variables
    variable = report.variables[i]
    t = view.axes[0] * variable.factor
    if view.std is not None:
        axes.fill_between(
            t, view.mean - 2 * view.std, view.mean + 2 * view.std, color=PALETTE["muted"], alpha=0.22, linewidth=0
        )
    axes.plot(t, view.mean, color=PALETTE["ink"], linewidth=1.2, label="model (mean ± 2 standard deviations)")
    if view.robust_mean is not None:
        axes.plot(t, view.robust_mean, color=PALETTE["answer"], linewidth=2.0, label="averaged over the input noise")
    ok = ~report.failed
    axes.plot(
        report.X[ok, i] * variable.factor, report.y[ok], "o", color=PALETTE["muted"], markersize=3.5, label="trials"
    )
    for candidate in report.candidates:
        role = _role(report, candidate)
        spread = 0.0 if report.noise is None else 2.0 * float(np.sqrt(report.noise[i, i])) * variable.factor
        axes.errorbar(
            candidate.x[i] * variable.factor,
            candidate.quality,
            xerr=spread or None,
            fmt=_MARKERS[role],
            color=PALETTE[role],
            markersize=9,
            markeredgecolor="white",
            ecolor=PALETTE[role],
            elinewidth=1.8,
            zorder=6,
            label=candidate.label,
        )
    everything = np.concatenate([view.mean, report.y[ok]])
    margin = 0.25 * (everything.max() - everything.min()) or 1.0
    axes.set(xlabel=variable.label, ylabel=report.quality_name, xlim=(t[0], t[-1]))
    axes.set_ylim(everything.min() - margin, everything.max() + margin)
    axes.legend(fontsize=8, loc="best")
    axes.set_title("Model and trials")


def _draw_trace(axes: "Axes", report: RunReport) -> None:
    k = np.arange(1, report.y.size + 1)
    axes.plot(k, report.y, "o", color=PALETTE["muted"], markersize=2.8, alpha=0.7, label="trial")
    failed = report.failed
    if failed.any():
        floor = float(np.nanmin(report.y)) if (~failed).any() else 0.0
        axes.plot(
            k[failed], np.full(failed.sum(), floor), "x", color=PALETTE["muted"], markersize=5, label="failed trial"
        )
    axes.step(k, report.best_trace, where="post", color=PALETTE["high"], linewidth=1.8, label="highest value so far")
    if report.robust_trace is not None and np.isfinite(report.robust_trace).any():
        axes.plot(
            k,
            report.robust_trace,
            color=PALETTE["answer"],
            linewidth=1.8,
            label="recommended: expected under the noise",
        )
    if 0 < report.n_initial < report.y.size:
        axes.axvspan(0.5, report.n_initial + 0.5, color=PALETTE["grid"], alpha=0.45, linewidth=0, zorder=0)
        axes.annotate(
            "initial design",
            (report.n_initial / 2 + 0.5, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, -3),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=8.5,
            color=PALETTE["muted"],
        )
    axes.margins(y=0.12)
    axes.set(xlabel="trial", ylabel=report.quality_name, xlim=(0.5, max(report.y.size + 0.5, 1.6)))
    axes.grid(axis="y", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.figure.legend(loc="outside upper left", ncols=2, fontsize=8.5, borderaxespad=0.2)  # pyright: ignore[reportAttributeAccessIssue]


def _edge(ticks: np.ndarray, end: int) -> float:
    """Return the outer border of the first or last cell of a regular grid."""
    half = 0.5 * (ticks[1] - ticks[0])
    return float(ticks[0] - half if end == 0 else ticks[-1] + half)

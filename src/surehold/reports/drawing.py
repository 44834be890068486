"""What the figures draw into their axes: histograms, maps, lines and traces, in one style and one palette."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from surehold.reports.run_report import Candidate, RunReport, Surface
from surehold.reports.scales import set_scale
from surehold.reports.wording import worth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["PALETTE", "draw_line", "draw_map", "draw_shake", "draw_trace", "marked", "style"]

#: Okabe and Ito's vermilion and blue (told apart by color-blind readers), darkened for contrast on white.
PALETTE: Final = {"ink": "#1b1f25", "muted": "#68707b", "grid": "#d8dce2", "high": "#c24e00", "answer": "#0a65b3"}
_SHARES: Final = (-0.05, 1.05)  # limits of an axis of shares, with room for marks at 0 and 1
_ROUND: Final = 121  # points of an ellipse
_FLAT: Final = 1e-9  # share of the values below which a map has one
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
def style(salt: str) -> Iterator[None]:
    """Set matplotlib's style for the block; `salt` makes the identifiers in an SVG the same every time."""
    import matplotlib

    settings: dict[Any, Any] = {**_STYLE, "svg.hashsalt": salt}
    with matplotlib.rc_context(settings):
        yield


def _role(report: RunReport, candidate: Candidate) -> str:
    return "high" if candidate is report.observed and len(report.candidates) > 1 else "answer"


def marked(report: RunReport, view: Surface | None = None) -> dict[str, np.ndarray]:
    """Return which trials (n,) the marks of a figure stand for, in their order, by the identifier of their group.

    Of the trials that lie within the view, if it is a figure of one.
    """
    inside, initial = np.ones(report.y.size, dtype=bool), np.arange(report.y.size) < report.n_initial
    if view is not None:
        for variable, axis in zip(view.variables, view.axes, strict=True):
            inside &= (report.X[:, variable] >= axis[0]) & (report.X[:, variable] <= axis[-1])
    ok, told = inside & ~report.lost, inside & ~report.failed
    return {
        "trials-initial": ok & initial,
        "trials-later": ok & ~initial,
        "trials-failed": inside & report.lost,
        "trials-told": told,
        "trials-without-value": inside & report.failed,
    }


def draw_shake(axes: "Axes", report: RunReport, candidate: Candidate) -> None:
    """Draw the histogram of a candidate's re-queries, on the axes that all candidates share."""
    from matplotlib.ticker import MaxNLocator

    everything = np.concatenate([np.append(c.values, c.quality) for c in report.candidates])
    everything = everything[np.isfinite(everything)]
    low, high = float(everything.min()), float(everything.max())
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    color = PALETTE[_role(report, candidate)]
    edges = np.linspace(low - margin, high + margin, 28)
    if report.counted:
        edges = np.linspace(*_SHARES, 12)  # a bin around 0 and one around 1
    tallest = max(np.histogram(c.values, edges)[0].max() for c in report.candidates)
    counts, _ = np.histogram(candidate.values, edges)
    axes.bar(edges[:-1], counts, np.diff(edges), align="edge", color=color, alpha=0.75, linewidth=0)
    axes.axvline(candidate.quality, color=PALETTE["ink"], linestyle=(0, (4, 2)), linewidth=1.2)
    at = float(np.clip(candidate.worth, edges[0], edges[-1]))  # a risk measure may lie beyond all values
    axes.plot(at, 0, marker="D", color=color, markeredgecolor=PALETTE["ink"], clip_on=False, zorder=5)
    right = candidate.quality > 0.6 * edges[-1] + 0.4 * edges[0]
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
    measure = report.risk.words(report.minimized)
    axes.set_xlabel(f"{report.axis_name} (◆ {measure} {worth(report, candidate.worth)})")
    axes.set_ylabel("re-queries")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5))  # more would overlap where numbers are long
    axes.yaxis.set_major_locator(MaxNLocator(nbins=3, integer=True))


def draw_map(axes: "Axes", report: RunReport, view: Surface, robust: bool) -> None:
    """Draw the model over two variables with the trials and the candidates; `robust`: its average over the noise."""
    values = view.robust_mean if robust and view.robust_mean is not None else view.mean
    both = [v for v in (view.mean, view.robust_mean) if v is not None]
    low, high = min(float(v.min()) for v in both), max(float(v.max()) for v in both)
    if high - low <= _FLAT * max(abs(low), abs(high)):  # rounding would fill all colors, and lines need levels apart
        high = low
    i, j = view.variables
    pair = first, second = report.variables[i], report.variables[j]
    a, b = (variable.shown(grid) for variable, grid in zip(pair, view.axes, strict=True))
    for which, variable, grid in zip(("x", "y"), pair, view.axes, strict=True):
        borders = variable.shown(np.array([_edge(grid, 0), _edge(grid, -1)])).tolist()
        set_scale(axes, which, tuple(borders), log=variable.log, whole=variable.whole)
    image = axes.imshow(
        values.T,
        origin="lower",
        extent=(0.0, 1.0, 0.0, 1.0),
        transform=axes.transAxes,  # the grid is even in the scale of the axes, which images know to be linear only
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
    X = np.column_stack([first.shown(report.X[:, i]), second.shown(report.X[:, j])])
    alpha = 0.45 if sliced else 0.95
    marks = marked(report, view)
    empty, full, cross = (X[marks[name]].T for name in ("trials-initial", "trials-later", "trials-failed"))
    axes.scatter(*empty, s=15, facecolors="none", edgecolors="white", linewidths=1.0, alpha=alpha, gid="trials-initial")
    axes.scatter(*full, s=11, c="white", edgecolors="black", linewidths=0.4, alpha=alpha, gid="trials-later")
    axes.scatter(*cross, s=18, c="white", marker="x", linewidths=1.0, alpha=alpha, gid="trials-failed")
    for candidate in report.candidates:
        _draw_candidate(axes, report, candidate, (i, j))
    axes.set(xlabel=first.label, ylabel=second.label)
    axes.set_title("Averaged over the input noise" if robust else "Model mean (input hit exactly)")
    bar = axes.figure.colorbar(image, ax=axes, fraction=0.05, pad=0.02, aspect=25)
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    bar.set_label(report.axis_name)


def _draw_candidate(axes: "Axes", report: RunReport, candidate: Candidate, pair: tuple[int, int]) -> None:
    role = _role(report, candidate)
    center = candidate.x[list(pair)]

    def shown(points: np.ndarray) -> list[np.ndarray]:
        return [report.variables[k].shown(column) for k, column in zip(pair, points.T, strict=True)]

    if candidate.noise is not None:
        values, vectors = np.linalg.eigh(candidate.noise[np.ix_(pair, pair)])
        turn = np.linspace(0.0, 2.0 * np.pi, _ROUND)
        circle = np.column_stack([np.cos(turn), np.sin(turn)])
        ellipse = center + (2.0 * np.sqrt(np.maximum(values, 0.0)) * circle) @ vectors.T  # two standard deviations
        for line, color in ((2.6, "white"), (1.4, PALETTE[role])):
            axes.plot(*shown(ellipse), color=color, linewidth=line, zorder=4)
    axes.plot(
        *shown(center[None, :]),
        marker=_MARKERS[role],
        color=PALETTE[role],
        markersize=9,
        markeredgecolor="white",
        markeredgewidth=1.4,
        zorder=6,
    )


def draw_line(axes: "Axes", report: RunReport, view: Surface) -> None:
    """Draw the model over one variable, its average over the noise, the trials and the candidates."""
    (i,) = view.variables
    variable = report.variables[i]
    t = variable.shown(view.axes[0])
    if view.std is not None:
        low, high = view.mean - 2 * view.std, view.mean + 2 * view.std
        if report.counted:
            low, high = np.maximum(low, 0.0), np.minimum(high, 1.0)
        axes.fill_between(t, low, high, color=PALETTE["muted"], alpha=0.22, linewidth=0)
    axes.plot(t, view.mean, color=PALETTE["ink"], linewidth=1.2, label="model (mean ± 2 standard deviations)")
    if view.robust_mean is not None:
        axes.plot(t, view.robust_mean, color=PALETTE["answer"], linewidth=2.0, label="averaged over the input noise")
    marks = marked(report, view)
    ok, failed = marks["trials-told"], marks["trials-without-value"]
    name = "trials, projected" if len(report.variables) > 1 or report.choices else "trials"  # a slice passes them by
    told = {"s": 12, "color": PALETTE["muted"], "gid": "trials-told", "label": name, "zorder": 2.5}
    axes.scatter(variable.shown(report.X[ok, i]), report.y[ok], **told)
    for candidate in report.candidates:
        role = _role(report, candidate)
        spread = 0.0 if candidate.noise is None else 2.0 * float(np.sqrt(candidate.noise[i, i]))
        low, x, high = variable.shown(candidate.x[i] + spread * np.array([-1.0, 0.0, 1.0]))
        axes.errorbar(
            x,
            candidate.quality,
            xerr=[[x - low], [high - x]] if spread else None,
            fmt=_MARKERS[role],
            color=PALETTE[role],
            markersize=9,
            markeredgecolor="white",
            ecolor=PALETTE[role],
            elinewidth=1.8,
            zorder=6,
            label=candidate.label if report.succeeded else report.called(candidate),
        )
    everything = np.concatenate([view.mean, report.y[ok]])
    margin = 0.25 * (everything.max() - everything.min()) or 1.0
    if failed.any():  # which have no height
        bottom = _SHARES[0] if report.counted else everything.min() - margin
        crosses = {"s": 28, "color": PALETTE["high"], "marker": "x", "gid": "trials-without-value", "clip_on": False}
        axes.scatter(variable.shown(report.X[failed, i]), np.full(failed.sum(), bottom), label="failed", **crosses)
    set_scale(axes, "x", (t[0], t[-1]), log=variable.log, whole=variable.whole)
    axes.set(xlabel=variable.label, ylabel=report.axis_name)
    axes.set_ylim(_SHARES if report.counted else (everything.min() - margin, everything.max() + margin))
    _legend_above(axes)
    axes.set_title("Model and trials")


def draw_trace(axes: "Axes", report: RunReport) -> None:
    """Draw best and robust value by trial, over the values of the single trials."""
    k = report.numbers
    failed = report.failed
    told = {"s": 8, "color": PALETTE["muted"], "alpha": 0.7, "gid": "trials-told", "label": "trial", "zorder": 2.0}
    axes.scatter(k[~failed], report.y[~failed], **told)
    if failed.any():
        floor = float(np.nanmin(report.y)) if (~failed).any() else 0.0
        axes.plot(
            k[failed], np.full(failed.sum(), floor), "x", color=PALETTE["muted"], markersize=5, label="failed trial"
        )
    if np.isfinite(report.best_trace).any():
        axes.step(
            k,
            report.best_trace,
            where="post",
            color=PALETTE["high"],
            linewidth=1.8,
            marker="_" if k.size == 1 else "",
            label=f"{report.extreme} value so far",
        )
    if report.robust_trace is not None and report.succeeded and np.isfinite(report.robust_trace).any():
        axes.plot(
            k,
            report.robust_trace,
            color=PALETTE["answer"],
            linewidth=1.8,
            marker="o" if np.isfinite(report.robust_trace).sum() == 1 else "",  # one place makes no line
            markersize=4.5,
            label=f"recommended: {report.expected_name}",
        )
    if 0 < report.n_initial < report.y.size:
        first = float(k[report.n_initial]) - 0.5  # the first later trial
        axes.axvspan(-0.5, first, color=PALETTE["grid"], alpha=0.45, linewidth=0, zorder=0)
        wide = first + 0.5 > 0.25 * (k[-1] + 1)  # the words fit into the band; else they begin in it
        axes.annotate(
            "initial design",
            (first / 2 - 0.25 if wide else -0.5, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0 if wide else 3, -3),
            textcoords="offset points",
            ha="center" if wide else "left",
            va="top",
            fontsize=8.5,
            color=PALETTE["muted"],
        )
    axes.margins(y=0.12)
    low, high = sorted(axes.get_ylim())
    if high - low <= _FLAT * max(abs(low), abs(high)):  # rounding has no ticks
        room = 0.05 * max(abs(low), abs(high))
        axes.set_ylim(low - room, high + room)
    if report.counted:
        axes.set_ylim(_SHARES)
    set_scale(axes, "x", (-0.5, max(k[-1] + 0.5, 0.6) if k.size else 0.6), whole=True)
    axes.set(xlabel="trial, from 0", ylabel=report.axis_name)
    axes.grid(axis="y", linewidth=0.6)
    axes.set_axisbelow(True)
    _legend_above(axes)


def _legend_above(axes: "Axes") -> None:
    """Put the legend beside what is drawn, never on it."""
    handles, labels = axes.get_legend_handles_labels()
    axes.figure.legend(handles, labels, loc="outside upper left", ncols=2, fontsize=8.5, borderaxespad=0.2)  # pyright: ignore[reportAttributeAccessIssue]


def _edge(ticks: np.ndarray, end: int) -> float:
    """Return the outer border of the first or last cell of a regular grid."""
    half = 0.5 * (ticks[1] - ticks[0])
    return float(ticks[0] - half if end == 0 else ticks[-1] + half)

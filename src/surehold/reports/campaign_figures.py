"""Figures of campaigns: means with bands over the trials, functions, models and maps, each from a `Picture`."""

from typing import TYPE_CHECKING, Any

import numpy as np

from surehold.reports.campaign_report import Panel, Picture
from surehold.reports.drawing import PALETTE, style
from surehold.reports.scales import set_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_picture"]

_ACROSS = 3  # panels side by side


def draw_picture(picture: Picture) -> "Figure":
    """Return the figure of a picture; one legend for all panels that share their labels."""
    from matplotlib.figure import Figure

    count = len(picture.panels)
    across = min(count, 2 if count in (2, 4) else _ACROSS)
    down = -(-count // across)
    with style(picture.name):
        figure = Figure(figsize=(4.4 * across if across > 1 else 5.6, 3.1 * down + 0.3), layout="constrained")
        grid = np.ravel(figure.subplots(down, across, squeeze=False))
        for axes, panel in zip(grid, picture.panels, strict=False):
            if panel.z is None:
                _draw_lines(axes, panel)
            else:
                _draw_map(axes, panel)
        for axes in grid[count:]:
            axes.set_axis_off()
        handles: dict[str, object] = {}
        for axes in grid[:count]:
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        if len(handles) > 1:
            columns = 5 if across > 1 else 3  # as many names as fit beside each other
            named: list[Any] = [list(handles.values()), list(handles)]
            figure.legend(*named, loc="outside lower center", ncols=columns, fontsize=8.5)
    return figure


def _draw_lines(axes: "Axes", panel: Panel) -> None:
    for band in panel.bands:
        axes.fill_between(band.x, band.low, band.high, color=band.color, alpha=0.18, linewidth=0)
    for line in panel.lines:
        axes.plot(
            line.x,
            line.y,
            color=line.color,
            label=line.label or "_",
            linewidth=1.6,
            linestyle=(0, (4, 2)) if line.dashed else "solid",
        )
    for points in panel.points:
        axes.plot(points.x, points.y, "o", color=PALETTE["muted"], markersize=3.5, label=points.label or "_")
    for place, label in panel.verticals:
        axes.axvline(place, color="#d62728", linestyle=(0, (4, 2)), linewidth=1.2, label=label or "_")
    if panel.initial > 0.0:
        axes.axvspan(0.0, panel.initial, color=PALETTE["grid"], alpha=0.45, linewidth=0, zorder=0)
    everything = [line.x for line in panel.lines]
    if everything:
        every = np.concatenate(everything)
        set_scale(axes, "x", (every.min(), every.max()), whole=bool(np.all(every % 1.0 == 0.0)))  # trials are counted
    if panel.initial > 0.0 and panel.lines:  # the climb out of the initial design would press the rest flat
        late = [line.y[line.x >= panel.initial] for line in panel.lines]
        late += [edge[band.x >= panel.initial] for band in panel.bands for edge in (band.low, band.high)]
        values = np.concatenate(late)
        values = values[np.isfinite(values)]
        if values.size:
            margin = 0.06 * float(np.ptp(values)) or 0.1
            axes.set_ylim(float(values.min()) - margin, float(values.max()) + margin)
    axes.grid(axis="y", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set(title=panel.title, xlabel=panel.xlabel, ylabel=panel.ylabel)


def _draw_map(axes: "Axes", panel: Panel) -> None:
    assert panel.z is not None
    image = axes.imshow(
        panel.z.T, origin="lower", extent=(0.0, 1.0, 0.0, 1.0), aspect="auto", cmap="viridis", interpolation="bicubic"
    )
    ticks = np.linspace(0.0, 1.0, len(panel.z))
    axes.contour(ticks, ticks, panel.z.T, levels=8, colors="white", linewidths=0.5, linestyles="solid", alpha=0.5)
    bar = axes.figure.colorbar(image, ax=axes, fraction=0.05, pad=0.02, aspect=25)
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    axes.set(title=panel.title, xlabel=panel.xlabel, ylabel=panel.ylabel)

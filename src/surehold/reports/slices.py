"""The model along lines through one point, for those who work in Python."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.extras import require
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.protocol import mixture
from surehold.reports.drawing import PALETTE, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_slice"]

_POINTS: Final = 201  # along a line
_PANELS: Final = 4  # side by side


def plot_slice(optimizer: Optimizer, x: Any = None) -> "Figure":
    """Return the model along each coordinate through one point: mean, two standard deviations, average over the noise.

    Parameters
    ----------
    x
        The point, however `tell` takes one; by default the recommended input.

    Raises
    ------
    InputError
        If x is no point of the box, or no trial has given a value yet.
    MissingExtra
        If matplotlib is not installed.
    """
    require("report", "plot_slice")
    from matplotlib.figure import Figure

    box = optimizer.box
    center = optimizer.recommend().x if x is None else box.points(x)
    if center.shape != (box.dimension,) or not box.contains(center):
        raise InputError(f"x is {x!r}; give one point of {box!r}.")
    columns = min(box.dimension, _PANELS)
    rows = -(-box.dimension // columns)
    with style("slice"):
        figure = Figure(figsize=(3.4 * columns + 0.6, 2.7 * rows + 0.5), layout="constrained", facecolor="white")
        grid = np.ravel(figure.subplots(rows, columns, squeeze=False, sharey=True))
        for axes, k in zip(grid, range(box.dimension), strict=False):
            _draw_slice(axes, optimizer, center, k)
        for axes in grid[box.dimension :]:
            axes.set_visible(False)
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=4, fontsize=8.5)
    return figure


def _draw_slice(axes: Any, optimizer: Optimizer, center: NDArray[np.float64], k: int) -> None:
    box, sign = optimizer.box, -1.0 if optimizer.direction == "minimize" else 1.0
    U = np.tile(box.to_unit(center), (_POINTS, 1))
    U[:, k] = np.linspace(0.0, 1.0, _POINTS)
    t = box.lower[k] + U[:, k] * box.widths[k]
    mean, variance = mixture(optimizer.posterior.moments(U))
    mean, deviation = sign * mean, 2.0 * np.sqrt(variance)
    axes.fill_between(t, mean - deviation, mean + deviation, color=PALETTE["muted"], alpha=0.22, linewidth=0)
    axes.plot(t, mean, color=PALETTE["ink"], linewidth=1.2, label="model (mean ± 2 standard deviations)")
    if optimizer.input_noise is not None:
        averaged, _ = mixture(Perturbations.of(optimizer.input_noise, box, "unscented").outcome(optimizer.posterior, U))
        axes.plot(t, sign * averaged, color=PALETTE["answer"], linewidth=2.0, label="averaged over the input noise")
    told = np.isfinite(optimizer.y)
    axes.plot(
        optimizer.reached[told, k],
        optimizer.y[told],
        "o",
        color=PALETTE["muted"],
        markersize=3,
        label="trials, projected",
    )
    axes.axvline(center[k], color=PALETTE["high"], linestyle=(0, (4, 2)), linewidth=1.1, label="the point")
    axes.set(xlabel=box.names[k], xlim=(t[0], t[-1]))

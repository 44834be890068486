"""The model along lines through one point, for those who work in Python."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import QUASI_RANDOM_EXPONENT_OF_FEW
from surehold.errors import InputError
from surehold.extras import require
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.protocol import mixture
from surehold.optimization.variables import Choice, Number
from surehold.reports.drawing import PALETTE, style
from surehold.reports.scales import set_scale

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_slice"]

_POINTS: Final = 201  # along a line
_PANELS: Final = 4  # side by side
_MODEL: Final = "model (mean ± 2 standard deviations)"
_AVERAGED: Final = "averaged over the input noise"
_TRIALS: Final = "trials, projected"


def plot_slice(optimizer: Optimizer, x: Any = None) -> "Figure":
    """Return the model along each variable through one point: mean, two standard deviations, average over the noise.

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
    columns = min(len(box.variables), _PANELS)
    rows = -(-len(box.variables) // columns)
    with style("slice"):
        figure = Figure(figsize=(3.4 * columns + 0.6, 2.7 * rows + 0.5), layout="constrained", facecolor="white")
        grid = np.ravel(figure.subplots(rows, columns, squeeze=False, sharey=True))
        for axes, variable in zip(grid, box.variables, strict=False):
            if isinstance(variable, Number):
                _draw_number(axes, optimizer, center, variable)
            else:
                _draw_choice(axes, optimizer, center, variable)
        for axes in grid[len(box.variables) :]:
            axes.set_visible(False)
        found = dict(zip(*reversed(grid[0].get_legend_handles_labels()), strict=True))
        figure.legend(list(found.values()), list(found), loc="outside upper left", ncols=4, fontsize=8.5)
    return figure


def _draw_number(axes: Any, optimizer: Optimizer, center: NDArray[np.float64], variable: Number) -> None:
    box, k = optimizer.box, optimizer.box.columns(variable.name).start
    U = np.tile(box.to_unit(center), (_POINTS, 1))
    U[:, k] = np.linspace(0.0, 1.0, _POINTS)

    def shown(coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.exp(coordinates) if variable.log else coordinates

    t = shown(box.lower[k] + U[:, k] * box.widths[k])
    (mean, deviation), averaged = _model(optimizer, U)
    axes.fill_between(t, mean - deviation, mean + deviation, color=PALETTE["muted"], alpha=0.22, linewidth=0)
    axes.plot(t, mean, color=PALETTE["ink"], linewidth=1.2, label=_MODEL)
    if averaged is not None:
        axes.plot(t, averaged, color=PALETTE["answer"], linewidth=2.0, label=_AVERAGED)
    told = np.isfinite(optimizer.y)
    axes.plot(
        shown(optimizer.reached[told, k]), optimizer.y[told], "o", color=PALETTE["muted"], markersize=3, label=_TRIALS
    )
    axes.axvline(shown(center[k]), color=PALETTE["high"], linestyle=(0, (4, 2)), linewidth=1.1, label="the point")
    axes.set_xlabel(variable.name)
    set_scale(axes, "x", (t[0], t[-1]), log=variable.log, whole=variable.integer)


def _draw_choice(axes: Any, optimizer: Optimizer, center: NDArray[np.float64], variable: Choice) -> None:
    own, k = optimizer.box.columns(variable.name), len(variable.choices)
    U = np.tile(optimizer.box.to_unit(center), (k, 1))
    U[:, own] = np.eye(k)
    (mean, deviation), averaged = _model(optimizer, U)
    place = np.arange(k)
    axes.errorbar(place, mean, deviation, fmt="s", color=PALETTE["ink"], markersize=5, capsize=4, label=_MODEL)
    if averaged is not None:
        axes.plot(place, averaged, "D", color=PALETTE["answer"], markersize=5, label=_AVERAGED)
    told = np.isfinite(optimizer.y)
    taken = np.argmax(optimizer.reached[told][:, own], axis=1)
    axes.plot(taken + 0.12, optimizer.y[told], "o", color=PALETTE["muted"], markersize=3, label=_TRIALS)
    axes.axvline(
        int(np.argmax(center[own])), color=PALETTE["high"], linestyle=(0, (4, 2)), linewidth=1.1, label="the point"
    )
    axes.set(xlabel=variable.name, xlim=(-0.5, k - 0.5), xticks=place)
    axes.set_xticklabels([str(choice) for choice in variable.choices])


def _model(optimizer: Optimizer, U: NDArray[np.float64]) -> tuple[Any, NDArray[np.float64] | None]:
    """Return mean and two standard deviations at U (n, d), and the average over the input noise where there is any."""
    sign = -1.0 if optimizer.direction == "minimize" else 1.0
    mean, variance = mixture(optimizer.posterior.moments(U))
    if optimizer.input_noise is None:
        return (sign * mean, 2.0 * np.sqrt(variance)), None
    noise, exponent = optimizer.input_noise, QUASI_RANDOM_EXPONENT_OF_FEW
    perturbations = Perturbations.of(noise, optimizer.box, "quasi_monte_carlo", exponent=exponent)
    averaged, _ = mixture(perturbations.outcome(optimizer.posterior, U))
    return (sign * mean, 2.0 * np.sqrt(variance)), sign * averaged

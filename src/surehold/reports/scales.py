"""Axes in the own units of a variable: logarithmic where it is, whole numbers where it takes no other."""

from typing import TYPE_CHECKING, Final, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["set_scale"]

_DECADE: Final = 10.0


def set_scale(
    axes: "Axes", which: Literal["x", "y"], limits: tuple[float, float], *, log: bool = False, whole: bool = False
) -> None:
    """Make one of two axes that of a variable: its limits, its scale and its ticks, in the units of the variable."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    axis = {"x": axes.xaxis, "y": axes.yaxis}[which]
    axes.set(**{f"{which}scale": "log" if log else "linear"})
    axes.set(**{f"{which}lim": limits})
    if not log:
        if whole:
            axis.set_major_locator(MaxNLocator("auto", integer=True, min_n_ticks=1))
        return
    narrow = limits[1] / limits[0] <= _DECADE  # which may hold no power of ten, thus no number at all
    if narrow:
        axis.set_major_locator(MaxNLocator(4, integer=whole, min_n_ticks=1))
    elif limits[1] / limits[0] <= _DECADE**3:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")

"""Functions of many variables, as papers on Bayesian optimization in many dimensions use them. All are maximized.

"-in-D" hides a function of few variables among D: the others change nothing. Which variables count is spread evenly
over the box; no optimizer of this package treats the first ones in another way. Each box is that of the papers (Wang et
al. 2013; Eriksson et al. 2019; Papenmeier et al. 2022).
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.optimization.box import Box
from surehold.problems.formula import Formula
from surehold.problems.published import branin

__all__ = ["HIGH_DIMENSIONAL", "ackley", "hartmann_6", "rosenbrock", "styblinski_tang"]

Array = NDArray[np.float64]

_HARTMANN_WEIGHTS: Final = np.array([1.0, 1.2, 3.0, 3.2])
_HARTMANN_SCALES: Final = np.array(
    [
        [10.0, 3.0, 17.0, 3.5, 1.7, 8.0],
        [0.05, 10.0, 17.0, 0.1, 8.0, 14.0],
        [3.0, 3.5, 1.7, 10.0, 17.0, 8.0],
        [17.0, 8.0, 0.05, 10.0, 0.1, 14.0],
    ]
)
_HARTMANN_CENTERS: Final = 1e-4 * np.array(
    [
        [1312, 1696, 5569, 124, 8283, 5886],
        [2329, 4135, 8307, 3736, 1004, 9991],
        [2348, 1451, 3522, 2883, 3047, 6650],
        [4047, 8828, 8732, 5743, 1091, 381],
    ]
)
_HARTMANN_TOP: Final = (0.20169, 0.150011, 0.476874, 0.275332, 0.311652, 0.6573)


def hartmann_6(x: Array) -> Array:
    """Return the Hartmann function of six variables (n,) at x (n, 6) of the unit cube; 3.32237 at its top."""
    squared = np.square(x[:, None] - _HARTMANN_CENTERS)
    return np.exp(-(_HARTMANN_SCALES * squared).sum(axis=2)) @ _HARTMANN_WEIGHTS


def ackley(x: Array) -> Array:
    """Return the Ackley function (n,), turned over, at x (n, d); 0 at the origin."""
    waves = np.exp(np.cos(2.0 * np.pi * x).mean(axis=1))
    return 20.0 * np.exp(-0.2 * np.sqrt(np.square(x).mean(axis=1))) + waves - 20.0 - np.e


def styblinski_tang(x: Array) -> Array:
    """Return the Styblinski-Tang function (n,), turned over, at x (n, d); 39.16617 d where all are -2.903534."""
    return -0.5 * (x**4 - 16.0 * x**2 + 5.0 * x).sum(axis=1)


def rosenbrock(x: Array) -> Array:
    """Return the Rosenbrock function (n,), turned over, at x (n, d); 0 where all are 1."""
    return -(100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2).sum(axis=1)


def _box(d: int, lower: float, upper: float) -> Box:
    return Box({f"x{i + 1}": (lower, upper) for i in range(d)})


def _hidden(name: str, f: Callable[[Array], Array], top: ArrayLike, d: int) -> Formula:
    """Return a function of the unit cube whose variables are spread over d; `top` is where it is highest."""
    best = np.asarray(top, dtype=np.float64)
    places = np.linspace(0, d - 1, len(best)).round().astype(int)
    start = np.full((1, d), 0.5)
    start[0, places] = best
    return Formula(name, Box.unit(d), lambda x: f(x[:, places]), starts=start)


def _branin(u: Array) -> Array:
    return -branin(15.0 * u - [5.0, 0.0])


_BRANIN_TOP: Final = ((np.pi + 5.0) / 15.0, 2.275 / 15.0)

#: The functions by name.
HIGH_DIMENSIONAL: Final[dict[str, Callable[[], Formula]]] = {
    "hartmann-6": lambda: _hidden("hartmann-6", hartmann_6, _HARTMANN_TOP, 6),
    "hartmann-6-in-30": lambda: _hidden("hartmann-6-in-30", hartmann_6, _HARTMANN_TOP, 30),
    "hartmann-6-in-100": lambda: _hidden("hartmann-6-in-100", hartmann_6, _HARTMANN_TOP, 100),
    "branin-in-100": lambda: _hidden("branin-in-100", _branin, _BRANIN_TOP, 100),
    "ackley-20": lambda: Formula("ackley-20", _box(20, -5.0, 10.0), ackley, starts=np.zeros((1, 20))),
    "styblinski-tang-50": lambda: Formula(
        "styblinski-tang-50", _box(50, -5.0, 5.0), styblinski_tang, starts=np.full((1, 50), -2.903534)
    ),
    "rosenbrock-100": lambda: Formula("rosenbrock-100", _box(100, -5.0, 10.0), rosenbrock, starts=np.ones((1, 100))),
}

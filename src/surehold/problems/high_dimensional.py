"""Functions of many variables, as papers on Bayesian optimization in many dimensions use them. All are maximized.

"-in-D" hides a function of few variables among D: the others change nothing. Which variables count is spread evenly
over the box; no optimizer of this package treats the first ones in another way. Each box is that of the papers (Wang et
al. 2013; Eriksson et al. 2019; Papenmeier et al. 2022). "robust-" is a problem of our own: all variables are shaken,
those too that change nothing.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.formula import Formula
from surehold.problems.hidden import Hidden
from surehold.problems.problem import Optimum
from surehold.problems.published import branin
from surehold.problems.robust import RobustProblem
from surehold.problems.rover import rover
from surehold.problems.synthetic import GaussianBumps

__all__ = [
    "HIGH_DIMENSIONAL",
    "HIGH_DIMENSIONAL_ROBUST",
    "ackley",
    "hartmann_6",
    "rosenbrock",
    "styblinski_tang",
]

Array = NDArray[np.float64]

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


def hartmann_6() -> GaussianBumps:
    """Return the Hartmann function of six variables: sum_k a_k exp(-sum_i A_ki (x_i - P_ki)^2) on the unit cube."""
    return GaussianBumps(
        "hartmann-6",
        Box.unit(6),
        heights=[1.0, 1.2, 3.0, 3.2],
        centers=_HARTMANN_CENTERS,
        covariances=[np.diag(0.5 / row) for row in _HARTMANN_SCALES],
        optimum=[0.20169, 0.150011, 0.476874, 0.275332, 0.311652, 0.6573],
        border="extend",
    )


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


def _branin(u: Array) -> Array:
    return -branin(15.0 * u - [5.0, 0.0])


def _branin_in_100() -> Hidden:
    top = [[(np.pi + 5.0) / 15.0, 2.275 / 15.0]]
    return Hidden("branin-in-100", Formula("branin", Box.unit(2), _branin, starts=top), 100)


def _styblinski_tang(d: int) -> Formula:
    top = np.full((1, d), -2.903534)
    return Formula(f"styblinski-tang-{d}", _box(d, -5.0, 5.0), styblinski_tang, starts=top)


def _robust_hartmann() -> RobustProblem:
    function = Hidden("robust-hartmann-6-in-100", hartmann_6(), 100)
    best = Optimum(np.array([0.20298, 0.15348, 0.47409, 0.2729, 0.3137, 0.6592]), 2.28234)
    return RobustProblem(function, InputNoise.unit(0.1), optimum=function.among(best))


#: The functions by name.
HIGH_DIMENSIONAL: Final[dict[str, Callable[[], Formula | GaussianBumps | Hidden]]] = {
    "hartmann-6": hartmann_6,
    "hartmann-6-in-30": lambda: Hidden("hartmann-6-in-30", hartmann_6(), 30),
    "hartmann-6-in-100": lambda: Hidden("hartmann-6-in-100", hartmann_6(), 100),
    "branin-in-100": _branin_in_100,
    "ackley-20": lambda: Formula("ackley-20", _box(20, -5.0, 10.0), ackley, starts=np.zeros((1, 20))),
    "styblinski-tang-50": lambda: _styblinski_tang(50),
    "styblinski-tang-100": lambda: _styblinski_tang(100),
    "rosenbrock-100": lambda: Formula("rosenbrock-100", _box(100, -5.0, 10.0), rosenbrock, starts=np.ones((1, 100))),
    "rover-60": lambda: Formula("rover-60", _box(60, 0.0, 1.0), rover),
}
#: Robust problems by name.
HIGH_DIMENSIONAL_ROBUST: Final[dict[str, Callable[[], RobustProblem]]] = {"robust-hartmann-6-in-100": _robust_hartmann}

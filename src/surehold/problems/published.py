"""Robust problems of other papers, with the noise, budget and score that they state. Everything is maximized.

    nes-       Froehlich et al. 2020, Noisy-Input Entropy Search: expectation under Gaussian input noise
    airbo-     Cao et al. 2023, AIRBO: the same
    mvar-      Daulton et al. 2022, robust multi-objective optimization: its first objective alone, value at risk
    qing-      Qing et al. 2022, mean-variance optimization by Fourier features: mean - beta variance
    stableopt- Bogunovic et al. 2018, StableOpt: the worst outcome within a distance, judged at 32 points
    rahbo-     Makarova et al. 2021, RAHBO: exact inputs, mean - beta variance of the observations

Input noise carries inputs outside the box; the functions go on there, but for the polynomial of Bertsimas et al. 2010,
whose inputs are clipped. Optima are given to the digits that brute force confirms (see the tests).
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.formula import Formula
from surehold.problems.problem import Optimum
from surehold.problems.robust import RobustProblem
from surehold.problems.synthetic import RKHS, GaussianBumps

__all__ = ["PUBLISHED", "branin", "hartmann_3"]

Array = NDArray[np.float64]


def sin_linear(x: Array) -> Array:
    """Return sin(5 pi x^2) + x / 2 (n,) at x (n, 1)."""
    return np.sin(5.0 * np.pi * x[:, 0] ** 2) + 0.5 * x[:, 0]


def polynomial(x: Array) -> Array:
    """Return the non-convex polynomial of Bertsimas, Nohadani and Teo 2010 (n,) at x (n, 2), turned over."""
    a, b = x.T
    return (
        np.polyval([-2.0, 12.2, -21.2, 6.4, 4.7, -6.2, 0.0], a)
        + np.polyval([-1.0, 11.0, -43.3, 74.8, -56.9, 10.0, 0.0], b)
        + a * b * (4.1 + 0.1 * a * b - 0.4 * b - 0.4 * a)
    )


def branin(x: Array) -> Array:
    """Return the Branin function (n,), to be minimized, at x (n, 2) of [-5, 10] x [0, 15]."""
    a, b = x.T
    return (b - 5.1 / (4.0 * np.pi**2) * a**2 + 5.0 / np.pi * a - 6.0) ** 2 + 10.0 * (
        1.0 + (1.0 - 1.0 / (8.0 * np.pi)) * np.cos(a)
    )


def forrester(x: Array) -> Array:
    """Return (6 x - 2)^2 sin(12 x - 4) (n,), to be minimized, at x (n, 1) of [0, 1] (Forrester et al. 2008)."""
    return (6.0 * x[:, 0] - 2.0) ** 2 * np.sin(12.0 * x[:, 0] - 4.0)


def custom_k(x: Array) -> Array:
    """Return sinc(2 pi x) and two bumps (n,) at x (n, 1); sinc(z) is sin(pi z) / (pi z)."""
    bumps = 7.2 * np.exp(-((37.0 * (x - 0.25)) ** 2)) + 8.9 * np.exp(-((39.0 * (x - 0.35)) ** 2))
    return (np.sinc(2.0 * np.pi * x) + bumps)[:, 0]


def bumped_bowl(x: Array) -> Array:
    """Return the bumped bowl (n,), to be minimized, at x (n, 3): a ring-shaped moat in two inputs, a factor in one."""
    squared = np.sum(x[:, :2] ** 2, axis=1)
    bowl = 2.0 * np.log(0.8 * squared + np.exp(-10.0 * squared)) + 2.54
    return bowl * (1.0 + 5.0 * x[:, 2] ** 2)


def hartmann_3() -> GaussianBumps:
    """Return the Hartmann function of three inputs: sum_k a_k exp(-sum_i A_ki (x_i - P_ki)^2) on the unit cube."""
    precisions = np.array([[3.0, 10.0, 30.0], [0.1, 10.0, 35.0], [3.0, 10.0, 30.0], [0.1, 10.0, 35.0]])
    centers = [[3689, 1170, 2673], [4699, 4387, 7470], [1091, 8732, 5547], [381, 5743, 8828]]
    return GaussianBumps(
        "hartmann-3",
        Box.unit(3),
        heights=[1.0, 1.2, 3.0, 3.2],
        centers=np.array(centers) / 1e4,
        covariances=[np.diag(0.5 / row) for row in precisions],
        optimum=[0.114589, 0.555649, 0.852547],
        border="extend",
    )


def _mixture(name: str) -> GaussianBumps:
    """Return the mixture of a broad and two narrow bumps of Noisy-Input Entropy Search."""
    return GaussianBumps(
        name,
        Box.unit(2),
        heights=[0.5, 0.7, 0.7],
        centers=[[0.2, 0.2], [0.8, 0.2], [0.5, 0.7]],
        covariances=[width**2 * np.eye(2) for width in (0.2, 0.1, 0.1)],
        border="extend",
    )


def _unit_branin(x: Array) -> Array:
    return -branin(x * 15.0 - [5.0, 0.0])


def _rising(rest: float, step: float, speed: float, middle: float) -> Callable[[Array], Array]:
    return lambda x: rest + step * expit(speed * (x - middle))


def _nes_polynomial() -> RobustProblem:
    box = Box({"x1": (-0.95, 3.2), "x2": (-0.45, 4.4)})
    function = Formula("nes-polynomial", box, polynomial, "clip", [[2.815, 4.009]])
    return RobustProblem(function, InputNoise({"x1": 0.6, "x2": 0.6}), initial=5, trials=55)


def _stableopt_polynomial() -> RobustProblem:
    """Return the polynomial whose worst value within .5 counts, judged at 31 points of the rim and the center.

    Of a disc the worst lies on the rim but for valleys. By the whole disc the best value is -4.2828, half a percent
    lower, at (-.1813, .2916); at the best place by the 32 points, .0007 from there, it is -4.2871.
    """
    box = Box({"x1": (-0.95, 3.2), "x2": (-0.45, 4.4)})
    turns = np.linspace(0.0, 2.0 * np.pi, 31, endpoint=False)
    errors = 0.5 * np.vstack([np.column_stack([np.cos(turns), np.sin(turns)]), np.zeros(2)])
    return RobustProblem(Formula("stableopt-polynomial", box, polynomial), InputNoise.samples(errors), risk="worst")


def _airbo_rkhs() -> RobustProblem:
    base = RKHS()
    function = GaussianBumps(
        "airbo-rkhs", base.box, 10.0 * base.heights, base.centers, base.covariances, base.optimum.x, "extend"
    )
    return RobustProblem(function, InputNoise.unit(0.01), initial=10, trials=110)


def _airbo_bumped_bowl() -> RobustProblem:
    box = Box(dict.fromkeys(("x1", "x2", "x3"), (-4.0, 4.0)))
    function = Formula("airbo-bumped-bowl", box, lambda x: -bumped_bowl(x))
    return RobustProblem(function, InputNoise(covariance=np.diag([1.5, 1.5, 2.0])), initial=10, trials=110)


def _mvar(name: str, noise: InputNoise) -> RobustProblem:
    return RobustProblem(_mixture(name), noise, risk="var", alpha=0.1, initial=6, trials=106)


def _qing(function: Formula | GaussianBumps, noise: InputNoise, beta: float, initial: int, steps: int) -> RobustProblem:
    return RobustProblem(function, noise, risk="mean-variance", beta=beta, initial=initial, trials=initial + steps)


def _rahbo_sine(step: float) -> RobustProblem:
    function = Formula(f"rahbo-sine-{step:g}", Box({"x": (0.0, 2.0)}), lambda x: np.sin(2.0 * np.pi * x[:, 0]))
    spread = _rising(0.1, step, 30.0, 1.0)
    return RobustProblem(function, None, lambda x: spread(x[:, 0]), risk="mean-variance", beta=1.0)


def _rahbo_branin() -> RobustProblem:
    function = Formula("rahbo-branin", Box({"x1": (-5.0, 10.0), "x2": (0.0, 15.0)}), lambda x: -branin(x))
    first, second = _rising(0.2, 1.0, 2.0, 3.2), _rising(0.2, 1.0, 2.0, 0.0)
    return RobustProblem(function, None, lambda x: first(x[:, 0]) * second(x[:, 1]), risk="mean-variance", beta=1.0)


_LINE: Final = Box({"x": (0.0, 1.0)})
_CORRELATED_3: Final = [[0.01, 0.009, -0.009], [0.009, 0.01, -0.008], [-0.009, -0.008, 0.01]]
_MAKERS: Final[dict[str, Callable[[], RobustProblem]]] = {
    "nes-sin-linear": lambda: RobustProblem(
        Formula("nes-sin-linear", _LINE, sin_linear), InputNoise.unit(0.05), initial=3, trials=23
    ),
    "nes-gmm": lambda: RobustProblem(_mixture("nes-gmm"), InputNoise.unit(0.1), initial=5, trials=55),
    "nes-polynomial": _nes_polynomial,
    "nes-hartmann-3": lambda: RobustProblem(hartmann_3(), InputNoise.unit(0.1), initial=10, trials=110),
    "stableopt-polynomial": _stableopt_polynomial,
    "airbo-rkhs": _airbo_rkhs,
    "airbo-custom-k": lambda: RobustProblem(
        Formula("airbo-custom-k", _LINE, custom_k), InputNoise.unit(0.01), initial=10, trials=110
    ),
    "airbo-bumped-bowl": _airbo_bumped_bowl,
    "mvar-gmm": lambda: _mvar("mvar-gmm", InputNoise.unit(0.05)),
    "mvar-gmm-correlated": lambda: _mvar(
        "mvar-gmm-correlated", InputNoise(covariance=[[0.0025, -0.002], [-0.002, 0.0025]])
    ),
    "qing-forrester": lambda: _qing(
        Formula("qing-forrester", _LINE, lambda x: -forrester(x)), InputNoise.unit(0.005**0.5), 5.0, 5, 40
    ),
    "qing-forrester-uniform": lambda: _qing(
        Formula("qing-forrester-uniform", _LINE, lambda x: -forrester(x)), InputNoise.uniform({"x": 0.1}), 5.0, 5, 40
    ),
    "qing-sin-linear": lambda: _qing(
        Formula("qing-sin-linear", _LINE, sin_linear), InputNoise.unit(0.001**0.5), 2.0, 5, 40
    ),
    "qing-sin-linear-uniform": lambda: _qing(
        Formula("qing-sin-linear-uniform", _LINE, sin_linear), InputNoise.uniform({"x": 0.1}), 2.0, 5, 40
    ),
    "qing-branin": lambda: _qing(
        Formula("qing-branin", Box.unit(2), _unit_branin),
        InputNoise(covariance=[[0.01, -0.003], [-0.003, 0.001]]),
        0.5,
        10,
        50,
    ),
    "qing-hartmann-3": lambda: _qing(hartmann_3(), InputNoise(covariance=_CORRELATED_3), 12.0, 15, 50),
    "rahbo-sine-1": lambda: _rahbo_sine(1.0),
    "rahbo-sine-2": lambda: _rahbo_sine(2.0),
    "rahbo-branin": _rahbo_branin,
}
#: Best place and value of what is asked, by brute force.
_OPTIMA: Final[dict[str, tuple[list[float], float]]] = {
    "nes-sin-linear": ([0.31112], 1.042098),
    "nes-gmm": ([0.2003, 0.2002], 0.400115),
    "nes-polynomial": ([0.2688, 0.6745], -7.34310),
    "nes-hartmann-3": ([0.11729, 0.56941, 0.83030], 2.971075),
    "stableopt-polynomial": ([-0.180758, 0.292012], -4.261117),
    "airbo-rkhs": ([0.077565], 49.38220),
    "airbo-custom-k": ([0.35011], 7.876019),
    "airbo-bumped-bowl": ([0.0, 0.0, 0.0], -37.854),
    "mvar-gmm": ([0.2005, 0.2005], 0.4331),
    "mvar-gmm-correlated": ([0.1985, 0.1990], 0.4266),
    "qing-forrester": ([0.29225], -0.295664),
    "qing-forrester-uniform": ([0.17434], 0.161546),
    "qing-sin-linear": ([0.31585], 1.100457),
    "qing-sin-linear-uniform": ([0.30640], 0.968390),
    "qing-branin": ([0.41084, 0.41820], -22.72202),
    "qing-hartmann-3": ([0.05042, 0.75718, 0.66684], 1.001544),
    "rahbo-sine-1": ([0.25], 0.99),
    "rahbo-sine-2": ([0.25], 0.99),
    "rahbo-branin": ([-3.14159, 12.275], -0.455489),
}


def _with_optimum(name: str) -> RobustProblem:
    x, value = _OPTIMA[name]
    return _MAKERS[name]()._replace(optimum=Optimum(np.array(x), value))


#: The problems by name.
PUBLISHED: Final[dict[str, Callable[[], RobustProblem]]] = {
    name: (lambda name=name: _with_optimum(name)) for name in _MAKERS
}

"""Problems on which the highest peak is not the answer: sums of Gaussian bumps under input noise, with known optima.

Each is a function and the noise for which it is meant. A needle is a bump that the noise levels; a hill is one that it
leaves. Units are those of the unit cube.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.synthetic import GaussianBumps

__all__ = ["ROBUST", "RobustProblem", "robust_problem"]


class RobustProblem(NamedTuple):
    """A function and the input noise under which its best place is sought."""

    function: GaussianBumps
    noise: InputNoise
    observation_noise: float = 0.0
    """standard deviation of what is added to every trial"""


def _along(angle: float, long: float, short: float) -> NDArray[np.float64]:
    """Return the covariance (2, 2) of standard deviation `long` along the angle and `short` across."""
    direction = np.array([np.cos(angle), np.sin(angle)])
    return short**2 * np.eye(2) + (long**2 - short**2) * np.outer(direction, direction)


def _needle(d: int) -> RobustProblem:
    """Return a needle of height 1.6 beside a hill of height 1, in d variables."""
    narrow, broad = {2: (0.04, 0.15), 3: (0.06, 0.2), 5: (0.09, 0.3), 7: (0.12, 0.35)}[d]
    function = GaussianBumps(
        f"needle-{d}",
        Box.unit(d),
        heights=[1.6, 1.0],
        centers=[np.full(d, 0.72), np.full(d, 0.35)],
        covariances=[narrow**2 * np.eye(d), broad**2 * np.eye(d)],
    )
    return RobustProblem(function, InputNoise.unit(0.06))


def _ridge() -> RobustProblem:
    """Return two ridges that cross the directions of a correlated noise: the lower one runs along it and is safe."""
    function = GaussianBumps(
        "ridge",
        Box.unit(2),
        heights=[1.5, 1.0],
        centers=[[0.7, 0.3], [0.35, 0.45]],
        covariances=[_along(-np.pi / 4.0, 0.25, 0.04), _along(np.pi / 4.0, 0.25, 0.04)],
    )
    return RobustProblem(function, InputNoise(covariance=_along(np.pi / 4.0, 0.1, 0.02)))


def _border(name: str, hill: list[float]) -> RobustProblem:
    """Return a hill whose top lies on the border, and a needle inside."""
    function = GaussianBumps(
        name,
        Box.unit(2),
        heights=[1.8, 1.0],
        centers=[[0.3, 0.3], hill],
        covariances=[0.03**2 * np.eye(2), 0.2**2 * np.eye(2)],
    )
    return RobustProblem(function, InputNoise.unit(0.05))


def _many() -> RobustProblem:
    """Return four hills and six needles under correlated noise."""
    hills = [(0.2, 0.75, 0.95), (0.75, 0.8, 1.0), (0.3, 0.2, 0.85), (0.8, 0.25, 0.9)]
    needles = [(0.5, 0.5), (0.1, 0.4), (0.55, 0.9), (0.9, 0.55), (0.6, 0.1), (0.05, 0.05)]
    function = GaussianBumps(
        "many",
        Box.unit(2),
        heights=[*(height for _, _, height in hills), *[1.6] * len(needles)],
        centers=[*((x, y) for x, y, _ in hills), *needles],
        covariances=[_along(np.pi / 4.0, 0.14, 0.09)] * 2
        + [_along(-np.pi / 4.0, 0.14, 0.09)] * 2
        + [0.025**2 * np.eye(2)] * len(needles),
    )
    return RobustProblem(function, InputNoise(covariance=_along(np.pi / 4.0, 0.08, 0.02)))


#: The problems by name.
ROBUST: Final = {
    **{f"needle-{d}": (lambda d=d: _needle(d)) for d in (2, 3, 5, 7)},
    "needle-2-noisy": lambda: _needle(2)._replace(observation_noise=0.03),
    "ridge": _ridge,
    "edge": lambda: _border("edge", [1.0, 0.55]),
    "corner": lambda: _border("corner", [1.0, 1.0]),
    "many": _many,
}


def robust_problem(name: str) -> RobustProblem:
    """Return the problem of that name: needle-2 (-3, -5, -7, -2-noisy), ridge, edge, corner or many.

    Raises
    ------
    InputError
        If the name is not one of these.
    """
    if name not in ROBUST:
        raise unknown_name("robust problem", name, ROBUST)
    return ROBUST[name]()

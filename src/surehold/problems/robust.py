"""Robust problems: a function, the noise under which its best place is sought, and what is asked of the outcome.

Here are those on which the highest peak is not the answer: sums of Gaussian bumps under input noise, with known
optima. A needle is a bump that the noise levels; a hill is one that it leaves. Units are those of the unit cube.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.samples import Samples
from surehold.problems.problem import Optimum
from surehold.problems.synthetic import GaussianBumps

__all__ = ["ROBUST", "RobustProblem"]


class RobustProblem(NamedTuple):
    """A function, the noise under which its best place is sought, and what is asked of the outcome."""

    function: Any
    """a `problems.Problem` with `expectation(x, noise)` and `standard_deviation(x, noise)`"""
    noise: InputNoise | None
    """None where inputs are exact and only observations are noisy"""
    observation_noise: float | Callable[[NDArray[np.float64]], NDArray[np.float64]] = 0.0
    """standard deviation of what is added to every trial; where it varies, a function of points (n, d)"""
    risk: str = "mean"
    """what is asked of the outcome: a name of `Risk`"""
    alpha: float = 0.1
    """of that risk: the share of worst outcomes"""
    beta: float = 1.0
    """of that risk: standard deviations or variances off the mean"""
    initial: int = 0
    """trials of the published initial design; 0 where none is published"""
    trials: int = 0
    """published budget, initial design included; 0 where none is published"""
    optimum: Optimum | None = None
    """best place and its `value`, where they are known to the digits given"""

    @property
    def measure(self) -> Risk:
        """What is asked of the outcome, as an `Optimizer` takes it."""
        return Risk(self.risk, self.alpha, self.beta)

    def value(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what is asked of the outcome at x (n, d), exactly or to about 1e-3 of the spread (risk "var").

        Without input noise the outcome's spread is that of the observations.

        Raises
        ------
        InputError
            For a risk that has no closed form or quadrature here.
        """
        points = np.atleast_2d(x)
        if self.risk == "worst" and self.noise is not None and isinstance(self.noise.kind, Samples):
            errors = self.noise.kind.errors
            values = self.function((points[:, None] + errors).reshape(-1, points.shape[1]))
            return values.reshape(len(points), len(errors)).min(axis=1)
        if self.noise is None:
            mean, std = self.function(points), self.observed_std(points)
        else:
            mean = self.function.expectation(points, self.noise)
            std = self.function.standard_deviation(points, self.noise) if self.risk.startswith("mean-") else 0.0
        if self.risk == "mean":
            return mean
        if self.risk in ("mean-std", "mean-variance"):
            return mean - self.beta * (std if self.risk == "mean-std" else np.square(std))
        if self.risk == "var" and self.noise is not None:
            return np.array([_quantile(self.function, point, self.noise, self.alpha) for point in points])
        raise InputError(
            f"risk '{self.risk}' has no value here; give mean, mean-std, mean-variance, var, or worst of samples."
        )

    def observed_std(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the standard deviation of the observation noise (n,) at x (n, d)."""
        points = np.atleast_2d(x)
        noise = self.observation_noise
        return noise(points) if callable(noise) else np.full(len(points), float(noise))


def _quantile(function: Any, point: NDArray[np.float64], noise: InputNoise, alpha: float) -> float:
    """Return the alpha-quantile of the outcome at a point (d,), by 2^14 quasi-random inputs, or by the samples."""
    from scipy.special import ndtr
    from scipy.stats import qmc

    if isinstance(noise.kind, Samples):
        return float(np.quantile(function(point + noise.kind.errors), alpha, method="inverted_cdf"))
    box: Box = function.box
    normals = qmc.MultivariateNormalQMC(np.zeros(box.dimension), rng=np.random.default_rng(0)).random(2**14)
    standard = 3.0**0.5 * (2.0 * ndtr(normals) - 1.0) if noise.bounded else normals
    root = noise.unit_roots(box, box.to_unit(point)[None])[0]
    return float(np.quantile(function(point + (standard @ root.T) * box.widths), alpha))


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
ROBUST: Final[dict[str, Callable[[], RobustProblem]]] = {
    **{f"needle-{d}": (lambda d=d: _needle(d)) for d in (2, 3, 5, 7)},
    "needle-2-noisy": lambda: _needle(2)._replace(observation_noise=0.03),
    "ridge": _ridge,
    "edge": lambda: _border("edge", [1.0, 0.55]),
    "corner": lambda: _border("corner", [1.0, 1.0]),
    "many": _many,
}

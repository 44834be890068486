"""A function given by a formula, and its mean and standard deviation under input noise by quadrature.

Notation: x (d,) the commanded input, y = x + xi the reached one, both in the units of the box. Rules at the border:
"extend" goes on with the formula outside the box; "clip" moves what leaves the box back to it. Up to two shaken inputs
are integrated with Gauss-Legendre panels over eight standard deviations (over the whole support of uniform noise);
more with a quasi-Monte Carlo sum over 2^15 points, relative error about 1e-4.
"""

from collections.abc import Callable
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.samples import Samples
from surehold.problems.problem import Optimum, checked_points
from surehold.problems.synthetic import highest

__all__ = ["Formula", "reached_inputs"]

_REACH: Final = 8.0  # standard deviations; beyond lies less than 1e-15 of the probability
_PANELS, _ORDER = 16, 10  # of one shaken input


class Formula:
    """A function of points (n, d) with its box, defined wherever the noise may carry an input.

    Parameters
    ----------
    name
        Short name.
    box
        Named bounds of the d inputs.
    f
        Takes points (n, d) in the units of the box, returns values (n,).
    border
        "extend": f is called outside the box, too. "clip": an input that leaves the box is moved back to its border.
    starts
        (k, d) places from which the highest value is searched for, beside a net.
    """

    def __init__(
        self,
        name: str,
        box: Box,
        f: Callable[[NDArray[np.float64]], NDArray[np.float64]],
        border: Literal["extend", "clip"] = "extend",
        starts: ArrayLike = (),
    ):
        if border not in ("extend", "clip"):
            raise unknown_name("border rule", border, ("extend", "clip"))
        self.name: Final[str] = name
        self.box: Final[Box] = box
        self.border: Final = "extend"  # clipping is done by the function itself
        self.clips: Final = border == "clip"
        self._f = f
        self._starts = np.reshape(np.asarray(starts, dtype=np.float64), (-1, box.dimension))
        self._optimum: Optimum | None = None

    @property
    def optimum(self) -> Optimum:
        """The highest value in the box and where it is, by search."""
        if self._optimum is None:
            self._optimum = highest(self, self.box, self._starts)
        return Optimum(self._optimum.x.copy(), self._optimum.value)

    def __call__(self, x: ArrayLike) -> float | NDArray[np.float64]:
        """Return the value at x (d,) as a float, or the values at x (n, d) as an array (n,)."""
        points, single = checked_points(x, self.box)
        if self.clips:
            points = np.clip(points, self.box.lower, self.box.upper)
        values = self._f(points)
        return float(values[0]) if single else values

    def expectation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return E f(x + xi), xi ~ `noise`, at x (d,) or (n, d)."""
        return self._moments(x, noise)[0]

    def standard_deviation(self, x: ArrayLike, noise: InputNoise) -> float | NDArray[np.float64]:
        """Return the standard deviation of f(x + xi), xi ~ `noise`, at x (d,) or (n, d)."""
        return self._moments(x, noise)[1]

    def _moments(self, x: ArrayLike, noise: InputNoise) -> tuple[float | NDArray[np.float64], ...]:
        points, single = checked_points(x, self.box)
        found = np.empty((2, len(points)))
        for i, point in enumerate(points):
            reached, weights = reached_inputs(point, self.box, noise, self.clips)
            values = self._f(reached)
            found[0, i] = weights @ values
            found[1, i] = np.sqrt(weights @ (values - found[0, i]) ** 2)
        return tuple(float(row[0]) if single else row for row in found)

    def __repr__(self) -> str:
        return f"<{self.name} on {self.box!r}>"


def reached_inputs(
    x: NDArray[np.float64], box: Box, noise: InputNoise, clip: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the nodes (s, d) of the reached inputs around x (d,) in the units of the box, and their weights (s,).

    Raises
    ------
    InputError
        For clipped noise that is correlated, or shakes more than two inputs.
    """
    if isinstance(noise.kind, Samples):
        reached = x + noise.kind.errors
        reached = np.clip(reached, box.lower, box.upper) if clip else reached
        return reached, np.full(len(reached), 1.0 / len(reached))
    covariance = noise.unit_covariance(box, x) * np.outer(box.widths, box.widths)
    shaken = np.flatnonzero(np.diag(covariance) > 0.0)
    if clip and (shaken.size > 2 or np.count_nonzero(covariance - np.diag(np.diag(covariance)))):
        raise InputError(f"{noise!r} has no quadrature for clipped inputs; give at most two independent deviations.")
    if clip or noise.bounded:
        axes = [
            _axis(x[a], covariance[a, a] ** 0.5, noise.bounded, (box.lower[a], box.upper[a]) if clip else None)
            for a in shaken
        ]
    else:
        axes = [_axis(0.0, 1.0, False, None)] * shaken.size
    if shaken.size > 2:
        nodes, weights = _quasi_random(shaken.size, noise.bounded)
        root = np.linalg.cholesky(covariance[np.ix_(shaken, shaken)])
        values = x[shaken] + nodes @ root.T
    else:
        grids = np.meshgrid(*(axis[0] for axis in axes), indexing="ij")
        values = np.stack([grid.ravel() for grid in grids], axis=1)
        weights = np.prod(np.meshgrid(*(axis[1] for axis in axes), indexing="ij"), axis=0).ravel()
        if not (clip or noise.bounded):
            values = x[shaken] + values @ np.linalg.cholesky(covariance[np.ix_(shaken, shaken)]).T
    reached = np.tile(x, (len(values), 1))
    reached[:, shaken] = values
    return reached, weights / weights.sum()


def _axis(
    center: float, sigma: float, bounded: bool, limits: tuple[float, float] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return nodes and weights of one shaken input; what is clipped lies on the limits."""
    from scipy.special import ndtr

    reach = 3.0**0.5 if bounded else _REACH
    low, high = center - reach * sigma, center + reach * sigma
    if limits is not None:
        low, high = max(low, limits[0]), min(high, limits[1])
    base, share = np.polynomial.legendre.leggauss(_ORDER)
    edges = np.linspace(low, high, _PANELS + 1)
    half = np.diff(edges)[:, None] / 2.0
    nodes, weights = ((edges[:-1] + edges[1:])[:, None] / 2.0 + half * base).ravel(), (half * share).ravel()
    z = (nodes - center) / sigma
    weights = weights / sigma * (0.5 / 3.0**0.5 if bounded else np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi))
    if limits is None:
        return nodes, weights
    ends = (np.array(limits) - center) / sigma
    below, above = (ends + reach) / (2.0 * reach) if bounded else ndtr(ends)
    masses = np.clip([below, 1.0 - above], 0.0, 1.0)
    return np.append(nodes, limits), np.append(weights, masses)


def _quasi_random(d: int, bounded: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return nodes (s, d) of independent deviates of mean 0 and variance 1, and weights (s,)."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    u = qmc.Sobol(d, rng=np.random.default_rng(0)).random_base2(15)
    nodes = 3.0**0.5 * (2.0 * u - 1.0) if bounded else ndtri(np.clip(u, 1e-12, 1.0 - 1e-12))
    return nodes, np.full(len(nodes), 1.0 / len(nodes))

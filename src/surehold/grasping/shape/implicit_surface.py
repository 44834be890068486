"""A Gaussian-process implicit surface: f < 0 inside the object, f = 0 on its surface, f > 0 outside.

    f = m + g, g ~ GP(0, k)    m   prior shape: a box, an ellipsoid, or the mean of another surface, m
                               k   Matérn-5/2 (kernel.py)
    y = f(x_i) + e_i           values, m: 0 on the surface, a distance beside it       e_i   noise, m
    v = df(x_j) + e_j          slopes: outward unit normals                            N = n + 3 m observations

f approximates the signed distance where it was measured: contacts and points of a cloud are zeros, normals are slopes
of length 1, and what was seen or swept free is at least as far away as told (Williams and Fitzgibbon 2007; Dragiev,
Toussaint and Gienger 2011). A bound f(x) >= b becomes an observation f(x) = b if, and only if, the surface learnt
without it breaks it: the active set of the constrained mode, found in a few rounds.
"""

from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import SureholdError
from surehold.grasping.shape.kernel import (
    covariance,
    cross_covariance,
    fast_function_values,
    function_derivatives,
    function_values,
)
from surehold.grasping.shape.prior import PriorShape

__all__ = ["ImplicitSurface", "Observations", "Scales", "learnt_scales", "spaced", "surface_of"]

Array = NDArray[np.float64]

_ROUNDS: Final = 2  # of the active set
_MOST_ACTIVE: Final = 200  # bounds that may become observations in a round
_BOUND_NOISE: Final = 0.001  # of a bound that has become an observation [m]
_LEARNT_FROM: Final = 400  # observations from which the scales are learnt


def _rows(width: int = 3) -> Array:
    return np.empty((0, width))


@dataclass(frozen=True, eq=False)
class Observations:
    """What was measured of a shape. All of it is in one frame, in meters."""

    points: Array = field(default_factory=_rows)  #: (n, 3)
    values: Array = field(default_factory=lambda: np.empty(0))  #: (n,) signed distance, 0 on the surface
    noise: Array = field(default_factory=lambda: np.empty(0))  #: (n,) standard deviations of the values
    slope_points: Array = field(default_factory=_rows)  #: (m, 3)
    slopes: Array = field(default_factory=_rows)  #: (m, 3) outward unit normals
    slope_noise: Array = field(default_factory=lambda: np.empty(0))  #: (m,) standard deviations of each component
    free: Array = field(default_factory=lambda: _rows(4))  #: (b, 4) points and the least distance of the object there

    def __add__(self, other: "Observations") -> "Observations":
        names = self.__dataclass_fields__
        return Observations(**{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names})


@dataclass(frozen=True, eq=False)
class ImplicitSurface:
    """The process after its observations. Points are (p, 3) in meters."""

    prior: "PriorShape | ImplicitSurface"
    observations: Observations = field(repr=False)  #: with the bounds that became active among the values
    std: float  #: of the process without observations [m]
    length: float  #: its length scale [m]
    order: NDArray[np.intp] = field(repr=False)  #: (N,) of the observations in the factor: as they came
    factor: Array = field(repr=False)  #: (N, N) lower Cholesky factor of their covariance, in that order
    alpha: Array = field(repr=False)  #: (n, 1) weights of the values
    beta: Array = field(repr=False)  #: (m, 3, 1) weights of the slopes

    @property
    def first(self) -> PriorShape:
        """The box or ellipsoid at the bottom of it."""
        return self.prior if isinstance(self.prior, PriorShape) else self.prior.first

    def value(self, points: Array) -> Array:
        """Return the posterior mean of f (p,) [m]."""
        return self.prior.value(points) + function_values(points, *self._known(), self.std, self.length)[:, 0]

    def fast_value(self, points: Array) -> Array:
        """Return the posterior mean of f (p,) [m] to some micrometers."""
        return self.prior.fast_value(points) + fast_function_values(points, *self._known(), self.std, self.length)[:, 0]

    def gradient(self, points: Array) -> Array:
        """Return the gradient (p, 3) of the posterior mean."""
        return self.prior.gradient(points) + function_derivatives(points, *self._known(), self.std, self.length)[0]

    def hessian(self, points: Array) -> Array:
        """Return the second derivatives (p, 3, 3) of the posterior mean [1/m]."""
        return self.prior.hessian(points) + function_derivatives(points, *self._known(), self.std, self.length)[1]

    def deviation(self, points: Array) -> Array:
        """Return the posterior standard deviation of f (p,) [m]: how far the surface may be off near the points."""
        from scipy.linalg import solve_triangular

        parts = []
        for start in range(0, len(points), 1000):
            known = self.observations
            rows = cross_covariance(
                points[start : start + 1000], known.points, known.slope_points, self.std, self.length
            )
            if rows.shape[1] == 0:
                parts.append(np.full(len(rows), self.std))
                continue
            half = solve_triangular(self.factor, rows.T[self.order], lower=True, check_finite=False)
            parts.append(np.sqrt(np.maximum(self.std**2 - np.sum(half * half, axis=0), 0.0)))
        return np.concatenate([np.empty(0), *parts])

    def solved(self, columns: Array) -> tuple[Array, Array]:
        """Return the weights alpha (n, q) and beta (m, 3, q) of residuals (N, q) of the observations."""
        return _weights(self.factor, self.order, columns, len(self.observations.points))

    def _known(self) -> tuple[Array, Array, Array, Array]:
        return self.observations.points, self.observations.slope_points, self.alpha, self.beta


def surface_of(
    prior: PriorShape | ImplicitSurface, observations: Observations, std: float, length: float
) -> ImplicitSurface:
    """Return the surface after its observations.

    Raises
    ------
    SureholdError
        If the observations contradict each other so much that their covariance has no factor.
    """
    from threadpoolctl import threadpool_limits

    free, floor = observations.free[:, :3], observations.free[:, 3]
    with threadpool_limits(1, "blas"):
        surface = _conditioned(prior, replace(observations, free=_rows(4)), std, length)
        for _ in range(_ROUNDS if len(free) else 0):
            short = floor - surface.fast_value(free)
            worst = np.argsort(-short, kind="stable")[: 20 * _MOST_ACTIVE]
            worst = worst[short[worst] > 0.5 * _BOUND_NOISE]
            if not len(worst):
                break
            chosen = spaced(free[worst], 0.15 * length)[:_MOST_ACTIVE]
            active = worst[chosen]
            added = Observations(free[active], floor[active], np.full(len(active), _BOUND_NOISE))
            surface = _with_values(surface, added)
    return surface


class Scales(NamedTuple):
    """Hyperparameters of a surface."""

    std: float  #: of the process [m]
    length: float  #: length scale [m]
    noise: float = 1.0  #: by what the noise of the points is multiplied: 1 to a thousandth, see `learnt_scales`


def learnt_scales(prior: PriorShape, observations: Observations) -> Scales:
    """Return the hyperparameters of highest posterior density, from the values of at most 400 observations.

    Priors are log-normal: the standard deviation about a fifth of the shape's mean half extent, the length scale about
    all of it, each within a factor of 1.6 (one standard deviation). The noise stays within a thousandth of what is
    given: its logarithm begins at 0, and the first steps of Nelder-Mead are in proportion. Let free it falls, since
    scattered zeros alone are explained best by a function without slope.
    """
    from scipy.linalg import cho_solve
    from scipy.optimize import minimize
    from threadpoolctl import threadpool_limits

    n = len(observations.points)
    kept = np.linspace(0, n - 1, min(n, _LEARNT_FROM)).astype(int) if n else np.empty(0, dtype=int)
    some = Observations(observations.points[kept], observations.values[kept], observations.noise[kept])
    size = float(np.exp(np.mean(np.log(prior.half))))
    center, spread = np.log([0.2 * size, size, 1.0]), np.log([1.6, 1.6, 2.0])
    if not n:
        return Scales(0.2 * size, size)
    residual, noise = _residual(prior, some), np.square(some.noise)

    def loss(logs: Array) -> float:
        std, length, more = np.exp(logs).tolist()
        gram = covariance(some.points, some.slope_points, std, length) + np.diag(more**2 * noise)
        try:
            factor = np.linalg.cholesky(gram)
        except np.linalg.LinAlgError:
            return 1e10
        fit = 0.5 * residual @ cho_solve((factor, True), residual) + np.sum(np.log(np.diag(factor)))
        return float(fit + 0.5 * np.sum(((logs - center) / spread) ** 2))

    with threadpool_limits(1, "blas"):
        found = minimize(loss, center, method="Nelder-Mead", options={"maxfev": 80, "xatol": 0.03, "fatol": 0.1})
    return Scales(*np.exp(found.x).tolist())


def _conditioned(
    prior: PriorShape | ImplicitSurface, observations: Observations, std: float, length: float
) -> ImplicitSurface:
    gram = covariance(observations.points, observations.slope_points, std, length)
    noise = np.concatenate([observations.noise, np.repeat(observations.slope_noise, 3)])
    factor = _factor(gram, noise, std, observations)
    return _weighted(prior, observations, std, length, np.arange(len(factor)), factor)


def _with_values(surface: ImplicitSurface, added: Observations) -> ImplicitSurface:
    """Return the surface after more values: their rows are appended to the factor, which costs a tenth of a new one."""
    from scipy.linalg import solve_triangular

    known, std, length = surface.observations, surface.std, surface.length
    n, k, size = len(known.points), len(added.points), len(surface.factor)
    order = np.append(np.where(surface.order < n, surface.order, surface.order + k), np.arange(n, n + k))
    cross = cross_covariance(added.points, known.points, known.slope_points, std, length)
    factor = np.zeros((size + k, size + k))
    factor[:size, :size] = surface.factor
    below = solve_triangular(surface.factor, cross.T[surface.order], lower=True, check_finite=False).T
    own = covariance(added.points, _rows(), std, length) - below @ below.T
    factor[size:, :size], factor[size:, size:] = below, _factor(own, added.noise, std, known + added)
    return _weighted(surface.prior, known + added, std, length, order, factor)


def _factor(gram: Array, noise: Array, std: float, observations: Observations) -> Array:
    from scipy.linalg import cholesky

    gram[np.diag_indices_from(gram)] += np.square(noise) + (1e-6 * std) ** 2
    try:
        return cholesky(gram, lower=True, overwrite_a=True, check_finite=False)
    except np.linalg.LinAlgError:
        raise SureholdError(
            f"the covariance of {len(observations.points)} points and {len(observations.slopes)} normals has no "
            "Cholesky factor; give a larger noise of the points."
        ) from None


def _weighted(
    prior: PriorShape | ImplicitSurface,
    observations: Observations,
    std: float,
    length: float,
    order: NDArray[np.intp],
    factor: Array,
) -> ImplicitSurface:
    alpha, beta = _weights(factor, order, _residual(prior, observations)[:, None], len(observations.points))
    return ImplicitSurface(prior, observations, std, length, order, factor, alpha, beta)


def _residual(prior: PriorShape | ImplicitSurface, observations: Observations) -> Array:
    """Return what the observations (N,) differ from the prior shape."""
    values = observations.values - prior.value(observations.points)
    return np.concatenate([values, (observations.slopes - prior.gradient(observations.slope_points)).ravel()])


def _weights(factor: Array, order: NDArray[np.intp], columns: Array, n: int) -> tuple[Array, Array]:
    from scipy.linalg import cho_solve

    solved = np.empty_like(columns)
    if len(columns):
        solved[order] = cho_solve((factor, True), columns[order], check_finite=False)
    return solved[:n], np.ascontiguousarray(solved[n:].reshape(-1, 3, columns.shape[1]))


def spaced(points: Array, spacing: float) -> NDArray[np.int_]:
    """Return the rows (k,) of points (n, 3), first come first served, no two of which share a cube of that edge [m]."""
    _, first = np.unique(np.floor(points / spacing).astype(np.int64), axis=0, return_index=True)
    return np.sort(first)

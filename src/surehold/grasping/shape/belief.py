"""What is believed of a shape: its mean surface and draws of it, each as an object that the hand can close on.

    f_b = m + p_b + k(., X) (K + S)^-1 (y - m(X) - p_b(X) - e_b)      Matheron's rule: a draw after the observations
    p_b = sqrt(2 / F) s sum_i w_bi cos(o_i . x + a_i)                  a draw of the process without them
    w ~ N(0, 1), a ~ U(0, 2 pi), o_i of the kernel's spectral density: for Matérn-5/2 a t-distribution of 5 degrees of
    freedom, scaled by 1 / l                                          e_b ~ N(0, S), the noise of the observations

(Rahimi and Recht 2008; Wilson and others 2020.) The values of all of them on the grid are weighted sums of the same
kernel values, computed at once. Far from the surface they are computed on every second node and interpolated.

Of a cloud, draws are of another process than the mean (`ShapeBelief.shapes`): one that tells how far the surface may be
off at a place is so rough that its draws have slopes, and normals, that no object has.

A draw knows no bounds. Where the object is known to be r or farther from a point p, a draw is lifted to what that says
of every place x, since distances change by no more than the way between: f_b(x) >= r - |x - p|.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.object.model import GraspObject
from surehold.grasping.shape.implicit_surface import ImplicitSurface, Observations, surface_of
from surehold.grasping.shape.kernel import fast_function_values
from surehold.grasping.shape.level_set import MOST_NODES, Grid, distances_of, grid_around, level_set_mesh, one_piece

__all__ = ["DENSITY", "ShapeBelief", "grid_of"]

Array = NDArray[np.float64]

DENSITY: Final = 1000.0  #: of an object whose mass is not given [kg/m^3]
_FEATURES: Final = 400  #: F
_NEAREST: Final = 4  # free points that are looked at from a node
_BAND: Final = 2.0  # cells on each side of the surface in which every node is computed
REACH: Final = 0.016  #: of the grid beyond the object: a finger's radius and the soft touch [m]


@dataclass(frozen=True, eq=False)
class ShapeBelief:
    """A surface on a grid, and what else is known of the object."""

    surface: ImplicitSurface
    grid: Grid
    name: str = "unknown"
    mass: float | None = None  #: kg; that of `DENSITY` if not known
    friction: float = 0.5
    free: Array = field(default_factory=lambda: np.empty((0, 4)), repr=False)  #: (b, 4) as of `Observations`
    shapes: ImplicitSurface | None = None  #: of which shapes are drawn, where that is not `surface`

    def values(self, draws: int = 0, rng: np.random.Generator | None = None) -> Array:
        """Return f (1 + draws, nx, ny, nz) at the nodes: of the posterior mean first, then of the draws."""
        if draws and self.shapes is not None:
            drawn = replace(self, surface=self.shapes, shapes=None).values(draws, rng)
            drawn[0] = self.values()[0]
            return drawn
        surface = self.surface
        known = surface.observations
        alpha, beta = surface.alpha, surface.beta
        waves = None
        if draws:
            if rng is None:
                raise InputError("draws of a shape need a random generator; give rng=np.random.default_rng(seed).")
            waves = _Waves(surface, draws, rng)
            noise = np.concatenate([known.noise, np.repeat(known.slope_noise, 3)])[:, None]
            residual = np.vstack([waves.value(known.points), waves.slope(known.slope_points)])
            residual += noise * rng.standard_normal((len(noise), draws))
            extra = surface.solved(residual)
            alpha, beta = np.hstack([alpha, alpha - extra[0]]), np.concatenate([beta, beta - extra[1]], axis=2)

        def at(points: Array) -> Array:
            total = fast_function_values(
                points, known.points, known.slope_points, alpha, beta, surface.std, surface.length
            )
            total += surface.prior.fast_value(points)[:, None]
            if waves is not None:
                total[:, 1:] += waves.value(points)
            return total

        values = _on_grid(self.grid, at, 1 + draws)
        if draws:
            _lift(values[1:], self.grid, self.free)
        return values

    def objects(self, draws: int = 0, rng: np.random.Generator | None = None) -> list[GraspObject]:
        """Return the mean shape and draws of it as objects with their distances, all in the same frame and box axes.

        A draw that encloses nothing is no shape of an object that is there, and is left out.

        Raises
        ------
        SureholdError
            If the mean shape has no inside.
        """
        known = self.surface.observations
        measured = self.grid.nearest(known.points[known.values == 0.0])
        mean, *drawn = self.values(draws, rng)
        possible = [mean, *(values for values in drawn if np.any(values < 0.0))]
        return [self._object(one_piece(values, measured)) for values in possible]

    def mean_object(self) -> GraspObject:
        """Return the mean shape as an object."""
        return self.objects()[0]

    def _object(self, values: Array) -> GraspObject:
        vertices, faces = level_set_mesh(values, self.grid)
        cell = self.grid.cell
        share = np.clip(0.5 - values / cell, 0.0, 1.0)  # of a node's cell that is inside, roughly
        total = float(share.sum())
        center = share.ravel() @ self.grid.nodes / total
        mass = DENSITY * total * cell**3 if self.mass is None else self.mass
        axes = self.surface.first.axes
        field = distances_of(values, self.grid)
        return GraspObject(self.name, vertices, faces, mass, center, self.friction, axes=axes, distances=field)

    def knowing(self, told: Observations, free: Array) -> "ShapeBelief":
        """Return the belief, on the same grid, that knows what is told in place of its observations.

        `told` holds bounds of the distance, too; `free` (b, 4) are those by which draws are lifted.
        """

        def again(known: ImplicitSurface) -> ImplicitSurface:
            return surface_of(known.prior, told, known.std, known.length)

        return replace(
            self, surface=again(self.surface), shapes=None if self.shapes is None else again(self.shapes), free=free
        )


def grid_of(surface: ImplicitSurface, cell: float, growth: float = 2.0, most: int = MOST_NODES) -> Grid:
    """Return a grid around what the surface may be: its prior shape and points, `growth` deviations larger.

    Its cells are larger than `cell` [m] if it had more than `most` nodes.
    """
    corners = surface.first.half * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    placed = surface.first.center + corners @ surface.first.axes.T
    lower, upper = placed.min(axis=0), placed.max(axis=0)
    spread = growth * float(np.median(surface.deviation(placed)))
    on_surface = surface.observations.points[surface.observations.values <= 0.0]
    if len(on_surface):
        lower = np.minimum(lower - spread, on_surface.min(axis=0))
        upper = np.maximum(upper + spread, on_surface.max(axis=0))
    else:
        lower, upper = lower - spread, upper + spread
    return grid_around(lower, upper, cell, REACH + 2.0 * cell, most)


def _lift(values: Array, grid: Grid, free: Array) -> None:
    """Raise values (b, nx, ny, nz) to what free points (f, 4) say of them, in place."""
    from scipy.spatial import KDTree

    if not len(free):
        return
    reach = float(free[:, 3].max())
    low = np.any(values < reach, axis=0)
    near = KDTree(free[:, :3])
    gaps, which = near.query(grid.nodes[low.ravel()], k=min(_NEAREST, len(free)), distance_upper_bound=reach + 1e-12)
    floor = np.append(free[:, 3], 0.0)[which] - gaps  # of what is farther: -inf
    values[:, low] = np.maximum(values[:, low], floor if floor.ndim == 1 else floor.max(axis=1))


class _Waves:
    """Draws of the process without observations, as sums of waves."""

    def __init__(self, surface: ImplicitSurface, draws: int, rng: np.random.Generator):
        normal = rng.standard_normal((_FEATURES, 3))
        self._o = normal / np.sqrt(rng.chisquare(5.0, (_FEATURES, 1)) / 5.0) / surface.length  # (F, 3)
        self._a = rng.uniform(0.0, 2.0 * np.pi, _FEATURES)
        self._w = np.sqrt(2.0 / _FEATURES) * surface.std * rng.standard_normal((_FEATURES, draws))

    def value(self, points: Array) -> Array:
        """Return the draws (p, b) at points (p, 3)."""
        turned, start, weights = (a.astype(np.float32) for a in (self._o.T, self._a, self._w))  # some micrometers
        parts = [np.cos(part.astype(np.float32) @ turned + start) @ weights for part in _parts(points)]
        return np.vstack([np.empty((0, self._w.shape[1])), *parts]).astype(np.float64)

    def slope(self, points: Array) -> Array:
        """Return the slopes of the draws (3 p, b), three rows a point."""
        sine = -np.sin(points @ self._o.T + self._a)
        return np.einsum("pf,fi,fb->pib", sine, self._o, self._w, optimize=True).reshape(-1, self._w.shape[1])


def _parts(points: Array) -> list[Array]:
    return [points[start : start + 500] for start in range(0, len(points), 500)]


def _on_grid(grid: Grid, at: Callable[[Array], Array], functions: int) -> Array:
    """Return functions (q, nx, ny, nz) on the grid: on every second node first, then on all nodes near a surface."""
    nx, ny, nz = grid.shape
    coarse = Grid(grid.first, 2.0 * grid.cell, ((nx + 1) // 2, (ny + 1) // 2, (nz + 1) // 2))
    values = at(coarse.nodes).T.reshape(functions, *coarse.shape)
    for axis in (1, 2, 3):
        values = _doubled(values, axis)
    near = np.any(np.abs(values) < _BAND * grid.cell, axis=0)
    near[::2, ::2, ::2] = False  # they are known
    values[:, near] = at(grid.nodes[near.ravel()]).T
    return values


def _doubled(values: Array, axis: int) -> Array:
    """Return values with the means of neighbors along an axis between them."""
    first = np.moveaxis(values, axis, 0)
    out = np.empty((2 * len(first) - 1, *first.shape[1:]))
    out[::2], out[1::2] = first, 0.5 * (first[1:] + first[:-1])
    return np.moveaxis(out, 0, axis)

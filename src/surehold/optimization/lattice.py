"""Inputs that cannot be tried everywhere: integers, steps and choices inside a cube that knows only real numbers.

The model is asked at the nearest point that can be tried, so that it is constant wherever rounding would give the same
trial (Garrido-Merchan and Hernandez-Lobato 2020, Neurocomputing 380, 20-35). Perturbed points are rounded after they
have been perturbed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.box import Box
from surehold.optimization.known_coordinates import Fixed, fixed_of
from surehold.optimization.surrogates.protocol import FitDiagnostics, Moments, Posterior, Regions, means

Allowed = Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None

_SOME: Final = 1024  # random points among which one is sought that has not been tried

__all__ = ["Lattice", "LatticePosterior", "lattice_of"]


@dataclass(frozen=True)
class Lattice:
    """Which points of the unit cube can be tried."""

    snap: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    """maps points (..., d) to the nearest ones that can be tried; those stay where they are"""
    smooth: NDArray[np.bool_]
    """whether a coordinate can be tried everywhere, (d,)"""

    def distinct(
        self, points: NDArray[np.float64], before: NDArray[np.float64], rng: np.random.Generator, allowed: Allowed
    ) -> NDArray[np.float64]:
        """Return points (n, d), each replaced that is the same trial as one `before` (k, d) or in an earlier row."""
        if self.smooth.any():  # no two random points are the same trial
            return points
        known, others, found = {_key(point) for point in self.snap(before)}, iter(self._some(rng, allowed)), []
        for point in self.snap(points):
            if _key(point) in known:
                point = next((other for other in others if _key(other) not in known), point)
            known.add(_key(point))
            found.append(point)
        return np.array(found)

    def untried(
        self, tried: NDArray[np.float64], rng: np.random.Generator, allowed: Allowed
    ) -> NDArray[np.float64] | None:
        """Return an allowed point (d,) that is none of those tried (t, d); None where a random search finds none."""
        known = {_key(point) for point in self.snap(tried)}
        return next((point for point in self._some(rng, allowed) if _key(point) not in known), None)

    def _some(self, rng: np.random.Generator, allowed: Allowed) -> NDArray[np.float64]:
        points = self.snap(rng.random((_SOME, len(self.smooth))))
        return points if allowed is None else points[allowed(points)]


def _key(point: NDArray[np.float64]) -> bytes:
    """Return what is equal for points of a lattice that are the same: snapped, they are so to the last bit."""
    return (point + 0.0).tobytes()  # -0.0 is 0.0


def lattice_of(box: Box, fixed: Mapping[str, Any] | None = None) -> Lattice | None:
    """Return the points of a box that can be tried, those at which variables have fixed values {name: value}.

    None: all of the box.

    Raises
    ------
    InputError
        If a name is unknown, a value is none that can be tried, or no variable is left.
    """
    lattice = None if box.smooth.all() else Lattice(box.snap, box.smooth)
    constant = fixed_of(box, fixed)
    if constant is None:
        return lattice
    smooth = ~constant.held if lattice is None else lattice.smooth & ~constant.held
    return Lattice(partial(_with_fixed, constant, lattice), smooth)


def _with_fixed(constant: Fixed, lattice: Lattice | None, U: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearest points (..., d) that can be tried with the fixed values."""
    return np.where(constant.held, constant.values, U if lattice is None else lattice.snap(U))


class LatticePosterior:
    """A posterior that is asked at the points of a lattice only."""

    def __init__(self, posterior: Posterior, lattice: Lattice):
        self.unrounded: Final = posterior
        self._lattice: Final = lattice
        self.diagnostics: FitDiagnostics = posterior.diagnostics
        self.regions: Regions = posterior.regions

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(snap(query + offsets[i])) for each query."""
        points = self._lattice.snap(queries[:, None, :] + offsets)
        held = np.broadcast_to(1.0 if slopes is None else slopes, points.shape) * self._lattice.smooth
        return self.unrounded.average(queries, points - queries[:, None, :], weights, gradient, held)

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f(snap(query)) for each query."""
        moments = self.unrounded.moments(self._lattice.snap(queries), gradient)
        if moments.mean_gradient is None or moments.variance_gradient is None:
            return moments
        smooth = self._lattice.smooth
        return moments._replace(
            mean_gradient=moments.mean_gradient * smooth, variance_gradient=moments.variance_gradient * smooth
        )

    def means(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the means (m, q) at the snapped queries (q, d)."""
        return means(self.unrounded, self._lattice.snap(queries))

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at the snapped points (q, s, d)."""
        return self.unrounded.sample(self._lattice.snap(points), normals)

    def thinned(self, count: int, first: int = 0) -> "LatticePosterior":
        """Return the posterior of about `count` of the particles, from number `first` on: a cheaper approximation."""
        return LatticePosterior(self.unrounded.thinned(count, first), self._lattice)

    def with_pending(self, X: NDArray[np.float64]) -> "LatticePosterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d)."""
        return LatticePosterior(self.unrounded.with_pending(self._lattice.snap(X)), self._lattice)

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (q,) at the snapped X (q, d), in squared outputs."""
        return self.unrounded.noise_variance(self._lattice.snap(X))

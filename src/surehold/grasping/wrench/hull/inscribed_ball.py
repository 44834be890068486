"""The largest origin-centered ball in a convex hull of wrenches, the hull's distance and its volume.

Notation
--------
w        wrenches whose convex hull H is measured, (m, 6); round contacts may be in H beside them
h(u)     support function of H, for a unit vector u (6,)
epsilon  radius of the largest ball about the origin in H: min of h(u) over u, 0 if that is negative

Distances below 1e-11 of the largest wrench are exactly 0. epsilon comes from the compiled expansion of the nearest
facet. Should rounding spoil that, whatever the tolerance, the full hull of joggled wrenches (Qhull) decides, or for
round cones the bounds reached so far. Numerical failure is never scored as 0.
"""

import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.grasping.wrench.friction_cones import RoundContacts, finite_array
from surehold.grasping.wrench.hull.expansion import FACETS, ROUND_GAP, TOLERANCES, expand, largest
from surehold.grasping.wrench.hull.nearest_facet import DONE, FAILED, OUTSIDE
from surehold.grasping.wrench.hull.workspace import workspace

__all__ = ["InscribedBall", "ball_inside", "ball_radius", "hull_volume", "inscribed_ball", "nearest_point"]

MAX_WRENCHES = 65_535  # the compiled expansion packs four indices of wrenches into 64 bits

_NO_ROUND = RoundContacts(np.zeros((0, 6)), np.zeros((0, 6, 3)))
_memory = threading.local()


class InscribedBall(NamedTuple):
    """The largest origin-centered ball in a convex hull of wrenches, and how it was found."""

    signed: float
    """Radius; exactly 0 on the boundary or in a flat hull; outside, minus the distance from origin to hull."""
    lower: float
    """Certified lower bound of the radius: the nearest facet of an inscribed polytope; 0 if there is no ball."""
    upper: float
    """Certified upper bound of the radius: h(normal); 0 if there is no ball."""
    normal: NDArray[np.float64]
    """Unit vector in which the hull resists least, (6,); zero if the hull is flat and holds the origin."""
    expansions: int
    """Wrenches added after the first seven."""
    facets: int
    """Facets made on the way."""
    fallbacks: int
    """0: as planned; else how often rounding spoiled the expansion: a coarser tolerance helps, or the full hull."""

    @property
    def radius(self) -> float:
        """The radius, 0 where there is no ball."""
        return max(self.signed, 0.0)


def ball_radius(wrenches: NDArray[np.float64], round_contacts: RoundContacts | None = None) -> float:
    """Return epsilon of wrenches (m, 6), which must be finite; the fast path, nothing else is computed or checked.

    With round contacts it is theirs, and the wrenches, their cone edges, are used where rounding spoils the expansion.
    """
    status, epsilon, *_ = _expand(wrenches, round_contacts)
    if status == FAILED:
        return _ball_from_hull(wrenches)[0]
    return epsilon if status == DONE else 0.0


def inscribed_ball(wrenches: ArrayLike, round_contacts: RoundContacts | None = None) -> InscribedBall:
    """Return the largest origin-centered ball in the hull of wrenches (m, 6), signed, with bounds and diagnostics.

    Round contacts as in `ball_radius`. Raises InputError if the wrenches are not finite, not of shape (m, 6), or
    more than 65,535.
    """
    w = finite_array("wrenches", wrenches, (None, 6))
    found = _ball(w, round_contacts)
    if found.signed > 0.0:
        return found
    nearest = nearest_point(w, round_contacts) if len(w) else np.zeros(6)
    distance = float(np.sqrt(nearest @ nearest))
    if not distance:
        return found._replace(upper=max(found.upper, 0.0))
    return found._replace(signed=-distance, upper=0.0, normal=-nearest / distance)


def ball_inside(
    wrenches: NDArray[np.float64], round_contacts: RoundContacts | None = None
) -> tuple[InscribedBall | None, int]:
    """Return the ball and the fallbacks; None in place of a ball that is not there: how far is not asked for."""
    found = _ball(wrenches, round_contacts)
    if found.signed > 0.0:
        return found, found.fallbacks
    return (None if found.upper <= 0.0 else inscribed_ball(wrenches, round_contacts)), found.fallbacks


def _ball(w: NDArray[np.float64], round_contacts: RoundContacts | None) -> InscribedBall:
    """Return the ball; where there is none its radius and lower bound are 0, and how far the hull is stays open."""
    status, epsilon, lower, upper, normal, expansions, facets, fallbacks = _expand(w, round_contacts)
    if status == FAILED:
        epsilon, normal = _ball_from_hull(w)
        lower = epsilon
        upper = lower if round_contacts is None else max(lower, _round_support(normal, round_contacts))
        status = DONE if lower > 0.0 else OUTSIDE
    if status != DONE:
        return InscribedBall(0.0, 0.0, upper, normal, expansions, facets, fallbacks)
    return InscribedBall(epsilon, lower, upper, normal, expansions, facets, fallbacks)


def nearest_point(wrenches: NDArray[np.float64], round_contacts: RoundContacts | None = None) -> NDArray[np.float64]:
    """Return the point of the hull of wrenches (m, 6), m >= 1, nearest to the origin; exactly 0 if that is inside.

    Wolfe 1976, "Finding the nearest point in a polytope": keep a corral of few wrenches whose convex hull holds the
    point of their affine hull nearest to the origin; add the wrench that lies farthest towards the origin from there;
    drop those whose weight turns negative.
    """
    centers, axes = round_contacts or _NO_ROUND
    scale = largest(wrenches)
    stop = scale * (ROUND_GAP if len(centers) else TOLERANCES[0])
    corral = wrenches[[np.argmin(np.sum(wrenches**2, axis=1))]]
    weights = np.ones(1)
    x = corral[0]
    for _ in range(1000):
        length = np.sqrt(x @ x)
        if length <= stop:
            return np.zeros(6)
        u = x / length
        added = wrenches[np.argmin(wrenches @ u)]
        if len(centers):
            components = np.einsum("j,ijk->ik", u, axes)
            depths = np.sqrt(np.sum(components**2, axis=1))
            i = int(np.argmin(centers @ u - depths))
            if centers[i] @ u - depths[i] < added @ u and depths[i] > 0.0:
                added = centers[i] - axes[i] @ components[i] / depths[i]
        if length - added @ u <= stop or (corral == added).all(axis=1).any():
            break
        corral = np.vstack((corral, added))
        weights = np.append(weights, 0.0)
        while len(corral) > 1:
            rest = np.linalg.lstsq((corral[1:] - corral[0]).T, -corral[0], rcond=1e-13)[0]
            target = np.concatenate(([1.0 - rest.sum()], rest))
            falling = (target <= 1e-13) & (weights > target)
            if not falling.any():
                weights = target
                break
            step = np.min(weights[falling] / (weights[falling] - target[falling]))
            weights = weights + step * (target - weights)
            kept = weights > 1e-13
            if kept.all() or not kept.any():
                return x
            corral, weights = corral[kept], weights[kept]
        x = weights @ corral / weights.sum()
    return x


def hull_volume(wrenches: ArrayLike) -> float:
    """Return the volume of the convex hull of points (m, k), exactly 0 if they lie in a hyperplane (Qhull)."""
    from scipy.spatial import ConvexHull

    w = np.asarray(wrenches, float)
    if len(w) <= w.shape[1]:
        return 0.0
    u, spread, _ = np.linalg.svd(w - w.mean(axis=0), full_matrices=False)
    if spread[-1] <= TOLERANCES[0] * spread[0]:
        return 0.0
    # Qhull joggles points by a fraction of their largest coordinate, so give it equal widths in all directions
    return float(ConvexHull(u, qhull_options="QJ Pp").volume * np.prod(spread))


def _expand(
    w: NDArray[np.float64], round_contacts: RoundContacts | None
) -> tuple[int, float, float, float, NDArray[np.float64], int, int, int]:
    """Run `expand` in the memory of this thread."""
    if len(w) > MAX_WRENCHES:
        raise InputError(f"{len(w)} wrenches are too many, {MAX_WRENCHES} can be measured; merge contacts.")
    if not hasattr(_memory, "work"):
        _memory.work = workspace(FACETS)
    # other layouts and read-only arrays would be compiled for anew
    w, centers, axes = (np.array(a, np.float64, order="C") for a in (w, *(round_contacts or _NO_ROUND)))
    return expand(w, centers, axes, _memory.work)


def _ball_from_hull(w: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return (radius, normal of the nearest facet) by the full hull; accurate to Qhull's joggle, about 1e-10."""
    from scipy.spatial import ConvexHull

    equations = ConvexHull(w, qhull_options="QJ Pp").equations
    nearest = int(np.argmax(equations[:, -1]))
    radius = -float(equations[nearest, -1])
    return (radius if radius > 1e-9 * largest(w) else 0.0), equations[nearest, :-1].copy()  # joggled zero is zero


def _round_support(u: NDArray[np.float64], round_contacts: RoundContacts) -> float:
    """Return h(u) of round contacts."""
    centers, axes = round_contacts
    return float(np.max(centers @ u + np.sqrt(np.sum(np.einsum("j,ijk->ik", u, axes) ** 2, axis=1))))

"""Contact wrenches, the ball and the volume of their convex hull.

Notation
--------
p, n     contact point [m] and inward unit normal (from the surface into the object), both (3,)
t        unit tangent, perpendicular to n; n x t is the other one, (3,)
mu       coefficient of friction
L, o     torque length [m] and torque origin [m]; a wrench is (f, (p - o) x f / L), all six components in units of force
f        edge k of k_max of the friction cone: f = n + mu (cos a t + sin a n x t), a = 2 pi k / k_max
g        wrench weight of a contact in [0, 1]; it scales all wrenches of the contact (graded, soft contacts)
epsilon  radius of the largest ball about the origin inside the convex hull of all contacts' wrenches (Ferrari and
Canny 1992, L1)

Continuity. epsilon is max(0, min over unit u of h(u)) with the support function h(u) = max over wrenches of u.w,
therefore
it changes by no more than the largest displacement of a wrench. A contact whose weight falls to zero draws its
wrenches to the origin. The ball about the origin does not change when the origin itself is added to the hull (if
epsilon
> 0 the origin is inside; if epsilon = 0 some u has h(u) <= 0, and h(u) becomes max(h(u), 0) = 0), hence a contact of
weight
zero, which is left out, is the limit of a contact of small weight, and epsilon is continuous there. `signed_epsilon`
is so only where it is
not negative: a distance from the origin to the hull shrinks to zero as soon as a wrench of tiny weight appears near
the origin.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.nearest_facet import DONE, FAILED, FLAT, SPENT, TOLERANCE, expand_nearest

__all__ = [
    "InscribedBall",
    "WrenchQuality",
    "ball_radius",
    "contact_wrenches",
    "hull_volume",
    "inscribed_ball",
    "tangents",
    "wrench_quality",
]

Convention = Literal["normal_unit", "unit_magnitude"]
CONVENTIONS = ("normal_unit", "unit_magnitude")
FACET_BUDGETS = (4096, 65_536, 1_048_576)  # memory for so many facets is tried in turn; grasps need some thousands
MAX_WRENCHES = 65_535  # the compiled expansion packs four indices of wrenches into 64 bits

_NO_CENTERS = np.zeros((0, 6))
_NO_AXES = np.zeros((0, 6, 3))

# The tangent field below is singular at -POLE only. The pole is in general position: faces, chamfers at 45 degrees
# and barrels of
# objects modeled along their axes keep clear of it.
_POLE = np.array([0.36, 0.48, 0.8])
_POLE_TANGENT = np.array([0.8, -0.6, 0.0])


class InscribedBall(NamedTuple):
    """The largest origin-centered ball in a convex hull of wrenches, and how it was found."""

    signed: float
    """Radius; exactly 0 on the boundary or in a flat hull; outside, minus the distance from origin to hull."""
    lower: float
    """Certified lower bound of the radius, 0 if there is no ball."""
    upper: float
    """Certified upper bound of the radius, 0 if there is no ball; `lower` to rounding for finitely many wrenches."""
    normal: NDArray[np.float64]
    """Unit wrench direction in which the hull resists least, (6,); zero if the wrenches are flat."""
    expansions: int
    """Wrenches added after the first seven."""
    facets: int
    """Facets made on the way."""
    fallback: bool
    """Whether rounding spoiled the expansion and the full hull (Qhull, joggled) was used instead."""

    @property
    def radius(self) -> float:
        """The radius, 0 where there is no ball."""
        return max(self.signed, 0.0)


@dataclass(frozen=True)
class WrenchQuality:
    """How well a set of contacts resists wrenches from all directions, in units of a contact's force."""

    epsilon: float
    """Radius of the largest origin-centered ball in the hull of the wrenches; 0 means not force closure."""
    signed_epsilon: float
    """The same, but minus the distance from the origin to the hull where the origin is outside."""
    force_closure: bool
    """Whether epsilon > 0."""
    lower: float
    """Certified lower bound of epsilon."""
    upper: float
    """Certified upper bound of epsilon; with round cones the gap to `lower` is what was asked for."""
    weakest: NDArray[np.float64] = field(repr=False, compare=False)
    """Unit wrench direction in which the grasp resists least, (6,)."""
    fallback: bool
    """Whether rounding spoiled the fast expansion and the full hull was used instead."""
    wrenches: NDArray[np.float64] = field(repr=False, compare=False)
    """Wrenches of the cone edges, (m, 6)."""

    @cached_property
    def volume(self) -> float:
        """6-D volume of the hull of the wrenches of the cone edges, 0 if flat; computed at the first request."""
        return hull_volume(self.wrenches)


def tangents(normals: ArrayLike) -> NDArray[np.float64]:
    """Return a unit tangent for each unit normal, (c, 3) -> (c, 3).

    The tangent is carried from a fixed pole to the normal by the smallest rotation. No tangent field is
    continuous on the whole sphere;
    this one is, except at a single direction, (-0.36, -0.48, -0.8), away from faces and barrels that follow the
    axes. Give
    normals in the object's frame, then the tangents move with the object.
    """
    n = np.asarray(normals, float)
    closeness = 1.0 + n @ _POLE
    safe = np.where(closeness > 1e-14, closeness, 1.0)
    turned = _POLE_TANGENT - ((n @ _POLE_TANGENT) / safe)[:, None] * (n + _POLE)
    turned -= np.sum(turned * n, axis=1)[:, None] * n
    return turned / np.linalg.norm(turned, axis=1)[:, None]


def contact_wrenches(
    points: ArrayLike,
    normals: ArrayLike,
    friction: float | ArrayLike = 0.5,
    edges: int = 8,
    torque_length: float = 1.0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    tangents: ArrayLike | None = None,
    convention: Convention = "normal_unit",
    weights: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Return the wrenches of the edges of all friction cones, (c * edges, 6), contact by contact.

    Parameters and errors as in `wrench_quality`. Contacts of weight zero are left out.
    """
    contacts = _checked(points, normals, friction, edges, torque_length, origin, tangents, convention, weights)
    return _edge_wrenches(contacts, edges)


def wrench_quality(
    points: ArrayLike,
    normals: ArrayLike,
    friction: float | ArrayLike = 0.5,
    edges: int = 8,
    torque_length: float = 1.0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    tangents: ArrayLike | None = None,
    convention: Convention = "normal_unit",
    weights: ArrayLike | None = None,
) -> WrenchQuality:
    """Measure the convex hull of the contacts' wrenches (Ferrari and Canny 1992).

    Parameters
    ----------
    points
        Contact points, (c, 3) [m]; c may be 0.
    normals
        Unit normals pointing into the object, (c, 3).
    friction
        Coefficient of friction, at least 0, a number or (c,).
    edges
        Edges of the polyhedral friction cone, at least 3.
    torque_length
        Length by which torques are divided [m], above 0; usually the size of the object.
    origin
        Point about which torques are taken [m], (3,).
    tangents
        Where edge 0 of each cone points: unit, perpendicular to the normals, (c, 3); default `tangents(normals)`.
    convention
        "normal_unit": forces with unit normal component; "unit_magnitude": edge forces of magnitude one.
    weights
        Scale of each contact's wrenches in [0, 1], (c,); default 1.

    Raises
    ------
    InputError
        If a shape, a value or a name is not as said above. Contacts that cannot resist some wrench, or no contacts at
        all, are no error: their epsilon is 0.

    """
    contacts = _checked(points, normals, friction, edges, torque_length, origin, tangents, convention, weights)
    wrenches = _edge_wrenches(contacts, edges)
    ball = inscribed_ball(wrenches)
    return WrenchQuality(
        ball.radius, ball.signed, ball.radius > 0.0, ball.lower, ball.upper, ball.normal, ball.fallback, wrenches
    )


def ball_radius(wrenches: NDArray[np.float64]) -> float:
    """Return epsilon of wrenches (m, 6), C-contiguous and finite; the fast path, nothing else is computed."""
    status, lower, upper, _, _, _ = _expand(wrenches)
    if status == FAILED:
        return _ball_from_hull(wrenches)[0]
    return upper if status == DONE and lower > TOLERANCE * _largest(wrenches) else 0.0


def inscribed_ball(wrenches: ArrayLike) -> InscribedBall:
    """Return the largest origin-centered ball in the hull of wrenches (m, 6), signed, with bounds and diagnostics.

    Raises InputError if the wrenches are not finite or not of shape (m, 6).
    """
    w = np.ascontiguousarray(_array("wrenches", wrenches, (None, 6)))
    status, lower, upper, normal, expansions, facets = _expand(w)
    fallback = status == FAILED
    if fallback:
        upper, normal = _ball_from_hull(w)
        lower = upper
    if status in (DONE, FAILED) and lower > TOLERANCE * _largest(w):
        return InscribedBall(upper, lower, upper, normal, expansions, facets, fallback)
    nearest = nearest_point(w) if len(w) else np.zeros(6)
    distance = float(np.linalg.norm(nearest))
    if distance > 0.0:
        normal = -nearest / distance
    return InscribedBall(-distance if distance else 0.0, 0.0, 0.0, normal, expansions, facets, fallback)


def nearest_point(wrenches: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the point of the convex hull of wrenches (m, k), m >= 1, nearest to the origin; exactly 0 if inside.

    Wolfe 1976, "Finding the nearest point in a polytope": keep a corral of few wrenches whose convex hull holds the
    point of their affine hull nearest to the origin; add the wrench that lies farthest towards the origin from
    there; drop those
    whose weight turns negative.
    """
    squares = np.sum(wrenches**2, axis=1)
    tolerance = TOLERANCE * np.sqrt(squares.max())
    corral = [int(np.argmin(squares))]
    weights = np.ones(1)
    x = wrenches[corral[0]]
    for _ in range(1000):
        length = np.sqrt(x @ x)
        if length <= tolerance:
            return np.zeros_like(x)
        along = wrenches @ (x / length)
        added = int(np.argmin(along))
        if length - along[added] <= tolerance or added in corral:
            break
        corral.append(added)
        weights = np.append(weights, 0.0)
        while True:
            q = wrenches[corral]
            rest = np.linalg.lstsq((q[1:] - q[0]).T, -q[0], rcond=1e-13)[0]
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
            corral = [i for i, keep in zip(corral, kept, strict=True) if keep]
            weights = weights[kept]
            if len(corral) == 1:
                break
        x = weights @ wrenches[corral]
    return x


def _expand(w: NDArray[np.float64]) -> tuple[int, float, float, NDArray[np.float64], int, int]:
    """Run `expand_nearest` on wrenches (m, 6) with the memory it needs; FAILED means: use the full hull."""
    if len(w) < 7:
        return FLAT, 0.0, 0.0, np.zeros(6), 0, 0
    if len(w) <= MAX_WRENCHES:
        for budget in FACET_BUDGETS:
            result = expand_nearest(w, _NO_CENTERS, _NO_AXES, 0.0, budget)
            if result[0] != SPENT:
                return result
    return FAILED, 0.0, 0.0, np.zeros(6), 0, 0


def _largest(w: NDArray[np.float64]) -> float:
    """Return the norm of the largest wrench."""
    return float(np.sqrt(np.max(np.sum(w * w, axis=1))))


def hull_volume(wrenches: ArrayLike) -> float:
    """Return the volume of the convex hull of points (m, k), exactly 0 if they lie in a hyperplane (Qhull)."""
    from scipy.spatial import ConvexHull

    w = np.asarray(wrenches, float)
    if len(w) <= w.shape[1]:
        return 0.0
    spread = np.linalg.svd(w - w.mean(axis=0), compute_uv=False)
    if spread[-1] <= TOLERANCE * spread[0]:
        return 0.0
    return float(ConvexHull(w, qhull_options="QJ Pp").volume)


def _ball_from_hull(w: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return (radius, normal of the nearest facet) by the full hull; accurate to Qhull's joggle, about 1e-10."""
    from scipy.spatial import ConvexHull

    equations = ConvexHull(w, qhull_options="QJ Pp").equations
    nearest = int(np.argmax(equations[:, -1]))
    radius = -float(equations[nearest, -1])
    # what joggling cannot tell from zero is zero
    return (radius if radius > 1e-9 * np.abs(w).max() else 0.0), equations[nearest, :-1].copy()


class _Contacts(NamedTuple):
    """Checked contacts: everything as float64 arrays, contacts of weight zero removed."""

    normals: NDArray[np.float64]  # (c, 3)
    tangents: NDArray[np.float64]  # (c, 3)
    arms: NDArray[np.float64]  # (p - o) / L, (c, 3)
    friction: NDArray[np.float64]  # (c,)
    scale: NDArray[np.float64]  # weight, divided by the magnitude of an edge force for "unit_magnitude", (c,)


def _edge_wrenches(contacts: _Contacts, edges: int) -> NDArray[np.float64]:
    """Return the wrenches of the cone edges, (c * edges, 6)."""
    n, t, arms, friction, scale = contacts
    angles = 2.0 * np.pi * np.arange(edges) / edges
    b = _cross(n, t)
    around = np.cos(angles)[None, :, None] * t[:, None, :] + np.sin(angles)[None, :, None] * b[:, None, :]
    forces = scale[:, None, None] * (n[:, None, :] + friction[:, None, None] * around)  # (c, edges, 3)
    return np.concatenate((forces, _cross(arms[:, None, :], forces)), axis=2).reshape(-1, 6)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross product over the last axis; numpy.cross takes several times as long for few vectors."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def _array(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return values as a finite float64 array of the given shape (None: any length) or raise InputError."""
    wanted = "(" + ", ".join("c" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
    try:
        a = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers of shape {wanted}; numpy says: {error}.") from None
    if a.ndim != len(shape) or any(n is not None and n != k for n, k in zip(shape, a.shape, strict=True)):
        raise InputError(f"{name} must have shape {wanted}, not {a.shape}.")
    if not np.isfinite(a).all():
        raise InputError(f"{name} must be finite, but holds NaN or infinity; check the contacts before measuring them.")
    return a


def _checked(
    points: ArrayLike,
    normals: ArrayLike,
    friction: float | ArrayLike,
    edges: int,
    torque_length: float,
    origin: ArrayLike,
    tangent: ArrayLike | None,
    convention: str,
    weights: ArrayLike | None,
) -> _Contacts:
    """Check everything that describes contacts; raise InputError."""
    p = _array("points", points, (None, 3))
    c = len(p)
    n = _array("normals", normals, (c, 3))
    mu = np.full(c, float(friction)) if isinstance(friction, (int, float)) else _array("friction", friction, (c,))
    o = _array("origin", origin, (3,))
    if np.any(np.abs(np.sum(n * n, axis=1) - 1.0) > 1e-6):
        raise InputError("normals must have length 1 (to 5e-7); divide each by its length.")
    if not np.all(np.isfinite(mu) & (mu >= 0.0)):
        raise InputError(f"friction must be finite and at least 0, not {friction!r}; 0.5 is a usual value.")
    if isinstance(edges, bool) or not isinstance(edges, (int, np.integer)) or edges < 3:
        raise InputError(f"edges must be an integer of at least 3, not {edges!r}; 8 is usual.")
    if not (isinstance(torque_length, (int, float)) and np.isfinite(torque_length) and torque_length > 0.0):
        raise InputError(f"torque_length must be a finite length above 0 [m], not {torque_length!r}.")
    if convention not in CONVENTIONS:
        raise unknown_name("convention", convention, CONVENTIONS)
    if tangent is None:
        t = tangents(n)
    else:
        t = _array("tangents", tangent, (c, 3))
        if np.any(np.abs(np.sum(t * t, axis=1) - 1.0) > 1e-6) or np.any(np.abs(np.sum(t * n, axis=1)) > 1e-6):
            raise InputError("tangents must have length 1 and be perpendicular to the normals (to 1e-6).")
    scale = np.ones(c) if weights is None else _array("weights", weights, (c,)).copy()
    if np.any((scale < 0.0) | (scale > 1.0)):
        raise InputError("weights must be in [0, 1]; divide them by the largest.")
    kept = scale > 0.0
    if convention == "unit_magnitude":
        scale = scale / np.sqrt(1.0 + mu * mu)
    contacts = _Contacts(n, t, (p - o) / torque_length, mu, scale)
    return contacts if kept.all() else _Contacts(*(a[kept] for a in contacts))

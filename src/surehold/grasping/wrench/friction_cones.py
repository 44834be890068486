"""Wrenches that contacts can apply: edges of polyhedral friction cones, and round cones in closed form.

Notation
--------
p, n     contact point [m] and unit normal pointing into the object, (3,)
t        unit tangent perpendicular to n; n x t is the other one, (3,)
mu       coefficient of friction
gamma    torsional friction [m]: largest moment about n per unit of normal force
L, o     torque length [m] and torque origin [m]
w        wrench (f, ((p - o) x f + moment) / L), all six components in units of force
f        edge k of k_max of the polyhedral friction cone: n + mu (cos a t + sin a n x t), a = 2 pi k / k_max
a, B     round contact: center and axes of the ellipsoid a + B z, |z| <= 1, the wrenches at unit normal force; (6,)
and (6, 3)
"""

from numbers import Real
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.wrench.ellipsoids import ellipsoids, tangent_field

__all__ = [
    "CheckedContacts",
    "RoundContacts",
    "cone_edges",
    "contact_wrenches",
    "round_contacts",
    "soft_finger_torsion",
    "tangents",
]

Convention = Literal["normal_unit", "unit_magnitude"]
CONVENTIONS = ("normal_unit", "unit_magnitude")
_MOST_EDGES = 1000
_LARGEST = 1e12  # what is computed with larger lengths and coefficients overflows, or divides by 0


class RoundContacts(NamedTuple):
    """Contacts with round friction cones: contact i applies centers[i] + axes[i] z, |z| <= 1, at unit normal force."""

    centers: NDArray[np.float64]
    """Wrenches of the pure normal forces, (c, 6)."""
    axes: NDArray[np.float64]
    """Wrenches of friction along t, along n x t, and of torsional friction about n, (c, 6, 3)."""


class CheckedContacts(NamedTuple):
    """Checked contacts; contacts of weight zero are left out."""

    normals: NDArray[np.float64]
    """(c, 3)."""
    tangents: NDArray[np.float64]
    """(c, 3)."""
    arms: NDArray[np.float64]
    """(p - o) / L, (c, 3)."""
    friction: NDArray[np.float64]
    """(c,)."""
    torsion: NDArray[np.float64]
    """gamma / L, (c,)."""
    scale: NDArray[np.float64]
    """Weight; divided by the magnitude of an edge's force for "unit_magnitude", (c,)."""

    @classmethod
    def checked(
        cls,
        points: ArrayLike,
        normals: ArrayLike,
        friction: float | ArrayLike = 0.5,
        torque_length: float = 1.0,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        tangents: ArrayLike | None = None,
        convention: Convention = "normal_unit",
        weights: ArrayLike | None = None,
        torsion: float | ArrayLike = 0.0,
    ) -> "CheckedContacts":
        """Check the arguments of `wrench_quality` that describe contacts; raise InputError."""
        p = finite_array("points", points, (None, 3))
        c = len(p)
        n = finite_array("normals", normals, (c, 3))
        if np.any(np.abs(np.sum(n * n, axis=1) - 1.0) > 1e-6):
            raise InputError("normals must have length 1 (to 5e-7); divide each by its length.")
        mu = _coefficients("friction", friction, c)
        gamma = _coefficients("torsion", torsion, c)
        o = finite_array("origin", origin, (3,))
        if not (isinstance(torque_length, Real) and 1.0 / _LARGEST <= float(torque_length) <= _LARGEST):
            raise InputError(
                f"torque_length must be a length from {1.0 / _LARGEST:g} to {_LARGEST:g} m, not {torque_length!r}."
            )
        if convention not in CONVENTIONS:
            raise unknown_name("convention", convention, CONVENTIONS)
        if tangents is None:
            t = tangent_field(np.array(n, dtype=np.float64, order="C"))
        else:
            t = finite_array("tangents", tangents, (c, 3))
            if np.any(np.abs(np.sum(t * t, axis=1) - 1.0) > 1e-6) or np.any(np.abs(np.sum(t * n, axis=1)) > 1e-6):
                raise InputError("tangents must have length 1 and be perpendicular to the normals (to 1e-6).")
        scale = np.ones(c) if weights is None else finite_array("weights", weights, (c,))
        if np.any((scale < 0.0) | (scale > 1.0)):
            raise InputError("weights must be in [0, 1]; divide them by the largest.")
        kept = scale > 0.0
        if convention == "unit_magnitude":
            scale = scale / np.sqrt(1.0 + mu * mu)
        contacts = cls(n, t, (p - o) / float(torque_length), mu, gamma / float(torque_length), scale)
        return contacts if kept.all() else cls(*(a[kept] for a in contacts))


def tangents(normals: ArrayLike) -> NDArray[np.float64]:
    """Return a unit tangent for each unit normal, (c, 3) -> (c, 3).

    The tangent is carried from a fixed pole to the normal by the smallest rotation. No tangent field is continuous on
    the whole sphere; this one is except at a single direction, (-0.36, -0.48, -0.8), away from faces and barrels that
    follow the axes. Give the normals in the object's frame, then the tangents move with the object.
    """
    return tangent_field(np.array(normals, dtype=np.float64, order="C"))


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
    torsion: float | ArrayLike = 0.0,
) -> NDArray[np.float64]:
    """Return the wrenches of the edges of all friction cones, (m, 6), contact by contact.

    Arguments and errors as in `wrench_quality`. A contact has `edges` wrenches, and with torsional friction anywhere
    two more: the normal force with the largest moment about the normal either way. Contacts of weight zero are left
    out.
    """
    contacts = CheckedContacts.checked(
        points, normals, friction, torque_length, origin, tangents, convention, weights, torsion
    )
    return cone_edges(contacts, edges)


def cone_edges(contacts: CheckedContacts, edges: int) -> NDArray[np.float64]:
    """Return the wrenches of the cone edges of checked contacts, (m, 6); raise InputError for a bad number of edges."""
    if isinstance(edges, bool) or not isinstance(edges, (int, np.integer)) or not 3 <= edges <= _MOST_EDGES:
        raise InputError(f"edges must be an integer from 3 to {_MOST_EDGES}, not {edges!r}; 8 is usual.")
    n, t, arms, mu, gamma, scale = contacts
    angles = 2.0 * np.pi * np.arange(edges) / edges
    b = _cross(n, t)
    around = np.cos(angles)[None, :, None] * t[:, None, :] + np.sin(angles)[None, :, None] * b[:, None, :]
    forces = scale[:, None, None] * (n[:, None, :] + mu[:, None, None] * around)  # (c, edges, 3)
    wrenches = np.concatenate((forces, _cross(arms[:, None, :], forces)), axis=2)
    if gamma.any():
        forces = scale[:, None] * n
        moments = _cross(arms, forces)
        twist = gamma[:, None] * forces
        poles = np.stack((np.hstack((forces, moments + twist)), np.hstack((forces, moments - twist))), axis=1)
        wrenches = np.concatenate((wrenches, poles), axis=1)
    return wrenches.reshape(-1, 6)


def round_contacts(contacts: CheckedContacts) -> RoundContacts:
    """Return the ellipsoids of wrenches of checked contacts with round friction cones.

    Coulomb friction is a disk; with torsional friction it is the friction ellipsoid (f_t / mu)^2 + (moment / gamma)^2
    <= f_n^2 (Howe and Cutkosky 1996). With "unit_magnitude" the forces of the cone's rim have magnitude one, in
    between less.
    """
    return RoundContacts(*ellipsoids(*(np.array(a, dtype=np.float64, order="C") for a in contacts)))


def soft_finger_torsion(friction: float, radius: float) -> float:
    """Return the torsional friction gamma [m] of a soft finger whose patch of contact has the given radius [m].

    gamma = 3 pi / 16 friction radius: Coulomb friction under the pressure of Hertz, p ~ sqrt(1 - (r / radius)^2), on
    the whole disk (Howe and Cutkosky 1996). Raises InputError if a number is negative or not finite.
    """
    for name, value in (("friction", friction), ("radius", radius)):
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{name} of a soft finger is {value!r}; give a finite number of 0 or more.")
    return 3.0 * np.pi / 16.0 * float(friction) * float(radius)


def finite_array(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return values as a finite float64 array of the given shape (None: any length) or raise InputError."""
    try:
        a = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers of shape {_shape_text(shape)}; {error}.") from None
    wanted = a.shape[:1] + shape[1:] if shape[0] is None else shape
    if a.ndim != len(shape) or a.shape != wanted:
        raise InputError(f"{name} must have shape {_shape_text(shape)}, not {a.shape}.")
    if not (np.abs(a) <= _LARGEST).all():
        raise InputError(
            f"{name} must be finite, but holds NaN, infinity or numbers beyond {_LARGEST:g}; check the contacts first."
        )
    return a


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("c" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"


def _coefficients(name: str, value: float | ArrayLike, c: int) -> NDArray[np.float64]:
    """Return coefficients of at least 0, one per contact, (c,)."""
    a = np.full(c, value, float) if isinstance(value, Real) else finite_array(name, value, (c,))
    if not np.all((a >= 0.0) & (a <= _LARGEST)):
        raise InputError(f"{name} must be at least 0 and at most {_LARGEST:g}, not {value!r}.")
    return a


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross product over the last axis; numpy.cross takes several times as long for few vectors."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out

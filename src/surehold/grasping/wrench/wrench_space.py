"""Quality of a set of contacts by the convex hull of the wrenches they can apply.

Notation: see friction_cones.py; epsilon is the radius of the largest ball about the origin inside the convex hull
of the union of all contacts' wrenches (Ferrari and Canny 1992, L1 hull), volume that hull's volume.

Continuity. epsilon = max(0, min over unit u of h(u)) with the support function h(u) = max over wrenches of u.w. It
changes by no more than the largest displacement of a wrench. A contact whose weight falls to zero draws its wrenches
to the origin; and adding the origin to the hull changes no ball about the origin: if epsilon > 0 it is inside
already, and if some h(u) <= 0 then max(h(u), 0) = 0 as before. Therefore a contact of weight zero, which is left out,
is the limit of a contact of small weight, and epsilon is continuous there. `signed_epsilon` is continuous in points
and normals, but its negative part is not in vanishing weights: the distance to the hull is small as soon as a tiny
wrench appears near the origin.

Polyhedral cones depend on where their edges point; round cones do not, and with them epsilon is continuous in all
normals.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.choices import CONES
from surehold.errors import unknown_name
from surehold.grasping.wrench.friction_cones import (
    CheckedContacts,
    Convention,
    RoundContacts,
    cone_edges,
    contact_wrenches,
    round_contacts,
    tangents,
)
from surehold.grasping.wrench.hull.inscribed_ball import (
    InscribedBall,
    ball_inside,
    ball_radius,
    hull_volume,
    inscribed_ball,
)

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


@dataclass(frozen=True)
class WrenchQuality:
    """How well contacts resist wrenches from all directions, in units of the force of one contact."""

    told_too: ClassVar[tuple[str, ...]] = ("signed_epsilon", "weakest")
    """What `grasp_to_dict` tells beside the fields."""

    epsilon: float
    """Radius of the largest origin-centered ball in the hull of the wrenches; 0 means not force closure.

    Of round cones the least resistance that was found, a minimum to rounding: another one that is lower could hide
    between the bounds, as in four of 307 grasps of the mug, the bottle and the drill, by 3e-5 at most.
    """
    force_closure: bool
    """Whether epsilon > 0."""
    lower: float
    """Certified lower bound of epsilon."""
    upper: float
    """Certified upper bound of epsilon; equal to `lower` to rounding, for round cones to 1e-4 of the largest wrench.

    Of symmetric contacts, and of almost symmetric ones, the bounds are up to 4e-2 apart; epsilon is then the upper one,
    the least resistance found from hundreds of directions.
    """
    fallbacks: int
    """0: as planned; else how often rounding spoiled the expansion: a coarser tolerance helps, or the full hull."""
    wrenches: NDArray[np.float64] = field(repr=False, compare=False, metadata={"derived": True})
    """Wrenches of the cone edges, (m, 6)."""
    _round: RoundContacts | None = field(repr=False, compare=False, metadata={"derived": True})
    _ball: InscribedBall | None = field(repr=False, compare=False, metadata={"derived": True})

    @property
    def signed_epsilon(self) -> float:
        """The same, but minus the distance from the origin to the hull where the origin is outside.

        Found at the first request, which takes longer than epsilon.
        """
        return self._whole.signed

    @property
    def weakest(self) -> NDArray[np.float64]:
        """Unit wrench direction in which the grasp resists least, (6,); found with `signed_epsilon`."""
        return self._whole.normal

    @cached_property
    def _whole(self) -> InscribedBall:
        return self._ball or inscribed_ball(self.wrenches, self._round)

    @cached_property
    def volume(self) -> float:
        """6-D volume of the hull of the cone edges' wrenches, 0 if flat; computed at the first request (slow)."""
        return hull_volume(self.wrenches)


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
    torsion: float | ArrayLike = 0.0,
    cones: Literal["polyhedral", "round"] = "polyhedral",
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
    torsion
        Torsional friction of soft fingers [m]: largest moment about the normal per unit of normal force, a
        number or (c,).
        Polyhedral cones get two more edges, round ones the friction ellipsoid (Howe and Cutkosky 1996).
    cones
        "polyhedral" with `edges` edges, or "round": the exact cone, whatever the tangents; `volume` is that
        of the edges.

    Raises
    ------
    InputError
        If a shape, a value or a name is not as said above. Contacts that cannot resist some wrench, or no contacts at
        all, are no error: their epsilon is 0.

    """
    if cones not in CONES:
        raise unknown_name("cones", cones, CONES)
    contacts = CheckedContacts.checked(
        points, normals, friction, torque_length, origin, tangents, convention, weights, torsion
    )
    wrenches = cone_edges(contacts, edges)
    circles = round_contacts(contacts) if cones == "round" else None
    ball, fallbacks = ball_inside(wrenches, circles)
    if ball is None:
        return WrenchQuality(0.0, False, 0.0, 0.0, fallbacks, wrenches, circles, None)
    return WrenchQuality(
        ball.radius, ball.radius > 0.0, ball.lower, ball.upper, ball.fallbacks, wrenches, circles, ball
    )

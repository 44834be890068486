"""One trial: put the open hand at a pose, close it, find the contacts, measure how well they hold the object."""

from math import isfinite
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.choices import CLOSING_MODES, COLLISIONS, CONTACT_MODELS
from surehold.errors import InputError, unknown_name
from surehold.grasping.closing.attempt import Attempt, HandArrays, attempt, felt, hand_arrays, open_gaps, times
from surehold.grasping.closing.contacts import DEPTH, GRADED, Contacts, as_contacts
from surehold.grasping.grasp import Grasp, Status
from surehold.grasping.hand.model import Hand
from surehold.grasping.hand.named import hand_named
from surehold.grasping.hand.synergy import closing_motion, preshape_of
from surehold.grasping.object.distance_field import MARGIN, DistanceField, distance_field_of
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.poses import FARTHEST, Pose, check_pose
from surehold.grasping.wrench.quality import Measure
from surehold.grasping.wrench.simox import check_cones
from surehold.store.uninterrupted import uninterrupted

__all__ = ["Simulator"]

Array = NDArray[np.float64]


_PENALTY: Final = 0.05  # at the deepest penetration: half of a good epsilon
_PENALTY_DEPTH: Final = 0.02  # depths of all bodies together at which the penalty is 63 % of that [m]


class Simulator:
    """A hand and an object: `grasp` closes the one on the other and measures the grasp.

    Parameters
    ----------
    hand
        A `Hand` or the name of one: "icub-left", "icub-right"; "shadow", "panda" where their packages are installed.
    obj
        A `GraspObject` or the name of a shipped one: "mug", "bottle", "glass", "drill".
    contact
        "graded" (soft touch, continuous), "patch" or "single" (one for each touching link).
    quality
        One of `QUALITIES`, explained in quality.py: "epsilon" (radius of the largest ball about the origin in the hull
        of the wrenches), "signed_epsilon", "volume", "simox", "task", "closure", "min_weight" or "balance".
    closing
        "adaptive" (links beyond a touching one go on) or "synergy" (a touch stops the whole finger).
    preshape
        Type of grasp, one of the hand's `preshapes`; the first one if not given ("power" for the iCub).
    friction
        Coefficient of friction; if not given the hand's, where it has one, else the object's own. The quality "simox"
        always takes 1: force closure, and the check by physics, are of that coefficient then.
    torsion
        Torsional friction of soft fingers: largest moment about the normal by normal force [m], see
        `soft_finger_torsion`; 0 for hard points.
    cones
        "round" or "polyhedral", with `edges` edges.
    edges
        Edges of polyhedral friction cones; also of the cones that "volume", "task" and "closure" measure.
    convention
        "normal_unit" (forces with unit normal component) or "unit_magnitude".
    task
        For the quality "task": external forces [N] and torques about the center of mass [N m], (k, 6), each as large
        as it weighs; gravity in 14 directions if not given.
    depth
        Depth of the soft touch [m].
    collision
        Worth of a hand that is inside the object while it is open: "penalty", below 0 and falling with the depth of
        the penetration (after Castanheira et al. 2018), or "zero".
    object_pose
        From the object's frame to the world in which `grasp` takes poses; if not given, the world is that frame.

    Raises
    ------
    InputError
        If a name is unknown or a number is out of range.

    Notes
    -----
    A trial depends on its arguments alone; it is the same bit for bit when repeated. All geometry is computed in the
    object's frame, with torques about the center of mass, divided by half the longest edge of the object's box: a
    motion of hand and object together changes nothing.
    """

    def __init__(
        self,
        hand: Hand | str = "icub-left",
        obj: GraspObject | str = "mug",
        *,
        contact: str = "graded",
        quality: str = "epsilon",
        closing: str = "adaptive",
        preshape: str | None = None,
        friction: float | None = None,
        torsion: float = 0.0,
        cones: Literal["polyhedral", "round"] = "round",
        edges: int = 8,
        convention: Literal["normal_unit", "unit_magnitude"] = "normal_unit",
        task: ArrayLike | None = None,
        depth: float = DEPTH,
        collision: str = "penalty",
        object_pose: Pose | None = None,
    ):
        if contact not in CONTACT_MODELS:
            raise unknown_name("contact model", contact, CONTACT_MODELS)
        if collision not in COLLISIONS:
            raise unknown_name("worth of a collision", collision, COLLISIONS)
        if closing not in CLOSING_MODES:
            raise unknown_name("closing", closing, CLOSING_MODES)
        self.hand: Final[Hand] = hand_named(hand) if isinstance(hand, str) else hand
        self.object: Final[GraspObject] = shipped_object(obj) if isinstance(obj, str) else obj
        self.contact: Final = contact
        self.quality: Final = quality
        self.closing: Final = closing
        rates = preshape_of(self.hand, preshape).rate
        self.preshape: Final = preshape or next(iter(self.hand.preshapes))
        self.collision: Final = collision
        if quality == "simox":
            check_cones(friction, torsion, edges)
        own = self.object.friction if self.hand.friction is None else self.hand.friction
        self.friction: Final[float] = own if friction is None else float(friction)
        self.measure: Final = Measure(
            quality, self.object, self.friction, float(torsion), edges, cones, convention, task
        )
        if not 0.0 < depth <= 0.008:
            raise InputError(f"depth of the soft touch is {depth!r} m; give a length above 0 and up to 0.008 m.")
        self.depth: Final[float] = float(depth)
        self.object_pose: Final[Pose] = Pose() if object_pose is None else object_pose
        check_pose(self.object_pose, "object_pose")
        self._to_object: Final[Pose] = self.object_pose.inverse()
        self.to_object: Final[Array] = self._to_object.matrix  #: (3, 4) from the world to the object's frame
        self.field: Final[DistanceField] = self._field()
        self.arrays: Final[HandArrays] = hand_arrays(self.hand, rates)  #: the hand for compiled functions
        self.model: Final[int] = CONTACT_MODELS.index(contact)  #: the contact model for compiled functions
        self._no_contacts: Final = as_contacts(np.empty((0, 8)), self.hand)

    @uninterrupted()
    def grasp(self, pose: Pose, s1: float | tuple[float, ...] = 0.0) -> Grasp:
        """Close the hand at a pose of its palm in the world with posture s1 [rad].

        A bad grasp has quality 0, or below where it says how bad. Of a preshape with several amplitudes, `s1` may be
        all of them.

        Raises
        ------
        InputError
            If the pose or s1 is not finite, or the pose's quaternion is zero.
        """
        check_pose(pose)
        try:
            finite = all(map(isfinite, s1)) if isinstance(s1, tuple) else isfinite(s1)
        except TypeError:
            finite = False
        if not finite:
            raise InputError(f"s1 is {s1!r}; give a finite number [rad], or a tuple of all amplitudes.")
        relative = self._to_object @ pose if self.object_pose != Pose() else pose
        start = self.motion_start(s1)
        opened = np.clip(start, self.hand.lower, self.hand.upper)
        tried = self._attempt(pose, start)
        if tried.deepest > 0.0:
            worth = self.collision_worth(tried.deep)
            return Grasp("initial collision", worth, relative, s1, opened, opened, self._no_contacts, (), tried.deepest)
        contacts = as_contacts(tried.rows, self.hand)
        touched = np.flatnonzero(tried.touched).tolist()
        touching = tuple(dict.fromkeys(map(self.hand.body_names.__getitem__, touched)))
        if len(contacts) < 2:
            gaps = self.gaps(relative, tried.joints)[:-1].reshape(self.hand.radii.shape)
            worth = self.measure.without_contacts(gaps)
            return Grasp("no contact", worth, relative, s1, tried.joints, opened, contacts, touching, 0.0)
        wrench = self.measure.wrench(contacts.points, contacts.normals, contacts.weights)
        status: Status = "ok" if wrench.force_closure else "not closed"
        worth = float(self.measure.value(contacts.points, contacts.normals, wrench))
        return Grasp(status, worth, relative, s1, tried.joints, opened, contacts, touching, 0.0, wrench)

    def quality_at(self, pose: Pose, joints: ArrayLike) -> float:
        """Return the quality of the skin's contacts of the hand as it stands, without closing it.

        `pose` is from the palm frame to the object's frame, `joints` (f, j) [rad or m]; fewer than two contacts count
        as in `grasp`.

        Raises
        ------
        InputError
            If pose or joints are not finite, the quaternion is zero, or the joints have another shape.
        """
        contacts = self.contacts_at(pose, joints)
        if len(contacts) < 2:
            gaps = self.gaps(pose, joints)[:-1].reshape(self.hand.radii.shape)
            return self.measure.without_contacts(gaps)
        wrench = self.measure.wrench(contacts.points, contacts.normals, contacts.weights)
        return float(self.measure.value(contacts.points, contacts.normals, wrench))

    def contacts_at(self, pose: Pose, joints: ArrayLike) -> Contacts:
        """Return the skin's contacts of the hand as it stands, see `quality_at`."""
        check_pose(pose)
        angles = self._angles(joints)
        rows = felt(
            self.field.nodes,
            self.field.frame,
            self.arrays,
            pose.matrix,
            angles,
            self.depth,
            self.model == GRADED,
            0,
            self.hand.palm + 1,
        )
        return as_contacts(rows, self.hand)

    def gaps(self, pose: Pose, joints: ArrayLike) -> Array:
        """Return the gaps (f j + 1,) between the object and the hand's bodies at rest [m], the palm last.

        Negative values are rough depths; gaps above 5 mm are lower bounds.

        Parameters
        ----------
        pose
            From the palm frame to the object's frame.
        joints
            Joint angles or shifts, (f, j) [rad or m].

        Raises
        ------
        InputError
            As of `quality_at`.
        """
        check_pose(pose)
        angles = self._angles(joints)
        return open_gaps(self.field.nodes, self.field.frame, self.arrays, pose.matrix, angles)

    def warm_up(self) -> None:
        """Compile what a trial needs, if it is not yet in the cache: some seconds once for an installation."""
        half = self.object.box_half_extents
        beside = Pose((float(-self.hand.grasp_center[0]), 0.0, float(self.object.box_center[2] - half[2] - 0.05)))
        tried = self._attempt(beside, self.motion_start(0.0))
        self.gaps(beside, tried.joints)
        self.contacts_at(beside, tried.joints)
        points = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
        self.measure.wrench(points, -points, np.ones(4))

    def _angles(self, joints: ArrayLike) -> Array:
        """Return joints (f, j) as compiled code can take them: what is not finite it would read and write anywhere."""
        angles = np.array(joints, dtype=np.float64, order="C")
        shape = self.hand.radii.shape
        if angles.shape != shape:
            raise InputError(f"joints have shape {angles.shape}; give {shape}, fingers by joints, in the hand's order.")
        bad = np.flatnonzero(~(np.abs(angles.ravel()) <= FARTHEST))
        if len(bad):
            name, value = self.hand.joint_names[bad[0]] or f"number {bad[0]}", angles.flat[bad[0]]
            raise InputError(f"joint {name} is {value:g}; give finite angles [rad] or shifts [m], up to {FARTHEST:g}.")
        return angles

    def _attempt(self, pose: Pose, start: Array) -> Attempt:
        """Close the hand at a pose of its palm in the world, from a motion's start (f, j); see `grasp`."""
        return attempt(
            self.field.nodes,
            self.field.frame,
            self.arrays,
            times(self.to_object, pose.matrix),
            start,
            self.model,
            self.closing == "adaptive",
            self.depth,
        )

    def motion_start(self, s1: float | tuple[float, ...]) -> Array:
        """Return where the closing motion begins with a posture, before clamping, (f, j) [rad or m]."""
        return closing_motion(self.hand, s1 if isinstance(s1, tuple) else float(s1), self.preshape).start

    def collision_worth(self, depth: float) -> float:
        """Return the worth of an open hand whose bodies are inside the object by `depth` together [m]."""
        return float(_PENALTY * np.expm1(-depth / _PENALTY_DEPTH)) if self.collision == "penalty" else 0.0

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "field"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        # In a worker process the distance field is read from the cache, not sent along.
        self.__dict__.update(state)
        self.__dict__["field"] = self._field()

    def _field(self) -> DistanceField:
        needed = float(self.hand.radii.max()) + self.depth + 0.001  # a link is felt from its axis
        return distance_field_of(self.object, margin=max(MARGIN, np.ceil(1e3 * needed) * 1e-3))

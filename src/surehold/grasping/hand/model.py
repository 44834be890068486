"""The hand: a palm and fingers that are chains of joints and capsules; kinematics.py places them.

    f, j    fingers, joints of a finger (padded to the longest)      q     joint angles or shifts, (f, j), rad or m

One finger is the chain   base -> joint 1 -> offset 1 -> joint 2 -> offset 2 -> ... , and each joint moves one link: a
capsule around a segment that is fixed in the joint's moved frame. A link of several capsules, or a finger shorter than
the others, has joints that do not move; a link of radius 0 is not there. Link k of finger f is body j f + k, the palm,
which may be several boxes with round edges, is the last body.
The palm frame: x along the fingers, y towards the thumb of a left hand, z out of the palm, towards what is grasped.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["CLOSED", "Hand", "HandModel", "LinkBox", "Preshape", "chain_row"]

Array = NDArray[np.float64]

CLOSED = 2.0 * np.pi  #: the closing parameter of the closed hand; 0 is the open one
_ROW = 19  # numbers that describe a joint and its link


class Preshape(NamedTuple):
    """How a hand closes in a type of grasp: q(t) = clip(start + s1 posture + rate t, lower, upper) 0 <= t <= 2 pi."""

    start: Array  #: (f, j) rad or m, before clamping
    rate: Array  #: (f, j) per unit of t
    posture: Array  #: (f, j) per unit of the posture variable s1
    s1_useful: tuple[float, float]  #: where s1 has an effect; both ends 0 for a preshape without posture
    s1_range: tuple[float, float]  #: range of s1 in the thesis preset
    s1_tries: tuple[float, ...]  #: values that the search of default poses tries
    further: tuple[Array, ...] = ()  #: of further amplitudes s2, s3, ..: (f, j) each, as `posture`
    further_ranges: tuple[tuple[float, float], ...] = ()  #: their ranges


class LinkBox(NamedTuple):
    """A box that fingers carry, filled by the capsules of some links: they close, its faces feel."""

    links: tuple[int, ...]  #: numbers of these links
    pose: Array  #: (3, 4) of the box in the frame of the joint that moves them
    half: Array  #: (3,) half extents [m]


class HandModel(NamedTuple):
    """The model that a hand was read from, with the names and frames by which other programs know its parts."""

    file: str  #: its path, as it was given
    body: str  #: the palm's body
    in_body: Array  #: (3, 4) palm frame in the frame of that body
    in_root: Array  #: (3, 4) palm frame in the frame of the model's file
    joints: tuple[str, ...]  #: all joints that turn or slide, in the order of the model
    rest: tuple[float, ...]  #: where those are that no finger moves [rad or m]
    frames: Mapping[str, Array]  #: (3, 4) palm frame in the frame of each body that no finger moves, at rest
    moved: tuple[str, ...]  #: bodies that fingers move


@dataclass(frozen=True, eq=False)
class Hand:
    """Geometry, joint ranges and preshapes of a hand. Lengths in m, angles in rad, in the palm frame."""

    name: str
    bases: Array = field(repr=False)  #: (f, 3, 4) rotation and origin of each finger's first joint
    chains: Array = field(repr=False)  #: (f, j, 19): rows of `chain_row`
    radii: Array = field(repr=False)  #: (f, j) of the links' capsules; 0 where there is no link
    lower: Array = field(repr=False)  #: (f, j) joint angles or shifts
    upper: Array = field(repr=False)  #: (f, j) joint angles or shifts
    palm_poses: Array = field(repr=False)  #: (p, 3, 4) frames of the palm's boxes
    palm_half_extents: Array = field(repr=False)  #: (p, 3) of the palm's boxes, their rounding included
    palm_roundings: Array = field(repr=False)  #: (p,) radius of the palm's edges
    grasp_center: Array  #: (3,) the point that the default pose puts before the center of the object's facet
    finger_names: tuple[str, ...]  #: (f,)
    link_names: tuple[str, ...] = field(repr=False)  #: (f j,) such as "index distal"
    joint_names: tuple[str, ...] = field(repr=False)  #: (f j,) such as "index_distal"; "" for one that does not move
    preshapes: Mapping[str, Preshape] = field(repr=False)  #: grasp types; the first one is the default
    #: (f j, p) links that are joined to a box of the palm and may enter it; none if not given
    joined: NDArray[np.bool_] | None = field(default=None, repr=False)
    boxes: tuple[LinkBox, ...] = field(default=(), repr=False)  #: links with flat faces
    finger_force: float = 8.0  #: what a stretched finger can exert at its tip [N]; the check by physics takes it
    #: where the hand was read from; None for the built-in ones
    model: HandModel | None = field(default=None, repr=False)
    friction: float | None = None  #: coefficient of its skin on what it grasps; None: each object has its own
    sources: Mapping[str, str] = field(default_factory=dict, repr=False)  #: where finger_force and friction come from

    @property
    def palm(self) -> int:
        """Body number of the palm."""
        return len(self.link_names)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """Names (f j + 1,) of the bodies by number, such as "index distal", and at the end "palm"."""
        return (*self.link_names, "palm")

    @cached_property
    def slides(self) -> NDArray[np.bool_]:
        """Which joints (f, j) slide; the others turn."""
        return self.chains[:, :, 0] > 0.0

    @cached_property
    def neighbors(self) -> NDArray[np.bool_]:
        """Which links (f j,) and boxes of the palm (p,) may overlap: (f j, p)."""
        return np.zeros((self.palm, len(self.palm_poses)), dtype=bool) if self.joined is None else self.joined

    def arrays(self) -> tuple[Array, ...]:
        """Return all numbers that make up the hand, its preshapes included; equal arrays, equal grasps."""
        shapes = [part for preshape in self.preshapes.values() for part in (np.hstack(preshape[:3]), preshape[5])]
        geometry = (self.bases, self.chains, self.radii, self.lower, self.upper, self.palm_poses)
        rest = (self.palm_half_extents, self.palm_roundings, self.grasp_center, *map(np.asarray, shapes))
        joined = () if self.joined is None else (self.joined.astype(float),)
        return geometry + rest + joined + tuple(np.column_stack([box.pose, box.half]) for box in self.boxes)

    def reach(self) -> Array:
        """Return (f, j, j): an upper bound of the speed of link k when joint i <= k moves at 1 [m/rad, or 1 in m/m].

        For a turning joint that is how far the link's axis can ever be from the joint's origin.
        """
        near, far = np.linalg.norm(self.chains[:, :, 1:4], axis=2), np.linalg.norm(self.chains[:, :, 4:7], axis=2)
        slides = self.slides
        travel = np.where(slides, np.maximum(np.abs(self.lower), np.abs(self.upper)), 0.0)
        offsets = np.linalg.norm(self.chains[:, :, 7:].reshape(*self.radii.shape, 3, 4)[:, :, :, 3], axis=2)
        fingers, joints = self.radii.shape
        reach = np.zeros((fingers, joints, joints))
        for i in range(joints):
            way = np.zeros(fingers)
            for k in range(i, joints):
                if k > i:
                    way = way + offsets[:, k - 1] + travel[:, k]
                reach[:, i, k] = np.where(slides[:, i], 1.0, way + np.maximum(near[:, k], far[:, k]))
        return reach


def chain_row(near: Array, far: Array, offset: Array, slides: bool = False) -> Array:
    """Return the 19 numbers of a joint: whether it slides, its link's near and far end, the frame of the next joint.

    `near` and `far` (3,) are the ends of the link's axis, `offset` (3, 4) is rotation and origin of the next joint's
    frame; all in the joint's moved frame.
    """
    row = np.empty(_ROW)
    row[0], row[1:4], row[4:7], row[7:] = float(slides), near, far, np.asarray(offset).ravel()
    return row

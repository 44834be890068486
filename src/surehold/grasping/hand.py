"""The hand: a palm and five fingers of four revolute joints each, with compiled forward kinematics.

    q      joint angles, (5, 4), rad           a    actuator angles, (9,), rad
    R, p   rotation and origin of a joint's frame; every joint turns about its own z axis

One finger is the chain (Denavit-Hartenberg, all lengths in m)

    base -> Rz(q1) -> Tx(a1) Rx(90 deg) Tz(d) -> Rz(q2) -> Tx(a2) -> Rz(q3) -> Tx(a3) -> Rz(q4) -> tip

and its four links (knuckle, proximal, middle, distal) are capsules around the segments between the joints.
The palm frame: x along the fingers, y towards the thumb, z out of the palm, towards what is grasped.
"""

from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from surehold.errors import unknown_name

__all__ = ["FINGERS", "LINKS", "PALM", "Hand", "finger_joints", "hand_named", "icub_left_hand", "link_name"]

Array = NDArray[np.float64]

FINGERS: Final = ("index", "middle", "ring", "little", "thumb")
LINKS: Final = ("knuckle", "proximal", "middle", "distal")
PALM: Final = 20  #: body number of the palm; a link has the number 4 finger + link


def link_name(body: int) -> str:
    """Return the name of a body: "palm", or such as "index distal"."""
    return "palm" if body == PALM else f"{FINGERS[body // 4]} {LINKS[body % 4]}"


@dataclass(frozen=True, eq=False)
class Hand:
    """Geometry, joint ranges and coupling of a five-finger hand. Lengths in m, angles in rad, in the palm frame."""

    name: str
    bases: Array = field(repr=False)  #: (5, 3, 4) rotation and origin of each finger's first joint
    chains: Array = field(repr=False)  #: (5, 6): a1, d, a2, a3 and the far end (x, y) of the distal link's axis
    lower: Array = field(repr=False)  #: (5, 4) joint angles
    upper: Array = field(repr=False)  #: (5, 4) joint angles
    coupling: Array = field(repr=False)  #: (5, 4, 9): q = coupling a, then clamped to the range
    radius: float  #: of the links' capsules
    palm_center: Array  #: (3,) center of the palm's box
    palm_half_extents: Array  #: (3,) of the palm's box, its rounding included
    palm_rounding: float  #: radius of the palm's edges
    grasp_center: Array  #: (3,) the point that the default pose puts before the center of the object's facet

    def reach(self) -> Array:
        """Return (5, 4, 4): for finger f, joint j, link k >= j an upper bound of |joint origin - point of the link|."""
        lengths = np.column_stack(
            [
                np.hypot(self.chains[:, 0], self.chains[:, 1]),
                self.chains[:, 2],
                self.chains[:, 3],
                np.linalg.norm(self.chains[:, 4:], axis=1),
            ]
        )
        reach = np.zeros((5, 4, 4))
        for j in range(4):
            reach[:, j, j:] = np.cumsum(lengths[:, j:], axis=1)
        return reach


def _frame(x: float, y: float, z: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Array:
    """Return (3, 4): Rz(yaw) Ry(pitch) Rx(roll) [degrees] and the origin [mm -> m]."""
    r, p, w = np.radians([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    about_y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    about_z = np.array([[np.cos(w), -np.sin(w), 0], [np.sin(w), np.cos(w), 0], [0, 0, 1]])
    return np.column_stack([about_z @ about_y @ about_x, np.array([x, y, z]) * 1e-3])


@cache
def icub_left_hand() -> Hand:
    """Return the left hand of the iCub: 20 joints coupled to 9 actuators, from its published joint table."""
    bases = np.stack(
        [
            _frame(64.25, 26.22, -6.7, 5.0, 0.0, 4.1),
            _frame(65.0, 9.77, -7.6),
            _frame(64.13, -5.65, -7.0, -5.0, 0.0, -6.1),
            _frame(62.11, -24.54, -6.0, -5.0, 0.0, -6.1),
            _frame(39.0, 12.0, 2.5, 0.0, 4.76364, -29.04),
        ]
    )
    bases[4, :, :3] = bases[4, :, :3] @ _frame(0.0, 0.0, 0.0, 90.0, 0.0, 90.0)[:, :3]
    # The distal link is 21 mm from joint to skin: its axis ends one radius earlier, on the line to the tip (18, 5).
    distal = (21.0 - 6.5) * np.array([18.0, 5.0]) / np.hypot(18.0, 5.0)
    chains = 1e-3 * np.array(
        [
            [14.8, 1.75, 25.9, 22.0, *distal],
            [15.3, 2.2, 25.8, 24.0, *distal],
            [14.8, 1.75, 25.9, 22.0, *distal],
            [14.8, -1.75, 21.9, 19.0, *distal],
            [21.1, -4.9, 26.0, 22.0, *distal],
        ]
    )
    lower, upper = np.zeros((5, 4)), np.full((5, 4), 90.0)
    lower[:4, 0], upper[:4, 0], upper[4, 0] = -25.0, 25.0, 120.0
    coupling = np.zeros((5, 4, 9))  # actuators: spread, thumb 3, index 2, middle 2, ring and little 1
    coupling[[0, 2, 3], 0, 0] = 0.08, -0.05, -0.10
    coupling[4, 0, 1] = coupling[4, 1, 2] = coupling[0, 1, 4] = coupling[1, 1, 6] = 1.0
    for finger, actuator in ((4, 3), (0, 5), (1, 7)):
        coupling[finger, 2, actuator], coupling[finger, 3, actuator] = 0.6, 0.4
    coupling[2:4, 1:, 8] = 1.0, 0.9, 0.6
    return Hand(
        name="icub-left",
        bases=bases,
        chains=chains,
        lower=np.radians(lower),
        upper=np.radians(upper),
        coupling=coupling,
        radius=0.0065,
        palm_center=1e-3 * np.array([29.0, 1.5, -7.0]),
        palm_half_extents=1e-3 * np.array([40.0, 33.5, 15.0]),
        palm_rounding=0.006,
        grasp_center=1e-3 * np.array([60.0, 10.0, 25.0]),
    )


def hand_named(name: str) -> Hand:
    """Return a shipped hand by name.

    Raises
    ------
    InputError
        If no hand of that name is shipped.
    """
    if name != "icub-left":
        raise unknown_name("hand", name, ["icub-left"])
    return icub_left_hand()


@njit(cache=True)
def finger_joints(base, chain, q0, q1, q2, q3, ends):
    """Write the link ends of one finger into ends (4, 2, 3): for each link the near and the far end of its axis.

    base (3, 4) is the frame of the first joint, chain (6,) the lengths, q0 to q3 the joint angles.
    """
    c, s = np.cos(q0), np.sin(q0)
    # After joint 1 and the twist: x is the finger's direction, y the side it bends to, z the bending axis.
    for i in range(3):
        x = base[i, 0] * c + base[i, 1] * s
        side = -base[i, 0] * s + base[i, 1] * c
        ends[0, 0, i] = base[i, 3]
        ends[0, 1, i] = base[i, 3] + chain[0] * x - chain[1] * side
        ends[1, 0, i] = ends[0, 1, i]
        # bending plane spanned by x and y = base z
        up = base[i, 2]
        b1, b2, b3 = q1, q1 + q2, q1 + q2 + q3
        ends[1, 1, i] = ends[1, 0, i] + chain[2] * (np.cos(b1) * x + np.sin(b1) * up)
        ends[2, 0, i] = ends[1, 1, i]
        ends[2, 1, i] = ends[2, 0, i] + chain[3] * (np.cos(b2) * x + np.sin(b2) * up)
        ends[3, 0, i] = ends[2, 1, i]
        cx, cy = np.cos(b3), np.sin(b3)
        ends[3, 1, i] = ends[3, 0, i] + chain[4] * (cx * x + cy * up) + chain[5] * (-cy * x + cx * up)

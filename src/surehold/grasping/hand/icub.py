"""The hands of the iCub: 20 joints coupled to 9 actuators, and the published power grasp.

    a    actuator angles, (9,), rad        c0   closure, from +pi (open) to -pi (closed)
    t    closing parameter, pi - c0        s1   posture variable: in effect the opposition of the thumb
    q    joint angles, (5, 4), rad

    a = mean + c0 A0 + s1 A1,   q = clamp(coupling a)   so that every joint is   q(t) = clamp(start + t rate)

One finger is the chain (Denavit-Hartenberg, all lengths in m)

    base -> Rz(q1) -> Tx(a1) Rx(90 deg) Tz(d) -> Rz(q2) -> Tx(a2) -> Rz(q3) -> Tx(a3) -> Rz(q4) -> tip

and its four links (knuckle, proximal, middle, distal) are capsules around the segments between the joints. The right
hand is the mirror image of the left one, with the same joint angles.
Means and components of the power grasp were learnt from recorded human grasps and published for the iCub hand. The
tripod grasp has the recorded mean of its own; in the pinch grasp the middle finger rests as well.
"""

from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.model import Hand, Preshape, chain_row

__all__ = ["icub_left_hand", "icub_right_hand"]

Array = NDArray[np.float64]

_FINGERS: Final = ("index", "middle", "ring", "little", "thumb")
_LINKS: Final = ("knuckle", "proximal", "middle", "distal")
_RADIUS: Final = 0.0065

_CLOSURE: Final = np.array([-0.20, 0.0, -0.05, -0.90, -0.35, -0.40, -0.35, -0.40, -0.32])
_POSTURE: Final = np.array([0.0, -0.9232, -0.0415, 0.1669, -0.0491, -0.1012, -0.0381, -0.0160, 0.0])
_POWER: Final = np.array([33.5561, 51.8757, 10.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0])  # mean [degrees]
# Recorded by eight sensors, which do not see ring and little finger: these lie in the palm, out of the way.
_TRIPOD: Final = np.array([26.3, 59.7, 37.8, 24.3, 11.6, 69.9, 12.0, 83.6, 80.0])
_S1_RANGE: Final = (-np.pi, np.pi)


def _coupling() -> Array:
    """Return (5, 4, 9): joint angles for each actuator angle; spread, thumb 3, index 2, middle 2, ring and little 1."""
    coupling = np.zeros((5, 4, 9))
    coupling[[0, 2, 3], 0, 0] = 0.08, -0.05, -0.10
    coupling[4, 0, 1] = coupling[4, 1, 2] = coupling[0, 1, 4] = coupling[1, 1, 6] = 1.0
    for finger, actuator in ((4, 3), (0, 5), (1, 7)):
        coupling[finger, 2, actuator], coupling[finger, 3, actuator] = 0.6, 0.4
    coupling[2:4, 1:, 8] = 1.0, 0.9, 0.6
    return coupling


def _preshape(mean: Array, resting: tuple[int, ...], s1_tries: tuple[float, ...]) -> Preshape:
    """Return the preshape of a mean [degrees] whose `resting` actuators do not close."""
    closure, coupling = _CLOSURE.copy(), _coupling()
    closure[list(resting)] = 0.0
    opposition = np.radians(mean[1] - np.array([120.0, 0.0])) / -_POSTURE[1]  # the thumb turns from 120 to 0 degrees
    return Preshape(
        start=coupling @ (np.radians(mean) + np.pi * closure),
        rate=coupling @ -closure,
        posture=coupling @ _POSTURE,
        s1_useful=(float(np.round(opposition[0], 2)), float(np.round(opposition[1], 2))),
        s1_range=_S1_RANGE,
        s1_tries=s1_tries,
    )


def _frame(x: float, y: float, z: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Array:
    """Return (3, 4): Rz(yaw) Ry(pitch) Rx(roll) [degrees] and the origin [mm -> m]."""
    r, p, w = np.radians([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    about_y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    about_z = np.array([[np.cos(w), -np.sin(w), 0], [np.sin(w), np.cos(w), 0], [0, 0, 1]])
    return np.column_stack([about_z @ about_y @ about_x, np.array([x, y, z]) * 1e-3])


def _chain(a1: float, d: float, a2: float, a3: float) -> Array:
    """Return the chain (4, 19) of a finger; lengths in mm."""
    # The distal link is 21 mm from joint to skin: its axis ends one radius earlier, on the line to the tip (18, 5).
    tip = (21.0 - 6.5) * np.array([18.0, 5.0, 0.0]) / np.hypot(18.0, 5.0)
    turned = np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # Rx(90 degrees), exactly
    none = np.zeros(3)
    ends = [np.array([a1, -d, 0.0]), np.array([a2, 0.0, 0.0]), np.array([a3, 0.0, 0.0]), tip]
    turns = [turned, np.eye(3), np.eye(3), np.eye(3)]
    return np.stack(
        [
            chain_row(none, 1e-3 * end, np.column_stack([turn, 1e-3 * end]))
            for end, turn in zip(ends, turns, strict=True)
        ]
    )


@cache
def icub_left_hand() -> Hand:
    """Return the left hand of the iCub, from its published joint table."""
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
    lengths = [
        (14.8, 1.75, 25.9, 22.0),
        (15.3, 2.2, 25.8, 24.0),
        (14.8, 1.75, 25.9, 22.0),
        (14.8, -1.75, 21.9, 19.0),
        (21.1, -4.9, 26.0, 22.0),
    ]
    lower, upper = np.zeros((5, 4)), np.full((5, 4), 90.0)
    lower[:4, 0], upper[:4, 0], upper[4, 0] = -25.0, 25.0, 120.0
    return Hand(
        name="icub-left",
        bases=bases,
        chains=np.stack([_chain(*row) for row in lengths]),
        radii=np.full((5, 4), _RADIUS),
        lower=np.radians(lower),
        upper=np.radians(upper),
        palm_poses=np.column_stack([np.eye(3), [0.029, 0.0015, -0.007]])[None],
        palm_half_extents=np.array([[0.040, 0.0335, 0.015]]),
        palm_roundings=np.array([0.006]),
        grasp_center=np.array([0.060, 0.010, 0.025]),
        sources={"finger_force": "assumed: no published figure was found"},
        finger_names=_FINGERS,
        link_names=tuple(f"{finger} {link}" for finger in _FINGERS for link in _LINKS),
        joint_names=tuple(f"{finger}_{link}" for finger in _FINGERS for link in _LINKS),
        preshapes={
            "power": _preshape(_POWER, (), (-1.2, -0.95, -0.7, -0.45, -0.2, 0.1)),
            "tripod": _preshape(_TRIPOD, (8,), (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25)),
            "pinch": _preshape(np.array([*_TRIPOD[:6], 80.0, 80.0, 80.0]), (6, 7, 8), (-0.75, -0.5, -0.25, 0.0, 0.25)),
        },
    )


@cache
def icub_right_hand() -> Hand:
    """Return the right hand of the iCub: the left one mirrored in the plane of its palm frame's x and z."""
    left = icub_left_hand()
    across, within = np.diag([1.0, -1.0, 1.0]), np.diag([1.0, 1.0, -1.0])
    # Every joint's frame is mirrored and given back its hand by turning over its own z axis, along which angles keep
    # their sense: M Rz(q) M = Rz(q) for M = diag(1, 1, -1).
    bases = np.concatenate([across @ left.bases[:, :, :3] @ within, across @ left.bases[:, :, 3:]], axis=2)
    chains = left.chains.copy()
    chains[:, :, 1:4], chains[:, :, 4:7] = left.chains[:, :, 1:4] @ within, left.chains[:, :, 4:7] @ within
    offsets = left.chains[:, :, 7:].reshape(5, 4, 3, 4)
    moved = np.concatenate([within @ offsets[:, :, :, :3] @ within, within @ offsets[:, :, :, 3:]], axis=3)
    chains[:, :, 7:] = moved.reshape(5, 4, 12)
    palms = left.palm_poses.copy()
    palms[:, :, 3] = palms[:, :, 3] @ across
    return replace(
        left,
        name="icub-right",
        bases=bases,
        chains=chains,
        palm_poses=palms,
        grasp_center=left.grasp_center @ across,
    )

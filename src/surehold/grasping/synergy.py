"""The power grasp: one number closes the hand, another one places the thumb.

    a    actuator angles, (9,), rad        c0   closure, from +pi (open) to -pi (closed)
    t    closing parameter, pi - c0        s1   posture variable: in effect the opposition of the thumb
    q    joint angles, (5, 4), rad

    a = mean + c0 A0 + s1 A1,   q = clamp(coupling a)   so that every joint is   q(t) = clamp(start + t rate)

Means and components were learnt from recorded human power grasps and published for the iCub hand.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand import Hand

__all__ = ["S1_RANGE", "S1_USEFUL", "ClosingMotion", "open_joints", "power_grasp"]

Array = NDArray[np.float64]

_MEAN: Final = np.radians([33.5561, 51.8757, 10.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0])
_CLOSURE: Final = np.array([-0.20, 0.0, -0.05, -0.90, -0.35, -0.40, -0.35, -0.40, -0.32])
_POSTURE: Final = np.array([0.0, -0.9232, -0.0415, 0.1669, -0.0491, -0.1012, -0.0381, -0.0160, 0.0])

S1_RANGE: Final = (-np.pi, np.pi)  #: range of s1 in the original search
S1_USEFUL: Final = (-1.29, 0.98)  #: where s1 moves the thumb; beyond, the thumb is at an end of its range
CLOSED: Final = 2.0 * np.pi  #: the closing parameter of the closed hand; 0 is the open one


class ClosingMotion(NamedTuple):
    """Joint angles as functions of the closing parameter t in [0, 2 pi]: clip(start + rate t, lower, upper)."""

    start: Array  #: (5, 4) rad, before clamping
    rate: Array  #: (5, 4) rad per unit of t
    lower: Array  #: (5, 4) rad
    upper: Array  #: (5, 4) rad

    def joints(self, t: float) -> Array:
        """Return the joint angles (5, 4) at the closing parameter t [rad]."""
        return np.clip(self.start + self.rate * t, self.lower, self.upper)


def power_grasp(hand: Hand, s1: float = 0.0) -> ClosingMotion:
    """Return the closing motion of the power grasp with posture s1 [rad]."""
    opened = _MEAN + np.pi * _CLOSURE + s1 * _POSTURE
    return ClosingMotion(hand.coupling @ opened, hand.coupling @ -_CLOSURE, hand.lower, hand.upper)


def open_joints(motion: ClosingMotion) -> Array:
    """Return the joint angles (5, 4) of the open hand [rad]."""
    return motion.joints(0.0)

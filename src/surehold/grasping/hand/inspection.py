"""What is wrong with a hand, as far as its own motion tells: palm turned over, open and closed exchanged, no motion.

A hand of a single finger is told, too.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.model import CLOSED, Hand
from surehold.grasping.hand.synergy import closing_motion
from surehold.grasping.hand.tips import Fingertips

__all__ = ["FingerMotion", "finger_motions", "hand_faults"]

Array = NDArray[np.float64]
_STEPS: Final = 17  # postures on the way from open to closed
_STILL: Final = 1e-3  # m; a tip that stays within this of its place does not move
_APART: Final = 2e-3  # m; by which tips are farther apart when closed, before open and closed count as exchanged


class FingerMotion(NamedTuple):
    """Where the tip of a finger is while it closes."""

    finger: str
    way: Array  #: (t, 3) from open to closed, in the palm frame [m]

    @property
    def moves(self) -> float:
        """How far the tip gets from where it is when the hand is open [m]."""
        return float(np.linalg.norm(self.way - self.way[0], axis=1).max())


def finger_motions(hand: Hand, preshape: str | None = None) -> list[FingerMotion]:
    """Return the way of each fingertip in a preshape, the hand's first one if none is named; nothing stops it."""
    tips, motion = Fingertips(hand), closing_motion(hand, 0.0, preshape)
    way = np.stack([tips.at(motion.joints(t)) for t in np.linspace(0.0, CLOSED, _STEPS)])
    return [FingerMotion(finger, way[:, f]) for f, finger in enumerate(hand.finger_names)]


def hand_faults(hand: Hand, preshape: str | None = None) -> list[str]:
    """Return what looks wrong with a hand, a sentence each, in a preshape or, if none is named, in all of them.

    - The fingertips close behind the palm: on their way they are, on average, below the middle of the palm's boxes,
      seen along the palm's z.
    - Open and closed are exchanged: when the hand is closed, the tips that move are at least 2 mm farther from their
      middle, and from the grasp center, than when it is open.
    - A finger never moves: its tip stays within 1 mm in every preshape of the hand.
    - It is the only finger, which has nothing but the palm to press against.
    """
    every = {name: finger_motions(hand, name) for name in hand.preshapes}
    faults = []
    for name in [preshape] if preshape else every:
        moving = np.stack([m.way for m in every[name] if m.moves > _STILL] or [np.zeros((_STEPS, 3))])  # (f, t, 3)
        middle = float(hand.palm_poses[:, 2, 3].mean()) if len(hand.palm_poses) else 0.0
        height = float(moving[:, :, 2].mean()) - middle
        if height < -_STILL:
            faults.append(
                f"In '{name}' the fingertips close behind the palm ({-1e3 * height:.0f} mm below it along its z): does "
                "palm.z point out of the back of the hand?"
            )
        apart = np.linalg.norm(moving - moving.mean(axis=0), axis=2).mean(axis=0)  # (t,)
        away = np.linalg.norm(moving - hand.grasp_center, axis=2).mean(axis=0)
        if min(apart[-1] - apart[0], away[-1] - away[0]) > _APART:
            faults.append(
                f"In '{name}' the fingertips are {1e3 * apart[0]:.0f} mm from their middle when the hand is open, and "
                f"{1e3 * apart[-1]:.0f} mm when it is closed: are open and closed exchanged?"
            )
    for f, finger in enumerate(hand.finger_names):
        if max(motions[f].moves for motions in every.values()) <= _STILL:
            faults.append(f"Finger '{finger}' never moves: name a joint of it in 'closed' of a preshape.")
    if len(hand.finger_names) == 1:
        faults.append(f"'{hand.finger_names[0]}' is its only finger: it can press an object against the palm alone.")
    return faults

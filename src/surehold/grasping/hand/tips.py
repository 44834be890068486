"""Where the fingertips of a hand are: the middle of the far ends of what the last joint of each finger moves."""

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.kinematics import link_frames
from surehold.grasping.hand.model import Hand

__all__ = ["Fingertips"]

Array = NDArray[np.float64]
_END = 0.2  # of the length of the last link: axes that end there are at the tip


class Fingertips:
    """The tips of a hand's fingers, for any posture."""

    def __init__(self, hand: Hand):
        self.hand = hand
        self.slides = hand.chains[:, :, 0] > 0.0  #: (f, j) which joints slide
        self._in_link = np.array([self._tip(f) for f in range(len(hand.finger_names))])

    def frames(self, q: Array) -> Array:
        """Return the frames (f, j, 3, 4) of all joints at joint angles (f, j)."""
        return link_frames(self.hand.bases, self.hand.chains, np.ascontiguousarray(q)).reshape(*q.shape, 3, 4)

    def at(self, q: Array) -> Array:
        """Return the tips (f, 3) at joint angles (f, j) [m]."""
        last = self.frames(q)[:, -1]  # links beyond the last joint of a finger rest in its frame
        return np.einsum("fij,fj->fi", last[:, :, :3], self._in_link) + last[:, :, 3]

    def _tip(self, f: int) -> Array:
        """Return the tip (3,) of a finger in the frame of its last joint."""
        chain, n = self.hand.chains[f], self.hand.lower.shape[1]
        names = self.hand.joint_names[f * n : (f + 1) * n]
        last = max(k for k in range(n) if names[k])
        there = [k for k in range(last, n) if self.hand.radii[f, k] > 0.0]
        if not there:  # what can touch is moved by the joints before it
            return np.zeros(3)
        ends = np.concatenate([chain[there, 1:4], chain[there, 4:7]])
        middle = ends.mean(axis=0)
        away = ends @ middle if self.slides[f, last] else np.linalg.norm(ends, axis=1)
        away = away / max(float(np.linalg.norm(middle)), 1e-9) if self.slides[f, last] else away
        return ends[away >= away.max() - _END * np.ptp(away)].mean(axis=0)

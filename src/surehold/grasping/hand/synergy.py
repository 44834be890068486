"""How a hand closes: from a preshape and the posture variable to a motion of every joint.

    t    closing parameter, from 0 (open) to 2 pi (closed)      s1   posture variable, such as the opposition of a thumb
    q    joint angles or shifts, (f, j), rad or m

Every joint moves at a constant rate and stays within its range: q(t) = clamp(start + s1 posture + t rate).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.model import Hand, Preshape

__all__ = ["ClosingMotion", "closing_motion", "preshape_of"]

Array = NDArray[np.float64]


class ClosingMotion(NamedTuple):
    """Joint angles as functions of the closing parameter t in [0, 2 pi]: clip(start + rate t, lower, upper)."""

    start: Array  #: (f, j) rad or m, before clamping
    rate: Array  #: (f, j) per unit of t
    lower: Array  #: (f, j) rad or m
    upper: Array  #: (f, j) rad or m

    def joints(self, t: float) -> Array:
        """Return the joint angles (f, j) at the closing parameter t [rad or m]."""
        return np.clip(self.start + self.rate * t, self.lower, self.upper)


def preshape_of(hand: Hand, name: str | None = None) -> Preshape:
    """Return a preshape of a hand by name, or its first one.

    Raises
    ------
    InputError
        If the hand has no preshape of that name.
    """
    if name is None:
        return next(iter(hand.preshapes.values()))
    if name not in hand.preshapes:
        raise unknown_name("preshape", name, hand.preshapes)
    return hand.preshapes[name]


def closing_motion(hand: Hand, s1: float | Sequence[float] = 0.0, preshape: str | None = None) -> ClosingMotion:
    """Return the closing motion of a preshape, the hand's first one if none is named, with posture s1.

    Of a preshape with further amplitudes, `s1` may be all of them: (s1, s2, ..).

    Raises
    ------
    InputError
        If the hand has no preshape of that name, or the preshape has fewer amplitudes.
    """
    chosen = preshape_of(hand, preshape)
    first, *others = (s1,) if isinstance(s1, int | float | np.number) else s1
    if len(others) > len(chosen.further):
        raise InputError(f"{len(others) + 1} amplitudes are given; the preshape has {len(chosen.further) + 1}.")
    start = chosen.start + first * chosen.posture
    for amplitude, component in zip(others, chosen.further, strict=False):
        start = start + amplitude * component
    return ClosingMotion(start, chosen.rate, hand.lower, hand.upper)

"""One attempt, compiled: the open hand is put at a pose, looked at for collisions, closed, and asked what it feels.

Passes (see closing.py) have two outcomes or more: the link was held by its narrow touch, or has gone on. What a finger
feels is the mixture of its outcomes, `mixed` of contacts.py.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.closing.closing import close_hand, hand_gaps
from surehold.grasping.closing.contacts import (
    GRADED,
    SINGLE,
    add_outcome,
    end_mixture,
    pass_share,
    skin_contacts,
    touch_contacts,
)
from surehold.grasping.hand.kinematics import link_ends, link_frames
from surehold.grasping.hand.model import CLOSED, Hand
from surehold.grasping.hand.skin import skin_samples
from surehold.store.kernels import njit

__all__ = ["Attempt", "HandArrays", "attempt", "felt", "hand_arrays", "open_gaps", "placed", "times"]

_LEAST_SHARE: Final = 1e-3  # outcomes of a smaller share are not looked at
_FAR: Final = 0.005  # gaps of an open palm are lower bounds beyond that [m]


class HandArrays(NamedTuple):
    """A hand as the compiled functions take it; see `Hand` for the fields."""

    bases: NDArray[np.float64]
    chains: NDArray[np.float64]
    reach: NDArray[np.float64]
    radii: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    rates: NDArray[np.float64]  #: (f, j) of the preshape
    palm_poses: NDArray[np.float64]
    halves: NDArray[np.float64]
    roundings: NDArray[np.float64]
    neighbors: NDArray[np.bool_]
    samples: NDArray[np.float64]  #: (m, 7) of the skin


class Attempt(NamedTuple):
    """What became of an attempt."""

    deepest: float  #: depth of the deepest body of the open hand inside the object [m], 0 for none
    deep: float  #: depths of all bodies together [m]
    joints: NDArray[np.float64]  #: (f, j) at the end; a collision leaves the hand open
    touched: NDArray[np.bool_]  #: (f j,) which links were stopped by the object
    rows: NDArray[np.float64]  #: (m, 8) contacts: point, inward normal, weight (0 for none), body


def hand_arrays(hand: Hand, rates: NDArray[np.float64]) -> HandArrays:
    """Return a hand that closes at `rates` (f, j) as the compiled functions take it."""

    def plain(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(values, dtype=np.float64, order="C")

    return HandArrays(
        plain(hand.bases),
        plain(hand.chains),
        plain(hand.reach()),
        plain(hand.radii),
        plain(hand.lower),
        plain(hand.upper),
        plain(rates),
        plain(hand.palm_poses),
        plain(hand.palm_half_extents),
        plain(hand.palm_roundings),
        np.ascontiguousarray(hand.neighbors),
        plain(skin_samples(hand)),
    )


@njit(cache=True)
def times(outer, inner):
    """Return the pose (3, 4) that first applies `inner`, then `outer`."""
    out = np.empty((3, 4))
    _write_product(outer, inner, out)
    return out


@njit(cache=True)
def placed(pose, frames):
    """Return frames (k, 3, 4) moved by a pose (3, 4)."""
    out = np.empty(frames.shape)
    for k in range(len(frames)):
        _write_product(pose, frames[k], out[k])
    return out


@njit(cache=True)
def _write_product(outer, inner, out):
    """Write the pose (3, 4) that first applies `inner`, then `outer`."""
    for i in range(3):
        for n in range(4):
            out[i, n] = outer[i, 0] * inner[0, n] + outer[i, 1] * inner[1, n] + outer[i, 2] * inner[2, n]
        out[i, 3] += outer[i, 3]


@njit(cache=True)
def open_gaps(nodes, frame, hand, pose, joints):
    """Return the gaps (f j + 1,) between the object and the bodies of a hand at rest [m], see `hand_gaps`."""
    ends = link_ends(placed(pose, hand.bases), hand.chains, joints)
    palms = placed(pose, hand.palm_poses)
    return hand_gaps(nodes, frame, ends, hand.radii, palms, hand.halves, hand.roundings, _FAR)


@njit(cache=True)
def felt(nodes, frame, hand, pose, joints, depth, graded, first, last):
    """Return what the skin feels, rows (m, 8), of the bodies `first` to before `last`; rows of others are not set."""
    frames = link_frames(placed(pose, hand.bases), hand.chains, joints)
    return skin_contacts(nodes, frame, frames, hand.chains, hand.radii, pose, hand.samples, depth, graded, first, last)


@njit(cache=True, nogil=True)
def attempt(nodes, frame, hand, pose, start, model, adaptive, depth):
    """Return an `Attempt` at a pose (3, 4) of the palm in the object's frame, with the motion's start (f, j).

    `model` is one of the contact models of contacts.py; `adaptive` as of `close_hand`; depth of the soft touch [m].
    """
    motion = np.empty((4, *start.shape))
    for f in range(start.shape[0]):
        for j in range(start.shape[1]):
            motion[0, f, j], motion[1, f, j] = start[f, j], hand.rates[f, j]
            motion[2, f, j], motion[3, f, j] = hand.lower[f, j], hand.upper[f, j]
    opened = np.minimum(np.maximum(start, hand.lower), hand.upper)
    gaps = open_gaps(nodes, frame, hand, pose, opened)
    deepest, deep = 0.0, 0.0
    for gap in gaps:
        deepest = max(deepest, -gap)
        deep += max(-gap, 0.0)
    if deepest > 0.0:
        return Attempt(deepest, deep, opened, np.zeros(start.size, np.bool_), np.empty((0, 8)))
    bases, palms = placed(pose, hand.bases), placed(pose, hand.palm_poses)
    brush = depth if model == GRADED else 0.0
    free = np.full(start.shape, np.inf)
    joints, touched, passes, _ = _closed(nodes, frame, hand, bases, palms, motion, adaptive, brush, free.copy())
    if model == SINGLE:
        rows = touch_contacts(nodes, frame, link_ends(bases, hand.chains, joints), touched, hand.radii)
        return Attempt(0.0, 0.0, joints, touched, rows)
    rows = felt(nodes, frame, hand, pose, joints, depth, model == GRADED, 0, start.size + 1)
    if model == GRADED:
        for f in range(len(start)):
            _mix_finger(f, nodes, frame, hand, pose, bases, palms, motion, adaptive, depth, joints, passes, rows)
    return Attempt(0.0, 0.0, joints, touched, rows)


@njit(cache=True)
def _closed(nodes, frame, hand, bases, palms, motion, adaptive, brush, stop):
    """Close the hand; return the fields of `Closed`."""
    return close_hand(
        nodes,
        frame,
        bases,
        hand.chains,
        hand.reach,
        motion,
        hand.radii,
        palms,
        hand.halves,
        hand.roundings,
        hand.neighbors,
        adaptive,
        CLOSED,
        brush,
        stop,
    )


@njit(cache=True)
def _mix_finger(finger, nodes, frame, hand, pose, bases, palms, motion, adaptive, depth, joints, passes, rows):
    """Replace what the skin of a finger feels by the mixture of the finger's outcomes, if there are several.

    `joints` and `passes` are those of the closing in which nothing is held. An outcome in which a link is held has
    outcomes of its own, where links pass after that.
    """
    per_finger = hand.radii.shape[1]
    first, last = per_finger * finger, per_finger * (finger + 1)
    held = [np.full(per_finger, np.inf)]  # times at which joints of the finger are held
    after, shares = [0.0], [1.0]
    mixture = np.zeros(rows.shape)
    outcomes = 0
    while len(shares) > 0:
        hold, since, share = held.pop(), after.pop(), shares.pop()
        if outcomes > 0:
            stop = np.full(hand.radii.shape, np.inf)
            for j in range(per_finger):
                stop[finger, j] = hold[j]
            joints, _, passes, _ = _closed(nodes, frame, hand, bases, palms, motion, adaptive, depth, stop)
        left, time, link = 1.0, since, -1
        while True:  # passes in the order of their times, of equal ones by link
            following, when = -1, np.inf
            for b in range(first, last):
                t = passes[b, 0]
                if since < t < CLOSED and (t > time or (t == time and b > link)) and t < when:
                    following, when = b, t
            if following < 0:
                break
            link, time = following, when
            part = left * pass_share(passes[link, 1], passes[link, 2], depth)
            if share * part < _LEAST_SHARE:
                continue
            kept = hold.copy()
            for j in range(link - first + 1 if adaptive else per_finger):
                kept[j] = min(kept[j], time)
            held.append(kept)
            after.append(time)
            shares.append(share * part)
            left -= part
        if outcomes == 0 and len(shares) == 0:
            return
        outcomes += 1
        outcome = felt(nodes, frame, hand, pose, joints, depth, True, first, last)
        add_outcome(mixture, outcome, share * left, first, last)
    end_mixture(mixture, rows, first, last)

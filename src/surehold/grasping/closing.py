"""Close the hand: every finger moves until it first touches, found by conservative advancement (compiled).

    t       closing parameter, from 0 (open) to T (closed); it is the clock of all fingers
    q(t)    joint angles, clip(start + rate t, lower, upper), rad
    gap     distance between two bodies, m
    v       upper bound of the speed at which a gap can shrink, m per unit of t

A gap that is g at time t stays open until t + g / v. The times until which each gap is certified open are kept, and
always the earliest of them is looked at again: no step size, no touch missed, and the exact order of the touches
(Mirtich 1996, chapter 2; Zhang, Lee and Kim 2006). A gap below `TOUCH` is a touch.

`adaptive`: a touch stops the joints that move the touching link; the links beyond it go on. `synergy`: it stops all
joints of the finger. Fingers stop each other and stop at the palm in the same way. Bodies of the hand that already
touch while it is open are neighbors at rest and are not looked at.
"""

from typing import Final

import numpy as np
from numba import njit

from surehold.grasping.clearance import box_gap, capsule_gap, capsule_pair_gap, palm_gap
from surehold.grasping.hand import finger_joints

__all__ = ["CLOSING_MODES", "TOUCH", "close_hand", "hand_gaps", "link_ends"]

CLOSING_MODES: Final = ("adaptive", "synergy")
TOUCH: Final = 5e-6  #: a smaller gap is a touch [m]
_LINKS = 20
_PALM_LINKS = 10  # the middle and distal links of the five fingers can reach the palm


@njit(cache=True)
def _joint_angle(start, rate, lower, upper, t):
    return min(max(start + rate * t, lower), upper)


@njit(cache=True)
def _finger_at(f, t, bases, chains, motion, stopped, angles, ends):
    """Write the link ends of finger f at time t; motion is (4, 5, 4): start, rate, lower, upper."""
    q = np.empty(4)
    for j in range(4):
        if stopped[f, j]:
            q[j] = angles[f, j]
        else:
            q[j] = min(max(motion[0, f, j] + motion[1, f, j] * t, motion[2, f, j]), motion[3, f, j])
    finger_joints(bases[f], chains[f], q[0], q[1], q[2], q[3], ends)


@njit(cache=True)
def _speed(f, k, t, motion, stopped, reach):
    """Return an upper bound of the speed of link k of finger f from time t on."""
    v = 0.0
    for j in range(k + 1):
        rate = motion[1, f, j]
        if stopped[f, j] or rate == 0.0:
            continue
        final = motion[3, f, j] if rate > 0.0 else motion[2, f, j]
        if (motion[0, f, j] + rate * t - final) * rate < 0.0:  # not yet at the end of its range
            v += abs(rate) * reach[f, j, k]
    return v


@njit(cache=True)
def _begins(f, k, motion, stopped):
    """Return the time at which the first joint that moves link k of finger f leaves the end of its range."""
    first = np.inf
    for j in range(k + 1):
        rate = motion[1, f, j]
        if not stopped[f, j] and rate != 0.0:
            origin = motion[2, f, j] if rate > 0.0 else motion[3, f, j]
            first = min(first, max((origin - motion[0, f, j]) / rate, 0.0))
    return first


@njit(cache=True)
def link_ends(bases, chains, angles):
    """Return the ends of all link axes (20, 2, 3) at joint angles (5, 4)."""
    ends = np.empty((_LINKS, 2, 3))
    for f in range(5):
        finger_joints(
            bases[f], chains[f], angles[f, 0], angles[f, 1], angles[f, 2], angles[f, 3], ends[4 * f : 4 * f + 4]
        )
    return ends


@njit(cache=True)
def hand_gaps(nodes, frame, ends, radius, palm, half, rounding, enough):
    """Return the gaps (21,) between the bodies of a resting hand and the object [m]; the palm is the last one."""
    gaps = np.empty(_LINKS + 1)
    for b in range(_LINKS):
        gaps[b] = capsule_gap(nodes, frame, ends[b, 0], ends[b, 1], radius, 1e-6, 0.0)[0]
    gaps[_LINKS] = palm_gap(nodes, frame, palm, half, rounding, 1e-5, enough)
    return gaps


@njit(cache=True)
def close_hand(nodes, frame, bases, chains, reach, motion, radius, palm, half, rounding, adaptive, closed):
    """Close the hand from its open posture, which must not touch the object.

    Returns the joint angles (5, 4), for each link whether it touched the object (20,), and the number of gaps computed.
    """
    stopped = np.zeros((5, 4), dtype=np.bool_)
    angles = np.zeros((5, 4))
    touched = np.zeros(_LINKS, dtype=np.bool_)
    mine = np.empty((4, 2, 3))
    other = np.empty((4, 2, 3))

    # The gaps to watch: link - object, link - palm, link - link of another finger.
    n_pairs = 10 * 16
    total = _LINKS + _PALM_LINKS + n_pairs
    first = np.empty(total, dtype=np.int64)
    second = np.full(total, -1, dtype=np.int64)  # -1 the object, -2 the palm, else a link
    n = 0
    for b in range(_LINKS):
        first[n] = b
        n += 1
    for f in range(5):
        for k in range(2, 4):
            first[n], second[n] = 4 * f + k, -2
            n += 1
    for f in range(5):
        for g in range(f + 1, 5):
            for k in range(4):
                for m in range(4):
                    first[n], second[n] = 4 * f + k, 4 * g + m
                    n += 1
    open_until = np.empty(total)
    resting = np.zeros(total, dtype=np.bool_)  # not looked at yet: at the first look a touch between neighbors is rest
    for i in range(total):
        until = _begins(first[i] // 4, first[i] % 4, motion, stopped)
        if second[i] >= 0:
            until = min(until, _begins(second[i] // 4, second[i] % 4, motion, stopped))
            resting[i] = True
        elif second[i] == -2:
            resting[i] = True
        open_until[i] = until
    looks = 0
    while True:
        i = 0
        for k in range(1, total):
            if open_until[k] < open_until[i]:
                i = k
        t = open_until[i]
        if t >= closed:
            break
        a, b = first[i], second[i]
        fa, ka = a // 4, a % 4
        v = _speed(fa, ka, t, motion, stopped, reach)
        if b >= 0:
            v += _speed(b // 4, b % 4, t, motion, stopped, reach)
        if v == 0.0:
            open_until[i] = np.inf
            continue
        looks += 1
        _finger_at(fa, t, bases, chains, motion, stopped, angles, mine)
        if b == -1:
            gap = capsule_gap(nodes, frame, mine[ka, 0], mine[ka, 1], radius, 0.2 * TOUCH, 0.2)[0]
        elif b == -2:
            gap = box_gap(palm, half, rounding, mine[ka, 0], mine[ka, 1], radius)
        else:
            _finger_at(b // 4, t, bases, chains, motion, stopped, angles, other)
            gap = capsule_pair_gap(mine[ka, 0], mine[ka, 1], other[b % 4, 0], other[b % 4, 1], 2.0 * radius)
        if gap > TOUCH:
            open_until[i] = t + (gap - 0.5 * TOUCH) / v
            resting[i] = False
            continue
        open_until[i] = np.inf
        if resting[i]:
            continue
        if b == -1:
            touched[a] = True
        for body in (a, b):
            if body < 0:
                continue
            f, last = body // 4, (body % 4 if adaptive else 3)
            moving = _speed(f, body % 4, t, motion, stopped, reach) > 0.0
            for j in range(last + 1):
                if moving and not stopped[f, j]:
                    stopped[f, j] = True
                    angles[f, j] = _joint_angle(motion[0, f, j], motion[1, f, j], motion[2, f, j], motion[3, f, j], t)
    for f in range(5):
        for j in range(4):
            if not stopped[f, j]:
                angles[f, j] = _joint_angle(motion[0, f, j], motion[1, f, j], motion[2, f, j], motion[3, f, j], closed)
    return angles, touched, looks

"""Close the hand: every finger moves until it first touches, found by conservative advancement (compiled).

    t       closing parameter, from 0 (open) to T (closed); it is the clock of all fingers
    t_j     when joint j is stopped; infinite while nothing stops it
    q(t)    joint angles, clip(start + rate min(t, t_j), lower, upper), rad
    gap     distance between two bodies, m
    v       upper bound of the speed at which a gap can shrink, m per unit of t

A gap that is g at time t stays open until t + g / v. The times until which each gap is certified open are kept, and
always the earliest of them is looked at again: no step size, no touch missed, and the exact order of the touches
(Mirtich 1996, chapter 2; Zhang, Lee and Kim 2006). A gap below `TOUCH` is a touch.

`adaptive`: a touch stops the joints that move the touching link; the links beyond it go on. `synergy`: it stops all
joints of the finger. Fingers stop each other and stop at the palm in the same way. Bodies of the hand that already
touch while it is open are neighbors at rest and are not looked at.

Passes. A link that comes near the object and goes past it without a touch ends up far away from where a touch would
have left it: however soft the contacts, the outcome jumps between a narrow hit and a narrow miss. The closest approach
of such a link is therefore reported, if it is nearer than `brush`, and the closing can be repeated with the link held
there; contacts.py blends the two outcomes.
"""

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from surehold.grasping.clearance import box_gap, capsule_gap, capsule_pair_gap, palm_gap
from surehold.grasping.hand import finger_joints

__all__ = ["CLOSING_MODES", "TOUCH", "Closed", "close_hand", "hand_gaps", "link_ends"]

CLOSING_MODES: Final = ("adaptive", "synergy")
TOUCH: Final = 5e-6  #: a smaller gap is a touch [m]
_LINKS = 20
_PALM_LINKS = 10  # the middle and distal links of the five fingers can reach the palm


class Closed(NamedTuple):
    """How a hand has closed."""

    joints: NDArray[np.float64]  #: (5, 4) rad
    touched: NDArray[np.bool_]  #: (20,) which links were stopped by the object
    pass_time: NDArray[np.float64]  #: (20,) closing parameter of a link's closest approach in passing, infinite if none
    pass_gap: NDArray[np.float64]  #: (20,) gap there, below `brush` [m]
    pass_leave: NDArray[np.float64]  #: (20,) largest gap found afterwards [m]
    looks: int  #: number of gaps computed


@njit(cache=True)
def _finger_at(f, t, bases, chains, motion, stop, ends):
    """Write the link ends of finger f at time t; motion is (4, 5, 4): start, rate, lower, upper; stop (5, 4)."""
    q = np.empty(4)
    for j in range(4):
        angle = motion[0, f, j] + motion[1, f, j] * min(t, stop[f, j])
        q[j] = min(max(angle, motion[2, f, j]), motion[3, f, j])
    finger_joints(bases[f], chains[f], q[0], q[1], q[2], q[3], ends)


@njit(cache=True)
def _speed(f, k, t, motion, stop, reach):
    """Return an upper bound of the speed of link k of finger f from time t on."""
    v = 0.0
    for j in range(k + 1):
        rate = motion[1, f, j]
        if stop[f, j] <= t or rate == 0.0:
            continue
        final = motion[3, f, j] if rate > 0.0 else motion[2, f, j]
        if (motion[0, f, j] + rate * t - final) * rate < 0.0:  # not yet at the end of its range
            v += abs(rate) * reach[f, j, k]
    return v


@njit(cache=True)
def _begins(f, k, motion, stop):
    """Return the time at which the first joint that moves link k of finger f leaves the end of its range."""
    first = np.inf
    for j in range(k + 1):
        rate = motion[1, f, j]
        if stop[f, j] > 0.0 and rate != 0.0:
            origin = motion[2, f, j] if rate > 0.0 else motion[3, f, j]
            first = min(first, max((origin - motion[0, f, j]) / rate, 0.0))
    return first


@njit(cache=True)
def _gap_at(f, k, t, nodes, frame, bases, chains, motion, stop, radius, ends):
    """Return the gap between link k of finger f and the object at time t [m]."""
    _finger_at(f, t, bases, chains, motion, stop, ends)
    return capsule_gap(nodes, frame, ends[k, 0], ends[k, 1], radius, 1e-6, 0.0)[0]


@njit(cache=True)
def _closest(f, k, early, late, nodes, frame, bases, chains, motion, stop, radius, ends):
    """Return time and gap of the closest approach between two times; an infinite gap if it is at one of them."""
    share = 0.5 * (np.sqrt(5.0) - 1.0)  # golden section
    a, b = early, late
    c, d = b - share * (b - a), a + share * (b - a)
    gc = _gap_at(f, k, c, nodes, frame, bases, chains, motion, stop, radius, ends)
    gd = _gap_at(f, k, d, nodes, frame, bases, chains, motion, stop, radius, ends)
    for _ in range(22):  # to 3e-5 of the interval
        if gc < gd:
            b, d, gd = d, c, gc
            c = b - share * (b - a)
            gc = _gap_at(f, k, c, nodes, frame, bases, chains, motion, stop, radius, ends)
        else:
            a, c, gc = c, d, gd
            d = a + share * (b - a)
            gd = _gap_at(f, k, d, nodes, frame, bases, chains, motion, stop, radius, ends)
    t, gap = (c, gc) if gc < gd else (d, gd)
    first = _gap_at(f, k, early, nodes, frame, bases, chains, motion, stop, radius, ends)
    last = _gap_at(f, k, late, nodes, frame, bases, chains, motion, stop, radius, ends)
    return t, (gap if gap < min(first, last) else np.inf)


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
def close_hand(nodes, frame, bases, chains, reach, motion, radius, palm, half, rounding, adaptive, closed, brush, stop):
    """Close the hand from its open posture, which must not touch the object.

    Passes nearer than `brush` are reported (0: none). `stop` (5, 4) holds times at which joints are stopped, whatever
    they touch, infinite for none; it is changed to the times at which they were. Returns the fields of `Closed`.
    """
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
        until = _begins(first[i] // 4, first[i] % 4, motion, stop)
        if second[i] >= 0:
            until = min(until, _begins(second[i] // 4, second[i] % 4, motion, stop))
            resting[i] = True
        elif second[i] == -2:
            resting[i] = True
        open_until[i] = until
    pass_time = np.full(_LINKS, np.inf)
    pass_gap = np.full(_LINKS, np.inf)
    pass_leave = np.zeros(_LINKS)
    looked = np.full((_LINKS, 2), np.inf)  # gap at the last look and at the one before
    times = np.zeros((_LINKS, 2))
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
        v = _speed(fa, ka, t, motion, stop, reach)
        if b >= 0:
            v += _speed(b // 4, b % 4, t, motion, stop, reach)
        if v == 0.0:
            open_until[i] = np.inf
            continue
        looks += 1
        _finger_at(fa, t, bases, chains, motion, stop, mine)
        if b == -1:
            gap = capsule_gap(nodes, frame, mine[ka, 0], mine[ka, 1], radius, 0.2 * TOUCH, 0.2)[0]
        elif b == -2:
            gap = box_gap(palm, half, rounding, mine[ka, 0], mine[ka, 1], radius)
        else:
            _finger_at(b // 4, t, bases, chains, motion, stop, other)
            gap = capsule_pair_gap(mine[ka, 0], mine[ka, 1], other[b % 4, 0], other[b % 4, 1], 2.0 * radius)
        if b == -1 and brush > 0.0:
            pass_leave[a] = max(pass_leave[a], gap)
            if looked[a, 0] < 1.5 * brush and looked[a, 0] <= looked[a, 1] and looked[a, 0] < gap:
                when, near = _closest(fa, ka, times[a, 1], t, nodes, frame, bases, chains, motion, stop, radius, other)
                if near < min(brush, pass_gap[a]):
                    pass_time[a], pass_gap[a], pass_leave[a] = when, near, gap
            looked[a, 1], times[a, 1] = looked[a, 0], times[a, 0]
            looked[a, 0], times[a, 0] = gap, t
        if gap > TOUCH:
            advance = gap - 0.5 * TOUCH
            if b == -1 and gap < 2.0 * brush:
                advance = min(advance, 0.5 * brush)  # no closest approach slips through between two looks
            open_until[i] = t + advance / v
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
            if _speed(f, body % 4, t, motion, stop, reach) > 0.0:
                for j in range(last + 1):
                    stop[f, j] = min(stop[f, j], t)
    joints = np.empty((5, 4))
    for f in range(5):
        for j in range(4):
            angle = motion[0, f, j] + motion[1, f, j] * min(closed, stop[f, j])
            joints[f, j] = min(max(angle, motion[2, f, j]), motion[3, f, j])
    return joints, touched, pass_time, pass_gap, pass_leave, looks

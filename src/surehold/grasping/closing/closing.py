"""Close the hand: every finger moves until it first touches, found by conservative advancement (compiled).

    t       closing parameter, from 0 (open) to T (closed); it is the clock of all fingers
    t_j     when joint j is stopped; infinite while nothing stops it
    q(t)    joint angles, clip(start + rate min(t, t_j), lower, upper), rad
    gap     distance between two bodies, m
    v       upper bound of the speed at which a gap can shrink, m per unit of t

A gap that is g at time t stays open until t + g / v. The times until which each gap is certified open are kept, and
always the earliest of them is looked at again: no step size, no touch missed, and the exact order of the touches
(Mirtich 1996, chapter 2; Zhang, Lee and Kim 2006). A gap below `TOUCH` is a touch; one that does not fall below half
of it may pass. Two links also stay apart as long as they are along one direction in which they approach slowly:
fingers beside each other hardly move along the axes about which they bend.

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
from numpy.typing import NDArray

from surehold.grasping.closing.clearance import (
    box_gap,
    capsule_gap,
    capsule_pair_gap,
    palm_gap,
    piece_memory,
    separation,
)
from surehold.grasping.closing.link_speed import begins, lasts, speed, speed_along
from surehold.grasping.hand.kinematics import axis_ends, frame_columns, moved_joint, next_joint
from surehold.store.kernels import njit

__all__ = ["TOUCH", "Closed", "close_hand", "hand_gaps"]

TOUCH: Final = 5e-6  #: a smaller gap is a touch [m]


class Closed(NamedTuple):
    """How a hand has closed."""

    joints: NDArray[np.float64]  #: (f, j) rad or m
    touched: NDArray[np.bool_]  #: (f j,) which links were stopped by the object
    passes: NDArray[np.float64]
    """(f j, 3) of each link: closing parameter of its closest approach in passing, or infinity; gap there, below
    `brush` [m]; largest gap found afterwards [m]."""
    looks: int  #: number of gaps computed


@njit(cache=True)
def _link_at(f, k, t, bases, chains, motion, stop, ends, turns):
    """Write the ends (2, 3) of link k of finger f at time t, and the axes of the joints up to it into turns (j, 3).

    motion is (4, f, j): start, rate, lower, upper.
    """
    x, y, z, p = frame_columns(bases[f])
    for j in range(k + 1):
        if j > 0:
            x, y, z, p = next_joint(chains[f, j - 1], x, y, z, p)
        angle = motion[0, f, j] + motion[1, f, j] * min(t, stop[f, j])
        x, y, p = moved_joint(chains[f, j], min(max(angle, motion[2, f, j]), motion[3, f, j]), x, y, z, p)
        turns[j, 0], turns[j, 1], turns[j, 2] = z
    axis_ends(chains[f, k], x, y, z, p, ends)


@njit(cache=True)
def _gap_at(f, k, t, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces):
    """Return the gap between link k of finger f and the object at time t [m]."""
    _link_at(f, k, t, bases, chains, motion, stop, ends, turns)
    return capsule_gap(nodes, frame, ends[0], ends[1], radius, 1e-6, 0.0, pieces)[0]


@njit(cache=True)
def _closest(f, k, early, late, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces):
    """Return time and gap of the closest approach between two times; an infinite gap if it is at one of them."""
    share = 0.5 * (np.sqrt(5.0) - 1.0)  # golden section
    a, b = early, late
    c, d = b - share * (b - a), a + share * (b - a)
    gc = _gap_at(f, k, c, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces)
    gd = _gap_at(f, k, d, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces)
    for _ in range(22):  # to 3e-5 of the interval
        if gc < gd:
            b, d, gd = d, c, gc
            c = b - share * (b - a)
            gc = _gap_at(f, k, c, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces)
        else:
            a, c, gc = c, d, gd
            d = a + share * (b - a)
            gd = _gap_at(f, k, d, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces)
    t, gap = (c, gc) if gc < gd else (d, gd)
    first = _gap_at(f, k, early, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces)
    last = _gap_at(f, k, late, nodes, frame, bases, chains, motion, stop, radius, ends, turns, pieces)
    return t, (gap if gap < min(first, last) else np.inf)


@njit(cache=True)
def _sift(heap, i, open_until):
    """Move the entry at place i of a heap down to where no gap below it is open for a shorter time.

    The heap holds numbers of gaps, the one that is open for the shortest time first, of equals the lowest number.
    """
    n = heap.shape[0]
    mine = heap[i]
    t = open_until[mine]
    while True:
        child = 2 * i + 1
        if child >= n:
            break
        best = heap[child]
        if child + 1 < n:
            other = heap[child + 1]
            if open_until[other] < open_until[best] or (open_until[other] == open_until[best] and other < best):
                child, best = child + 1, other
        if open_until[best] > t or (open_until[best] == t and best > mine):
            break
        heap[i] = best
        i = child
    heap[i] = mine


@njit(cache=True)
def hand_gaps(nodes, frame, ends, radii, palms, halves, roundings, enough):
    """Return the gaps (f j + 1,) between the bodies of a resting hand and the object [m]; the palm is the last one.

    A link that is not there has an infinite gap.
    """
    links = ends.shape[0]
    gaps, pieces = np.full(links + 1, np.inf), piece_memory()
    for b in range(links):
        radius = radii[b // radii.shape[1], b % radii.shape[1]]
        if radius > 0.0:
            gaps[b] = capsule_gap(nodes, frame, ends[b, 0], ends[b, 1], radius, 1e-6, 0.0, pieces)[0]
    for p in range(palms.shape[0]):
        gap = palm_gap(nodes, frame, palms[p], halves[p], roundings[p], 1e-5, enough)
        gaps[links] = min(gaps[links], gap)
    return gaps


@njit(cache=True)
def close_hand(
    nodes,
    frame,
    bases,
    chains,
    reach,
    motion,
    radii,
    palms,
    halves,
    roundings,
    neighbors,
    adaptive,
    closed,
    brush,
    stop,
):
    """Close the hand from its open posture, which must not touch the object.

    A link is stopped by the palm or by another finger unless it touches that at its first look already: neighbors in
    the chain rest on each other, and those of `neighbors` (f j, p) are links and boxes of the palm that always may.
    Passes nearer than `brush` are reported (0: none). `stop` (f, j) holds times at which
    joints are stopped, whatever they touch, infinite for none; it is changed to the times at which they were.
    Returns the fields of `Closed`.
    """
    fingers, per_finger = radii.shape
    links = fingers * per_finger
    touched = np.zeros(links, dtype=np.bool_)
    mine, other = np.empty((2, 3)), np.empty((2, 3))
    turns, turns_b = np.empty((per_finger, 3)), np.empty((per_finger, 3))
    across, pieces = np.empty(3), piece_memory()

    # The gaps to watch: link - object, link - palm, link - link of another finger.
    most = links * (1 + palms.shape[0]) + links * links // 2
    first = np.empty(most, dtype=np.int64)
    second = np.full(most, -1, dtype=np.int64)  # -1 the object, -2 - p box p of the palm, else a link
    total = 0
    for b in range(links):
        f, k = b // per_finger, b % per_finger
        if radii[f, k] <= 0.0:
            continue
        first[total] = b
        total += 1
        for p in range(palms.shape[0]):
            if not neighbors[b, p]:
                first[total], second[total] = b, -2 - p
                total += 1
        for c in range((f + 1) * per_finger, links):
            if radii[c // per_finger, c % per_finger] > 0.0:
                first[total], second[total] = b, c
                total += 1
    open_until = np.empty(total)
    resting = np.zeros(total, dtype=np.bool_)  # not looked at yet: at the first look a touch between neighbors is rest
    for i in range(total):
        until = begins(first[i] // per_finger, first[i] % per_finger, motion, stop)
        if second[i] >= 0:
            until = min(until, begins(second[i] // per_finger, second[i] % per_finger, motion, stop))
        resting[i] = second[i] != -1
        open_until[i] = until
    passes = np.empty((links, 3))
    passes[:, :2], passes[:, 2] = np.inf, 0.0
    looked = np.full((links, 2), np.inf)  # gap at the last look and at the one before
    times = np.zeros((links, 2))
    looks = 0
    heap = np.arange(total)
    for k in range(total // 2 - 1, -1, -1):
        _sift(heap, k, open_until)
    while True:
        _sift(heap, 0, open_until)  # the gap that was looked at last
        i = heap[0]
        t = open_until[i]
        if t >= closed:
            break
        a, b = first[i], second[i]
        fa, ka = a // per_finger, a % per_finger
        fb, kb = b // per_finger, b % per_finger  # of use where b is a link
        v = speed(fa, ka, t, motion, stop, reach)
        if b >= 0:
            v += speed(fb, kb, t, motion, stop, reach)
        if v == 0.0:
            open_until[i] = np.inf
            continue
        looks += 1
        radius = radii[fa, ka]
        _link_at(fa, ka, t, bases, chains, motion, stop, mine, turns)
        if b == -1:
            gap = 0.0
            if not looked[a, 0] < 2.0 * brush:
                gap = capsule_gap(nodes, frame, mine[0], mine[1], radius, 0.2 * TOUCH, 0.2, pieces)[0]
            if gap < 2.0 * brush:  # a gap that is underrated now and then hides the closest approach
                gap = capsule_gap(nodes, frame, mine[0], mine[1], radius, 0.2 * TOUCH, 0.0, pieces)[0]
        elif b < -1:
            gap = box_gap(palms[-2 - b], halves[-2 - b], roundings[-2 - b], mine[0], mine[1], radius)
        else:
            _link_at(fb, kb, t, bases, chains, motion, stop, other, turns_b)
            gap = capsule_pair_gap(mine[0], mine[1], other[0], other[1], radius + radii[fb, kb], across)
        if b == -1 and brush > 0.0:
            passes[a, 2] = max(passes[a, 2], gap)
            if looked[a, 0] < 1.5 * brush and looked[a, 0] <= looked[a, 1] and looked[a, 0] < gap:
                when, near = _closest(
                    fa, ka, times[a, 1], t, nodes, frame, bases, chains, motion, stop, radius, other, turns, pieces
                )
                if near < min(brush, passes[a, 1]):
                    passes[a, 0], passes[a, 1], passes[a, 2] = when, near, gap
            looked[a, 1], times[a, 1] = looked[a, 0], times[a, 0]
            looked[a, 0], times[a, 0] = gap, t
        if gap > TOUCH:
            advance = gap - 0.5 * TOUCH
            if b == -1 and gap < 2.0 * brush:
                advance = min(advance, 0.5 * brush)  # no closest approach slips through between two looks
            open_for = advance / v
            if b >= 0:
                for direction in range(2):
                    if t + open_for >= closed:
                        break
                    if direction == 1:  # fingers beside each other move across the axis about which they bend
                        for n in range(3):
                            across[n] = turns[ka, n]
                    parted = separation(mine[0], mine[1], other[0], other[1], across)
                    va, wa = speed_along(fa, ka, t, across, motion, stop, reach, chains, turns)
                    vb, wb = speed_along(fb, kb, t, across, motion, stop, reach, chains, turns_b)
                    parted -= radius + radii[fb, kb] + 0.5 * TOUCH
                    open_for = max(open_for, lasts(parted, va + vb, wa + wb))
            open_until[i] = t + open_for
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
            f, k = body // per_finger, body % per_finger
            last = k if adaptive else per_finger - 1
            if speed(f, k, t, motion, stop, reach) > 0.0:
                for j in range(last + 1):
                    stop[f, j] = min(stop[f, j], t)
    joints = np.empty((fingers, per_finger))
    for f in range(fingers):
        for j in range(per_finger):
            angle = motion[0, f, j] + motion[1, f, j] * min(closed, stop[f, j])
            joints[f, j] = min(max(angle, motion[2, f, j]), motion[3, f, j])
    return joints, touched, passes, looks

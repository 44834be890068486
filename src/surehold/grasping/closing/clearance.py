"""Gaps between the hand's bodies and the object, and between two bodies of the hand (compiled).

    f(s)   distance of the object from the point s of a capsule's axis, m      D   length of a piece of the axis, m
    r      radius of the capsule, m                                            gap = min f - r

The distance to any set is semiconcave: f'' <= 1/f along a line of unit speed. Between two samples it therefore lies
at most D^2 / (8 f) below the smaller one (Cannarsa and Sinestrari 2004, section 2.2), and, being 1-Lipschitz, never
below (f_a + f_b - D) / 2. Pieces that cannot hold the minimum are dropped, the others are halved: the gap is found
to the tolerance, whatever the shape of the object.
"""

import numpy as np

from surehold.grasping.object.distance_field import field_distance
from surehold.store.kernels import njit

__all__ = ["box_gap", "capsule_gap", "capsule_pair_gap", "palm_gap", "piece_memory", "separation"]

_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_DEPTH = 64  # more than the halvings of 0.1 m that anyone can ask for, and the siblings that wait meanwhile


@njit(cache=True)
def _below(fa, fb, length):
    """Return a lower bound of the distance between two samples fa, fb that lie `length` apart."""
    bound = 0.5 * (fa + fb - length)
    if bound > 0.0:
        bound = max(bound, min(fa, fb) - length * length / (8.0 * bound))
    return bound


@njit(cache=True)
def piece_memory():
    """Return memory for pieces of a capsule's axis, (4, n): to ask for it at every look would take as long as that."""
    return np.empty((4, _DEPTH))


@njit(cache=True)
def capsule_gap(nodes, frame, near, far, radius, tolerance, slack, pieces):
    """Return the gap of a capsule to the object [m], never overrated by more than `tolerance`, and where it is.

    The gap may be underrated by `tolerance` + `slack` x gap. Second number: place of the minimum on the axis, 0 to 1.
    `pieces` is memory, `piece_memory()`.
    """
    length = np.sqrt((far[0] - near[0]) ** 2 + (far[1] - near[1]) ** 2 + (far[2] - near[2]) ** 2)
    start, size, left, right = pieces[0], pieces[1], pieces[2], pieces[3]
    start[0], size[0] = 0.0, 1.0
    left[0] = field_distance(nodes, frame, near[0], near[1], near[2])
    right[0] = field_distance(nodes, frame, far[0], far[1], far[2])
    best, where = (left[0], 0.0) if left[0] <= right[0] else (right[0], 1.0)
    certain = best
    n = 1
    while n > 0:
        n -= 1
        s, w, fa, fb = start[n], size[n], left[n], right[n]
        bound = _below(fa, fb, w * length)
        allowed = tolerance + slack * max(best - radius, 0.0)
        if bound >= best - allowed or w * length < 1e-6:
            certain = min(certain, max(bound, best - allowed))
            continue
        m = s + 0.5 * w
        fm = field_distance(
            nodes,
            frame,
            near[0] + m * (far[0] - near[0]),
            near[1] + m * (far[1] - near[1]),
            near[2] + m * (far[2] - near[2]),
        )
        if fm < best:
            best, where = fm, m
        first, second = (n, n + 1) if fa > fb else (n + 1, n)  # the nearer half is looked at first
        start[first], size[first], left[first], right[first] = s, 0.5 * w, fa, fm
        start[second], size[second], left[second], right[second] = m, 0.5 * w, fm, fb
        n += 2
    return certain - radius, where


@njit(cache=True)
def capsule_pair_gap(p, q, u, v, radii, across):
    """Return the gap between capsules of axes p-q and u-v whose radii sum to `radii` [m] (Lumelsky 1985).

    The unit vector from the point of p-q that is nearest to that of u-v is written to `across` (3,): 0 if they meet.
    """
    aa, bb, ab, ac, bc = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        a, b, c = q[i] - p[i], v[i] - u[i], u[i] - p[i]
        aa += a * a
        bb += b * b
        ab += a * b
        ac += a * c
        bc += b * c
    det = aa * bb - ab * ab
    s = 0.0
    if det > 1e-12 * aa * bb:
        s = min(max((ac * bb - bc * ab) / det, 0.0), 1.0)
    t = (s * ab - bc) / bb
    if t < 0.0:
        t = 0.0
        s = min(max(ac / aa, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((ac + ab) / aa, 0.0), 1.0)
    squared = 0.0
    for i in range(3):
        across[i] = u[i] - p[i] + t * (v[i] - u[i]) - s * (q[i] - p[i])
        squared += across[i] * across[i]
    distance = np.sqrt(squared)
    for i in range(3):
        across[i] = across[i] / distance if distance > 0.0 else 0.0
    return distance - radii


@njit(cache=True)
def separation(p, q, u, v, across):
    """Return how far segments p-q and u-v are apart along a unit vector [m]; negative if they overlap there."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        a += across[i] * p[i]
        b += across[i] * q[i]
        c += across[i] * u[i]
        d += across[i] * v[i]
    return max(min(c, d) - max(a, b), min(a, b) - max(c, d))


@njit(cache=True)
def _box_value(pose, half, rounding, x, y, z):
    """Return the signed distance of one point to the rounded box of half extents `half` at `pose` (3, 4) [m]."""
    x, y, z = x - pose[0, 3], y - pose[1, 3], z - pose[2, 3]
    out, deepest = 0.0, -np.inf
    for k in range(3):
        over = abs(pose[0, k] * x + pose[1, k] * y + pose[2, k] * z) - (half[k] - rounding)
        deepest = max(deepest, over)
        out += max(over, 0.0) ** 2
    return (np.sqrt(out) if deepest > 0.0 else deepest) - rounding


@njit(cache=True)
def box_gap(pose, half, rounding, near, far, radius):
    """Return the gap between a capsule and the palm's box [m], underrated by at most 1e-6 and 2 % of itself.

    The distance to a box is convex along the axis: golden section, until no place in what is left can be much nearer.
    """
    dx, dy, dz = far[0] - near[0], far[1] - near[1], far[2] - near[2]
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    lo, hi = 0.0, 1.0
    a, b = 1.0 - _GOLDEN, _GOLDEN
    fa = _box_value(pose, half, rounding, near[0] + a * dx, near[1] + a * dy, near[2] + a * dz)
    fb = _box_value(pose, half, rounding, near[0] + b * dx, near[1] + b * dy, near[2] + b * dz)
    while True:
        gap = min(fa, fb) - radius
        within = (hi - lo) * _GOLDEN * length  # how far the minimum can be from the place of the smaller value
        if within <= max(1e-6, 0.02 * gap):
            return gap - within
        if fa < fb:
            hi, b, fb = b, a, fa
            a = hi - _GOLDEN * (hi - lo)
            fa = _box_value(pose, half, rounding, near[0] + a * dx, near[1] + a * dy, near[2] + a * dz)
        else:
            lo, a, fa = a, b, fb
            b = lo + _GOLDEN * (hi - lo)
            fb = _box_value(pose, half, rounding, near[0] + b * dx, near[1] + b * dy, near[2] + b * dz)


@njit(cache=True)
def palm_gap(nodes, frame, pose, half, rounding, tolerance, enough):
    """Return the gap between the palm's box at `pose` (3, 4) and the object [m], to `tolerance`.

    Gaps above `enough` are reported as at least `enough`. The faces of the box without its rounding are searched; where
    the object meets none of them, the inside, which may hold all of it: the gap is then minus its way to a face.
    """
    best = np.inf
    rectangles = np.empty((256, 4))
    for face in range(6):
        axis, side = face // 2, 2.0 * (face % 2) - 1.0
        k1, k2 = (axis + 1) % 3, (axis + 2) % 3
        h0, h1, h2 = half[axis] - rounding, half[k1] - rounding, half[k2] - rounding
        n = 1
        rectangles[0, 0], rectangles[0, 1], rectangles[0, 2], rectangles[0, 3] = 0.0, 0.0, h1, h2
        while n > 0:
            n -= 1
            cu, cv, hu, hv = rectangles[n, 0], rectangles[n, 1], rectangles[n, 2], rectangles[n, 3]
            x = pose[0, 3] + side * h0 * pose[0, axis] + cu * pose[0, k1] + cv * pose[0, k2]
            y = pose[1, 3] + side * h0 * pose[1, axis] + cu * pose[1, k1] + cv * pose[1, k2]
            z = pose[2, 3] + side * h0 * pose[2, axis] + cu * pose[2, k1] + cv * pose[2, k2]
            f = field_distance(nodes, frame, x, y, z)
            best = min(best, f)
            across = np.sqrt(hu * hu + hv * hv)
            needed = min(best - tolerance, enough + rounding)
            if f - across >= needed:
                continue
            if f > 0.0 and across < 0.25 * f:
                # Semiconcave: on the disk about the center f >= f(0) - slope x across - ...; its corners tell more.
                low = f
                for a in range(4):
                    su, sv = (hu if a & 1 else -hu), (hv if a & 2 else -hv)
                    low = min(
                        low,
                        field_distance(
                            nodes,
                            frame,
                            x + su * pose[0, k1] + sv * pose[0, k2],
                            y + su * pose[1, k1] + sv * pose[1, k2],
                            z + su * pose[2, k1] + sv * pose[2, k2],
                        ),
                    )
                best = min(best, low)
                needed = min(best - tolerance, enough + rounding)
                if low - across * across / (2.0 * (f - across)) >= needed:
                    continue
            if across < 1e-5 or best < rounding - 0.002:  # fine enough; or deep inside, where a rough depth will do
                continue
            if hu >= hv:
                for s in (-0.5, 0.5):
                    rectangles[n, 0], rectangles[n, 1] = cu + s * hu, cv
                    rectangles[n, 2], rectangles[n, 3] = 0.5 * hu, hv
                    n += 1
            else:
                for s in (-0.5, 0.5):
                    rectangles[n, 0], rectangles[n, 1] = cu, cv + s * hv
                    rectangles[n, 2], rectangles[n, 3] = hu, 0.5 * hv
                    n += 1
    if best > rounding and _holds(nodes, frame, pose, half - rounding - best):
        return -best
    return best - rounding


@njit(cache=True)
def _holds(nodes, frame, pose, half):
    """Tell whether a point of the object lies in the box of half extents `half`, which it does not reach into."""
    if half.min() <= 0.0:
        return False
    blocks = np.zeros((256, 6))  # centers and half extents, in the axes of the box
    blocks[0, 3:] = half
    n = 1
    while n > 0:
        n -= 1
        center, size = blocks[n, :3].copy(), blocks[n, 3:].copy()
        x = pose[0, 3] + pose[0, 0] * center[0] + pose[0, 1] * center[1] + pose[0, 2] * center[2]
        y = pose[1, 3] + pose[1, 0] * center[0] + pose[1, 1] * center[1] + pose[1, 2] * center[2]
        z = pose[2, 3] + pose[2, 0] * center[0] + pose[2, 1] * center[1] + pose[2, 2] * center[2]
        f = field_distance(nodes, frame, x, y, z)
        if f < 0.0:
            return True
        reach = np.sqrt(size[0] ** 2 + size[1] ** 2 + size[2] ** 2)
        if f >= reach or reach < 0.5 * frame[3]:  # the field knows nothing that is smaller than a cell
            continue
        longest = int(np.argmax(size))
        for s in (-0.5, 0.5):
            blocks[n, :3], blocks[n, 3:] = center, size
            blocks[n, longest] += s * size[longest]
            blocks[n, 3 + longest] *= 0.5
            n += 1
    return False

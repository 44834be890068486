"""Largest origin-centered ball in the convex hull of wrenches, by expanding only the nearest facet (compiled).

Notation
--------
w       wrenches whose hull H is measured, (m, 6), any unit as long as all six components share it
a, B    round contacts: wrench = a + B z with the unit ball |z| <= 1; a (c, 6), B (c, 6, 3); c = 0 if there are none
h(u)    support function of H: max over w of u.w, and over the round contacts of u.a + |B' u|
n, d    unit normal and offset of a facet of the inner polytope P: P lies in n.x <= d; (6,) and a number
epsilon radius of the largest ball about the origin in H = min of h(u) over all unit vectors u

Method: start from a simplex P of seven wrenches far apart. Take the facet of P with the smallest d. If no wrench lies
above it
(h(n) = d) then d <= h(u) for every unit u, because the facets of P bound a part of H, and the answer is d. Otherwise
add the
wrench farthest above it, remove all facets it sees, and join it to their horizon (beneath-beyond).
The plane of a new facet is not computed from its six vertices. It passes through the horizon ridge between a visible
facet A and
a hidden facet B, so it is the *positive* combination A(s) B - B(s) A of the two planes, as in the double description
method
(Motzkin 1953). No cancellation, no orientation test, and wrenches that are coplanar with B inherit the plane of B
exactly; this
is what makes cones, patches and symmetric grasps, whose wrenches are coplanar by the dozen, harmless.
A wrench is above a facet if it is by more than TOLERANCE times the largest wrench, coplanar ones count as hidden;
this is the placing
triangulation, which is consistent in degenerate positions.
"""

import numpy as np
from numba import njit

__all__ = ["DONE", "FAILED", "FLAT", "OUTSIDE", "SPENT", "TOLERANCE", "expand_nearest", "nearest_point"]

TOLERANCE = 1e-11
"""Distances below this fraction of the largest wrench count as zero."""

DONE = 0
"""The nearest facet is a facet of the hull (or the gap asked for is reached)."""
FLAT = 1
"""The wrenches lie in a hyperplane: no ball."""
OUTSIDE = 2
"""A plane separates the origin from all wrenches."""
FAILED = 3
"""Rounding made the polytope inconsistent; the caller falls back to another method."""
SPENT = 4
"""The budget of facets is used up; the bounds hold all the same."""


@njit(cache=True)
def _support(u, points, m, centers, axes, s):
    """Return the index of the farthest point in direction u (-1: a round contact, written to s) and its h(u)."""
    best, h = -1, -np.inf
    for i in range(m):
        x = points[i]
        value = u[0] * x[0] + u[1] * x[1] + u[2] * x[2] + u[3] * x[3] + u[4] * x[4] + u[5] * x[5]
        if value > h:
            best, h = i, value
    round_best = -1
    for i in range(len(centers)):
        value, length = 0.0, 0.0
        for k in range(3):
            component = 0.0
            for j in range(6):
                component += u[j] * axes[i, j, k]
            length += component * component
        for j in range(6):
            value += u[j] * centers[i, j]
        value += np.sqrt(length)
        if value > h:
            round_best, h = i, value
    if round_best < 0:
        s[:] = points[best]
        return best, h
    length = 0.0
    z = np.zeros(3)
    for k in range(3):
        for j in range(6):
            z[k] += u[j] * axes[round_best, j, k]
        length += z[k] * z[k]
    length = np.sqrt(length)
    for j in range(6):
        s[j] = centers[round_best, j]
        if length > 0.0:
            for k in range(3):
                s[j] += axes[round_best, j, k] * z[k] / length
    return -1, h


@njit(cache=True)
def _spread_simplex(points, m, scale, chosen):
    """Choose seven points, each the farthest from the affine span of those before; return how many there are."""
    rest = np.empty((m, 6))
    best, far = 0, -1.0
    for i in range(m):
        norm = 0.0
        for j in range(6):
            norm += points[i, j] ** 2
        if norm > far:
            best, far = i, norm
    chosen[0] = best
    for i in range(m):
        for j in range(6):
            rest[i, j] = points[i, j] - points[best, j]
    for k in range(1, 7):
        best, far = -1, (TOLERANCE * scale) ** 2
        for i in range(m):
            norm = 0.0
            for j in range(6):
                norm += rest[i, j] ** 2
            if norm > far:
                best, far = i, norm
        if best < 0:
            return k
        chosen[k] = best
        axis = rest[best] / np.sqrt(far)
        for _ in range(2):  # twice is enough (Kahan): the remainders stay orthogonal to the axis to rounding
            for i in range(m):
                along = 0.0
                for j in range(6):
                    along += axis[j] * rest[i, j]
                for j in range(6):
                    rest[i, j] -= along * axis[j]
    return 7


@njit(cache=True)
def _push(keys, ids, size, key, item):
    """Push onto a binary heap ordered by (key, id)."""
    k = size
    while k > 0:
        parent = (k - 1) >> 1
        if keys[parent] < key or (keys[parent] == key and ids[parent] < item):
            break
        keys[k], ids[k] = keys[parent], ids[parent]
        k = parent
    keys[k], ids[k] = key, item


@njit(cache=True)
def _pop(keys, ids, size):
    """Remove the top of a binary heap of the given size; the caller has read it."""
    last = size - 1
    key, item = keys[last], ids[last]
    k = 0
    while True:
        child = 2 * k + 1
        if child >= last:
            break
        right = child + 1
        if right < last and (keys[right] < keys[child] or (keys[right] == keys[child] and ids[right] < ids[child])):
            child = right
        if key < keys[child] or (key == keys[child] and item < ids[child]):
            break
        keys[k], ids[k] = keys[child], ids[child]
        k = child
    keys[k], ids[k] = key, item


@njit(cache=True)
def expand_nearest(wrenches, centers, axes, gap, max_facets):
    """Expand the facet nearest to the origin until it is a facet of the hull.

    Parameters: wrenches (m, 6) with m >= 1; round contacts centers (c, 6), axes (c, 6, 3), which need not be
    among the wrenches;
    gap, the difference between upper and lower bound at which to stop (0: only rounding is left);
    max_facets, the number of facets after which to stop.
    Return (status, lower, upper, normal (6,), expansions, facets): lower <= epsilon <= upper for DONE and SPENT;
    normal is the
    unit vector u with h(u) = upper; for OUTSIDE upper < 0 proves that no ball exists; else the bounds mean nothing.
    """
    m = len(wrenches)
    normal = np.zeros(6)
    scale = 0.0
    for i in range(m):
        norm = 0.0
        for j in range(6):
            norm += wrenches[i, j] ** 2
        scale = max(scale, norm)
    scale = np.sqrt(scale)
    if scale == 0.0:
        return FLAT, 0.0, 0.0, normal, 0, 0
    tolerance = TOLERANCE * scale
    points = wrenches.copy()
    chosen = np.empty(7, np.int64)
    if _spread_simplex(points, m, scale, chosen) < 7:
        return FLAT, 0.0, 0.0, normal, 0, 0

    capacity = 2048
    vertices = np.empty((capacity, 6), np.int64)  # ascending
    neighbors = np.empty((capacity, 6), np.int64)  # neighbors[f, k] lies across the ridge without vertices[f, k]
    planes = np.empty((capacity, 7))  # n, d
    height = np.empty(capacity)  # n.s - d of the wrench being added
    mark = np.zeros(capacity, np.int64)  # expansion that last looked at the facet; -1: removed
    keys = np.empty(capacity)
    ids = np.empty(capacity, np.int64)
    heap_size = 0

    homogeneous = np.ones((7, 7))
    chosen.sort()
    for k in range(7):
        homogeneous[:6, k] = points[chosen[k]]
    barycentric = np.linalg.inv(homogeneous)  # row k: affine function, 1 at corner k, 0 on the opposite facet
    for k in range(7):
        length = np.sqrt(np.sum(barycentric[k, :6] ** 2))
        for j in range(6):
            planes[k, j] = -barycentric[k, j] / length
        planes[k, 6] = barycentric[k, 6] / length
        slot = 0
        for other in range(7):
            if other != k:
                vertices[k, slot] = chosen[other]
                neighbors[k, slot] = other
                slot += 1
        _push(keys, ids, heap_size, planes[k, 6], k)
        heap_size += 1
    n_facets = 7

    s = np.empty(6)
    seen = np.empty(capacity, np.int64)
    horizon = np.empty((capacity, 2), np.int64)  # visible facet, slot of the ridge
    table_size = 4096
    table_key = np.zeros(table_size, np.uint64)
    table_facet = np.empty(table_size, np.int64)
    table_mark = np.zeros(table_size, np.int64)
    upper = np.inf
    lower = -np.inf
    step = 0
    while True:
        while mark[ids[0]] < 0:
            _pop(keys, ids, heap_size)
            heap_size -= 1
        nearest = ids[0]
        lower = planes[nearest, 6]
        s_index, h = _support(planes[nearest], points, m, centers, axes, s)
        if h < upper:
            upper = h
            normal[:] = planes[nearest, :6]
        if h < -tolerance:
            return OUTSIDE, lower, upper, normal, step, n_facets
        if h - lower <= tolerance or upper - lower <= gap:
            return DONE, lower, upper, normal, step, n_facets
        if n_facets >= max_facets or m >= 65535:
            return SPENT, lower, upper, normal, step, n_facets
        if s_index < 0:
            if m == len(points):
                larger = np.empty((2 * m, 6))
                larger[:m] = points
                points = larger
            points[m] = s
            s_index = m
            m += 1

        # the facets seen from s are connected, and the nearest facet is one of them
        step += 1
        height[nearest] = h - lower
        mark[nearest] = step
        seen[0] = nearest
        n_seen, n_horizon, head = 1, 0, 0
        while head < n_seen:
            facet = seen[head]
            head += 1
            for k in range(6):
                if vertices[facet, k] == s_index:
                    return FAILED, lower, upper, normal, step, n_facets
                other = neighbors[facet, k]
                if mark[other] != step:
                    value = -planes[other, 6]
                    for j in range(6):
                        value += planes[other, j] * s[j]
                    height[other] = value
                    mark[other] = step
                    if value > tolerance:
                        if n_seen == len(seen):
                            seen = np.concatenate((seen, np.empty(n_seen, np.int64)))
                        seen[n_seen] = other
                        n_seen += 1
                if height[other] <= tolerance:
                    if n_horizon == len(horizon):
                        horizon = np.concatenate((horizon, np.empty((n_horizon, 2), np.int64)))
                    horizon[n_horizon, 0] = facet
                    horizon[n_horizon, 1] = k
                    n_horizon += 1

        while n_facets + n_horizon > capacity:
            vertices = np.concatenate((vertices, np.empty((capacity, 6), np.int64)))
            neighbors = np.concatenate((neighbors, np.empty((capacity, 6), np.int64)))
            planes = np.concatenate((planes, np.empty((capacity, 7))))
            height = np.concatenate((height, np.empty(capacity)))
            mark = np.concatenate((mark, np.zeros(capacity, np.int64)))
            keys = np.concatenate((keys, np.empty(capacity)))
            ids = np.concatenate((ids, np.empty(capacity, np.int64)))
            capacity *= 2
        if 10 * n_horizon > table_size:
            while 10 * n_horizon > table_size:
                table_size *= 2
            table_key = np.zeros(table_size, np.uint64)
            table_facet = np.empty(table_size, np.int64)
            table_mark = np.zeros(table_size, np.int64)

        open_ridges = 0
        for i in range(n_horizon):
            visible, slot = horizon[i, 0], horizon[i, 1]
            hidden = neighbors[visible, slot]
            new = n_facets + i
            # plane through the ridge and s: positive combination of the two planes through the ridge
            over, under = height[visible], max(0.0, -height[hidden])
            length = 0.0
            for j in range(7):
                planes[new, j] = over * planes[hidden, j] + under * planes[visible, j]
                if j < 6:
                    length += planes[new, j] ** 2
            length = np.sqrt(length)
            if not length > 0.0:
                return FAILED, lower, upper, normal, step, n_facets
            for j in range(7):
                planes[new, j] /= length
            position = 5  # of s among the ascending vertices: insert it into the ridge
            source = 5
            while position >= 0:
                if source == slot:
                    source -= 1
                if source < 0 or vertices[visible, source] < s_index:
                    break
                vertices[new, position] = vertices[visible, source]
                position -= 1
                source -= 1
            vertices[new, position] = s_index
            for k in range(position - 1, -1, -1):
                if source == slot:
                    source -= 1
                vertices[new, k] = vertices[visible, source]
                source -= 1
            mark[new] = 0
            neighbors[new, position] = hidden
            for k in range(6):
                if neighbors[hidden, k] == visible:
                    neighbors[hidden, k] = new
                    break
            # the other five ridges contain s and are shared by exactly two new facets each
            for k in range(6):
                if k == position:
                    continue
                key = np.uint64(0)
                for j in range(6):
                    if j != k and j != position:
                        key = (key << np.uint64(16)) | np.uint64(vertices[new, j])
                cell = np.int64((key * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(20)) & (table_size - 1)
                while table_mark[cell] == step and table_key[cell] != key:
                    cell = (cell + 1) & (table_size - 1)
                if table_mark[cell] != step:
                    table_mark[cell] = step
                    table_key[cell] = key
                    table_facet[cell] = new * 8 + k
                    open_ridges += 1
                else:
                    partner = table_facet[cell]
                    if partner < 0:
                        return FAILED, lower, upper, normal, step, n_facets
                    table_facet[cell] = -1
                    neighbors[new, k] = partner >> 3
                    neighbors[partner >> 3, partner & 7] = new
                    open_ridges -= 1
        if open_ridges != 0:
            return FAILED, lower, upper, normal, step, n_facets
        for i in range(n_seen):
            mark[seen[i]] = -1
        for i in range(n_horizon):
            new = n_facets + i
            _push(keys, ids, heap_size, planes[new, 6], new)
            heap_size += 1
        n_facets += n_horizon


@njit(cache=True)
def nearest_point(wrenches, centers, axes):
    """Return (x, scale): the point x of the hull nearest to the origin (6,), exactly 0 when the origin is in the hull.

    The algorithm of Wolfe 1976 (Finding the nearest point in a polytope): keep few wrenches (a corral) whose
    affine hull's nearest
    point lies inside their convex hull; add the wrench farthest towards the origin; drop wrenches whose weight
    turns negative.
    """
    m = len(wrenches)
    scale = 0.0
    first = 0
    nearest = np.inf
    for i in range(m):
        norm = np.sqrt(np.sum(wrenches[i] ** 2))
        scale = max(scale, norm)
        if norm < nearest:
            first, nearest = i, norm
    tolerance = TOLERANCE * scale
    corral = np.empty((8, 6))
    weights = np.zeros(8)
    corral[0] = wrenches[first]
    weights[0] = 1.0
    n = 1
    x = wrenches[first].copy()
    s = np.empty(6)
    for _ in range(1000):
        length = np.sqrt(np.sum(x * x))
        if length <= tolerance:
            return np.zeros(6), scale
        _, h = _support(-x / length, wrenches, m, centers, axes, s)
        if length + h <= tolerance or n == 8:  # x.s >= |x|^2 for all s: x is the nearest point
            return x, scale
        known = False
        for i in range(n):
            known = known or np.all(corral[i] == s)
        if known:
            return x, scale
        corral[n] = s
        weights[n] = 0.0
        n += 1
        while True:
            # nearest point of the affine hull: weights c0 = 1 - sum c, minimize |q0 + D c|, by least
            # squares (stable if D is thin)
            target = np.zeros(n)
            if n > 1:
                edges = np.empty((6, n - 1))
                for i in range(n - 1):
                    for j in range(6):
                        edges[j, i] = corral[i + 1, j] - corral[0, j]
                rest = np.linalg.lstsq(edges, -corral[0].copy(), 1e-13)[0]
                target[0] = 1.0 - np.sum(rest)
                target[1:] = rest
            else:
                target[0] = 1.0
            if np.min(target) > 1e-13:
                weights[:n] = target
                break
            fraction = 1.0
            for i in range(n):
                if target[i] <= 1e-13 and weights[i] > target[i]:
                    fraction = min(fraction, weights[i] / (weights[i] - target[i]))
            kept = 0
            for i in range(n):
                weight = weights[i] + fraction * (target[i] - weights[i])
                if weight > 1e-13:
                    corral[kept] = corral[i]
                    weights[kept] = weight
                    kept += 1
            if kept == n or kept == 0:
                return x, scale
            n = kept
        x = np.zeros(6)
        for i in range(n):
            x += weights[i] * corral[i]
    return x, scale

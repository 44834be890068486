"""Largest origin-centered ball in the convex hull of wrenches, by expanding only the nearest facet (compiled).

Notation
--------
w        wrenches whose convex hull H is measured, (m, 6), all six components in one unit
a, B     round contacts: all a + B z with |z| <= 1, centers a (c, 6), axes B (c, 6, 3); c = 0 if there are none
h(u)     support function of H: max over w of u.w, and over the round contacts of u.a + |B' u|
P        inner polytope, spanned by some of the wrenches
n, d     outward unit normal (6,) and offset of a facet of P: P lies in n.x <= d
s        the wrench being added to P
epsilon  radius of the largest ball about the origin in H = min of h(u) over all unit vectors u

Method. Start from a simplex P of seven wrenches far apart. Take the facet of P with the smallest d. If no wrench lies
above it, that is h(n) = d, then epsilon = d: the facets of P bound a part of H and none is nearer. Otherwise add the
wrench s farthest above it: remove all facets that s sees and join s to their horizon (beneath-beyond).

The plane of a new facet is not computed from its vertices. It contains the horizon ridge between a facet A that s
sees and a facet B that it does not see, hence it is the *positive* combination A(s) B - B(s) A of their planes, as in
the double description method (Motzkin et al. 1953). There is no cancellation and no orientation test, and if s is
coplanar with B the new facet inherits the plane of B. That makes friction cones, contact patches and symmetric grasps
harmless, whose wrenches are coplanar by the dozen and force Qhull to joggle them.

s sees a facet if it lies above it by more than a tolerance. Not to see coplanar facets is the placing triangulation,
which is consistent however degenerate the wrenches are.
"""

import numpy as np

from surehold.store.kernels import njit

__all__ = ["DONE", "FAILED", "FLAT", "OUTSIDE", "SPENT", "expand_nearest"]

DONE = 0
"""The nearest facet is a facet of the hull, or the gap asked for is reached."""
FLAT = 1
"""The wrenches lie in a hyperplane: no ball."""
OUTSIDE = 2
"""A plane separates the origin from all wrenches: no ball."""
SPENT = 3
"""The facets allowed are used up; the bounds found so far hold."""
FAILED = 4
"""Rounding made the polytope inconsistent."""


@njit(cache=True)
def expand_nearest(wrenches, centers, axes, tolerance, gap, max_facets):
    """Expand the facet nearest to the origin until it is a facet of the hull.

    Arguments: wrenches (m, 6), 7 <= m < 65536; round contacts centers (c, 6) and axes (c, 6, 3), beside the wrenches;
    tolerance, below which distances count as zero, and gap, the difference of the bounds at which to stop early (0
    for none), both as fractions of the largest wrench; max_facets, to stop at. Return (status, lower, upper, u,
    expansions, facets) with h(u) = upper, u (6,). For DONE and SPENT lower <= epsilon <= upper (where lower is
    positive), and for FAILED too, before the step that failed; for OUTSIDE upper < 0; for FLAT the bounds mean
    nothing.
    """
    m = len(wrenches)
    points = np.empty((m if len(centers) == 0 else m + max_facets // 16, 6))
    scale = 0.0
    for i in range(m):
        square = 0.0
        for j in range(6):
            points[i, j] = wrenches[i, j]
            square += wrenches[i, j] ** 2
        scale = max(scale, square)
    tolerance *= np.sqrt(scale)
    gap *= np.sqrt(scale)

    vertices = np.empty((max_facets, 6), np.int64)  # ascending
    neighbors = np.empty((max_facets, 6), np.int64)  # [f, k] lies across the ridge without vertices[f, k]
    planes = np.empty((max_facets, 7))  # n, d
    height = np.empty(max_facets)  # n.s - d
    mark = np.zeros(max_facets, np.int64)  # expansion that last looked at the facet; -1: removed
    keys = np.empty(max_facets)  # heap of d
    ids = np.empty(max_facets, np.int64)  # and of facets
    seen = np.empty(max_facets, np.int64)
    horizon = np.empty(6 * max_facets, np.int64)  # 8 * facet seen + slot of the ridge
    cells = 64
    while cells < max_facets:
        cells *= 2
    table = np.empty(cells, np.uint64)  # open ridges of new facets: four vertices
    owner = np.empty(cells, np.int64)  # 8 * facet + slot, or -1 if both facets are found
    stamp = np.zeros(cells, np.int64)

    u = np.zeros(6)
    s = np.empty(6)
    upper = np.inf
    step = 0
    if tolerance == 0.0 or not _first_simplex(points, m, tolerance, vertices, neighbors, planes):
        return FLAT, 0.0, 0.0, u, 0, 0
    n_facets = 7
    heap_size = 7
    for k in range(7):
        _push(keys, ids, k, planes[k, 6], k)

    while True:
        while mark[ids[0]] < 0:
            _pop(keys, ids, heap_size)
            heap_size -= 1
        nearest = ids[0]
        lower = planes[nearest, 6]
        added, h = _support(planes[nearest], points, m, centers, axes, s)
        if h < upper:
            upper = h
            for j in range(6):
                u[j] = planes[nearest, j]
        if h < -tolerance:
            return OUTSIDE, lower, upper, u, step, n_facets
        if h - lower <= tolerance or upper - lower <= gap:
            return DONE, lower, upper, u, step, n_facets
        if added == m:
            if m == len(points):
                return SPENT, lower, upper, u, step, n_facets
            for j in range(6):
                points[m, j] = s[j]
            m += 1

        step += 1
        height[nearest] = h - lower
        mark[nearest] = step
        seen[0] = nearest
        n_seen, n_horizon = _see(s, tolerance, vertices, neighbors, planes, height, mark, seen, horizon, step)
        if n_facets + n_horizon > max_facets or 8 * n_horizon >= cells:
            return SPENT, lower, upper, u, step - 1, n_facets
        if n_horizon < 6 or not _join(
            added, n_facets, n_horizon, vertices, neighbors, planes, height, mark, horizon, table, owner, stamp, step
        ):
            return FAILED, lower, upper, u, step, n_facets
        for i in range(n_seen):
            mark[seen[i]] = -1
        for new in range(n_facets, n_facets + n_horizon):
            _push(keys, ids, heap_size, planes[new, 6], new)
            heap_size += 1
        n_facets += n_horizon


@njit(cache=True)
def _support(u, points, m, centers, axes, s):
    """Write the farthest point in direction u to s; return its index (m if it is on a round contact) and h(u)."""
    best = -1
    h = -np.inf
    for i in range(m):
        value = 0.0
        for j in range(6):
            value += u[j] * points[i, j]
        if value > h:
            best, h = i, value
    contact = -1
    for i in range(len(centers)):
        value, square = 0.0, 0.0
        for k in range(3):
            component = 0.0
            for j in range(6):
                component += u[j] * axes[i, j, k]
            square += component * component
        for j in range(6):
            value += u[j] * centers[i, j]
        value += np.sqrt(square)
        if value > h:
            contact, h = i, value
    if contact < 0:
        for j in range(6):
            s[j] = points[best, j]
        return best, h
    square = 0.0
    for j in range(6):
        s[j] = 0.0
    for k in range(3):
        component = 0.0
        for j in range(6):
            component += u[j] * axes[contact, j, k]
        square += component * component
        for j in range(6):
            s[j] += component * axes[contact, j, k]
    for j in range(6):
        s[j] = centers[contact, j] + (s[j] / np.sqrt(square) if square > 0.0 else 0.0)
    return m, h


@njit(cache=True)
def _first_simplex(points, m, tolerance, vertices, neighbors, planes):
    """Span facets 0 to 6 by seven points, each the farthest from the affine hull of those before; False if flat."""
    chosen = np.empty(7, np.int64)
    rest = np.empty((m, 6))  # remainders perpendicular to the affine hull so far
    for k in range(7):
        best = -1
        far = 0.0 if k == 0 else tolerance**2
        for i in range(m):
            square = 0.0
            for j in range(6):
                if k == 0:
                    rest[i, j] = points[i, j]
                square += rest[i, j] ** 2
            if square > far:
                best, far = i, square
        if best < 0:
            return False
        position = k
        while position > 0 and chosen[position - 1] > best:
            chosen[position] = chosen[position - 1]
            position -= 1
        chosen[position] = best
        axis = rest[best].copy()
        for _ in range(1 if k == 0 else 2):  # twice keeps the remainders perpendicular to rounding
            for i in range(m):
                along = 0.0
                for j in range(6):
                    along += axis[j] * rest[i, j]
                factor = 1.0 if k == 0 else along / far
                for j in range(6):
                    rest[i, j] -= factor * axis[j]

    # rows of the inverse of [corner; 1] columns are the barycentric coordinates, each zero on one facet (Gauss-Jordan)
    system = np.zeros((7, 14))
    for k in range(7):
        for j in range(6):
            system[j, k] = points[chosen[k], j]
        system[6, k] = 1.0
        system[k, 7 + k] = 1.0
    for k in range(7):
        pivot = k
        for i in range(k + 1, 7):
            if abs(system[i, k]) > abs(system[pivot, k]):
                pivot = i
        if system[pivot, k] == 0.0:
            return False
        for j in range(14):
            system[k, j], system[pivot, j] = system[pivot, j], system[k, j]
        divisor = system[k, k]
        for j in range(14):
            system[k, j] /= divisor
        for i in range(7):
            factor = system[i, k]
            if i != k and factor != 0.0:
                for j in range(14):
                    system[i, j] -= factor * system[k, j]
    for k in range(7):
        square = 0.0
        for j in range(6):
            square += system[k, 7 + j] ** 2
        length = np.sqrt(square)
        for j in range(6):
            planes[k, j] = -system[k, 7 + j] / length
        planes[k, 6] = system[k, 13] / length
        for j in range(6):
            other = j if j < k else j + 1
            vertices[k, j] = chosen[other]
            neighbors[k, j] = other
    return True


@njit(cache=True)
def _see(s, tolerance, vertices, neighbors, planes, height, mark, seen, horizon, step):
    """Collect the facets that s sees, which are connected to seen[0], and their horizon; return how many of each."""
    n_seen, n_horizon, head = 1, 0, 0
    while head < n_seen:
        facet = seen[head]
        head += 1
        for k in range(6):
            other = neighbors[facet, k]
            if mark[other] != step:
                value = -planes[other, 6]
                for j in range(6):
                    value += planes[other, j] * s[j]
                height[other] = value
                mark[other] = step
                if value > tolerance:
                    seen[n_seen] = other
                    n_seen += 1
            if height[other] <= tolerance:
                horizon[n_horizon] = 8 * facet + k
                n_horizon += 1
    return n_seen, n_horizon


@njit(cache=True)
def _join(added, first, n_horizon, vertices, neighbors, planes, height, mark, horizon, table, owner, stamp, step):
    """Join point `added` to each horizon ridge in facets first, first + 1, ...; return False if they do not close."""
    mask = 63
    while mask < 8 * n_horizon:
        mask = 2 * mask + 1
    open_ridges = 0
    for i in range(n_horizon):
        new = first + i
        visible, slot = horizon[i] >> 3, horizon[i] & 7
        hidden = neighbors[visible, slot]
        over, under = height[visible], max(0.0, -height[hidden])
        square = 0.0
        for j in range(7):
            planes[new, j] = over * planes[hidden, j] + under * planes[visible, j]
            if j < 6:
                square += planes[new, j] ** 2
        length = np.sqrt(square)
        if not length > 0.0:
            return False
        for j in range(7):
            planes[new, j] /= length

        place = 0  # where `added` stands among the vertices of the ridge
        for k in range(6):
            if k != slot:
                vertex = vertices[visible, k]
                if vertex == added:
                    return False
                if vertex < added:
                    vertices[new, place] = vertex
                    place += 1
                else:
                    vertices[new, k if k > slot else k + 1] = vertex
        vertices[new, place] = added
        mark[new] = 0
        neighbors[new, place] = hidden
        for k in range(6):
            if neighbors[hidden, k] == visible:
                neighbors[hidden, k] = new
                break

        for k in range(6):  # the other five ridges contain s: each is shared by exactly two new facets
            if k == place:
                continue
            key = np.uint64(0)
            for j in range(6):
                if j != k and j != place:
                    key = (key << np.uint64(16)) | np.uint64(vertices[new, j])
            cell = np.int64((key * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(33)) & mask
            while stamp[cell] == step and table[cell] != key:
                cell = (cell + 1) & mask
            if stamp[cell] != step:
                stamp[cell] = step
                table[cell] = key
                owner[cell] = 8 * new + k
                open_ridges += 1
            else:
                partner = owner[cell]
                if partner < 0:
                    return False
                owner[cell] = -1
                neighbors[new, k] = partner >> 3
                neighbors[partner >> 3, partner & 7] = new
                open_ridges -= 1
    return open_ridges == 0


@njit(cache=True)
def _push(keys, ids, size, key, item):
    """Push onto a binary heap ordered by (key, item)."""
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
    """Remove the top of a binary heap."""
    last = size - 1
    key, item = keys[last], ids[last]
    k = 0
    while True:
        child = 2 * k + 1
        if child >= last:
            break
        if child + 1 < last and (
            keys[child + 1] < keys[child] or (keys[child + 1] == keys[child] and ids[child + 1] < ids[child])
        ):
            child += 1
        if key < keys[child] or (key == keys[child] and item < ids[child]):
            break
        keys[k], ids[k] = keys[child], ids[child]
        k = child
    keys[k], ids[k] = key, item

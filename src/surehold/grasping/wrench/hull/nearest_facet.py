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

Round contacts have no facets: the bounds close in, ever more slowly. Once they are near each other, the contacts that
the nearest facet touches are those that are active at a minimum of h, which Newton's method then finds to rounding.
Where contacts are symmetric, or almost, minima form a continuum or have kinks, and the facets do not suffice for that;
the lowest place that Newton's method passes from hundreds of them is taken for the minimum then.

s sees a facet if it lies above it by more than a tolerance. Not to see coplanar facets is the placing triangulation,
which is consistent however degenerate the wrenches are.
"""

import numpy as np

from surehold.grasping.wrench.hull.facet_heap import pop, push
from surehold.grasping.wrench.hull.first_simplex import first_simplex
from surehold.grasping.wrench.hull.least_resistance import descended, minimum_near
from surehold.grasping.wrench.hull.support import support
from surehold.grasping.wrench.hull.workspace import next_step
from surehold.store.kernels import njit

__all__ = ["DONE", "FAILED", "FLAT", "OUTSIDE", "SPENT", "expand_nearest"]

DONE = 0
"""The nearest facet is a facet of the hull, the gap asked for is reached, or the bounds are near and h minimal."""
FLAT = 1
"""The wrenches lie in a hyperplane: no ball."""
OUTSIDE = 2
"""A plane separates the origin from all wrenches: no ball."""
SPENT = 3
"""The facets allowed are used up; the bounds found so far hold."""
FAILED = 4
"""Rounding made the polytope inconsistent."""

_STARTS = 256  # of the nearest facets from which a minimum is sought where the facets did not suffice


@njit(cache=True)
def expand_nearest(wrenches, centers, axes, tolerance, gap, near, last, work):
    """Expand the facet nearest to the origin until it is a facet of the hull.

    Arguments: wrenches (m, 6), 7 <= m < 65536; round contacts centers (c, 6) and axes (c, 6, 3), in whose hull the
    wrenches are, which then only span the first simplex; tolerance, below which distances count as zero, gap, the
    difference of the bounds at which to stop early (0 for none), and near, that at which round contacts are looked at
    by Newton's method (0 for never), all as fractions of the largest wrench; last, whether a minimum is looked for
    however far apart the bounds are once the facets are used up or rounding spoils them; the workspace, with room for
    all facets that are made. Return (status, lower, upper, u, expansions, facets) with h(u) = upper, u (6,). For DONE
    and SPENT lower <= epsilon <= upper (where lower is positive), and for FAILED too, before the step that failed; for
    OUTSIDE upper < 0; for FLAT the bounds mean nothing.
    """
    m = len(wrenches)
    points = np.empty((m if len(centers) == 0 else m + len(work.vertices) // 16, 6))
    contacts = np.full(len(points), -1, np.int32)  # on which round contact a point is, -1 where it is not known
    scale = 0.0
    for i in range(m):
        square = 0.0
        for j in range(6):
            points[i, j] = wrenches[i, j]
            square += wrenches[i, j] ** 2
        scale = max(scale, square)
    scale = np.sqrt(scale)
    tolerance, gap, near = tolerance * scale, gap * scale, near * scale

    vertices, neighbors, planes, mark = work.vertices, work.neighbors, work.planes, work.mark
    max_facets = len(vertices)
    u, s, best = np.zeros(6), np.empty(6), np.zeros(6)
    upper, failed = np.inf, False
    expansions = 0
    if tolerance == 0.0 or not first_simplex(points, m, tolerance, vertices, neighbors, planes):
        return FLAT, 0.0, 0.0, best, 0, 0
    n_facets = 7
    heap_size = 7
    for k in range(7):
        mark[k] = 0
        push(work.keys, work.ids, k, planes[k, 6], k)

    while True:
        while mark[work.ids[0]] < 0:
            pop(work.keys, work.ids, heap_size)
            heap_size -= 1
        nearest = work.ids[0]
        lower = planes[nearest, 6]
        added, contact, h = support(planes[nearest], points, m, centers, axes, s)
        if h < upper:
            upper = h
            for j in range(6):
                best[j] = planes[nearest, j]
        if h < -tolerance:
            return OUTSIDE, lower, upper, best, expansions, n_facets
        if h - lower <= tolerance or upper - lower <= gap:
            return DONE, lower, upper, best, expansions, n_facets
        if len(centers) and upper - lower <= near and lower > 0.0:
            near *= 0.1
            for j in range(6):
                u[j] = planes[nearest, j]
            found = minimum_near(u, h, vertices[nearest], planes[nearest], points, contacts, centers, axes)
            if found <= upper + tolerance:
                return DONE, lower, max(found, lower), u, expansions, n_facets
        if added == m:
            if m == len(points):
                break
            for j in range(6):
                points[m, j] = s[j]
            contacts[m] = contact
            m += 1

        step = next_step(work)
        work.height[nearest] = h - lower
        mark[nearest] = step
        work.seen[0] = nearest
        n_seen, n_horizon = _see(s, tolerance, work, step)
        if n_facets + n_horizon > max_facets or 8 * n_horizon >= len(work.table):
            break
        expansions += 1
        if n_horizon < 6 or not _join(added, n_facets, n_horizon, work, step):
            failed = True
            break
        for i in range(n_seen):
            mark[work.seen[i]] = -1
        for new in range(n_facets, n_facets + n_horizon):
            push(work.keys, work.ids, heap_size, planes[new, 6], new)
            heap_size += 1
        n_facets += n_horizon

    if last and lower > 0.0:
        tried = 0
        for k in range(heap_size):  # the first ones of a heap are near, too
            facet = work.ids[k]
            if mark[facet] < 0:
                continue
            tried += 1
            if tried > _STARTS:
                break
            for j in range(6):
                u[j] = planes[facet, j]
            corners = vertices[facet]
            found = descended(u, upper, scale, corners, planes[facet], points, contacts, centers, axes)
            if found < upper:
                upper = found
                for j in range(6):
                    best[j] = u[j]
        return DONE, lower, max(upper, lower), best, expansions, n_facets
    return FAILED if failed else SPENT, lower, upper, best, expansions, n_facets


@njit(cache=True)
def _see(s, tolerance, work, step):
    """Collect the facets that s sees, which are connected to seen[0], and their horizon; return how many of each."""
    neighbors, planes, height, mark = work.neighbors, work.planes, work.height, work.mark
    seen, horizon = work.seen, work.horizon
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
def _join(added, first, n_horizon, work, step):
    """Join point `added` to each horizon ridge in facets first, first + 1, ...; return False if they do not close."""
    vertices, neighbors, planes, height, horizon = work.vertices, work.neighbors, work.planes, work.height, work.horizon
    table, owner, stamp = work.table, work.owner, work.stamp
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
        scale = 1.0 / length
        for j in range(7):
            planes[new, j] *= scale

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
        work.mark[new] = 0
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

"""From a facet of the inner polytope to a minimum of h nearby, of round contacts (compiled).

Notation: see nearest_facet.py.
"""

import numpy as np

from surehold.grasping.wrench.hull.support import support
from surehold.grasping.wrench.hull.weakest_direction import solve, weakest_direction
from surehold.store.kernels import njit

__all__ = ["descended", "minimum_near"]

_WIDEST, _NARROWEST = 1e-2, 1e-8  # by how much contacts are rounder on the way, as fractions of the largest wrench


@njit(cache=True)
def minimum_near(u, h, corners, plane, points, contacts, centers, axes):
    """Return the minimum of h near u (6,), which is moved there, or infinity if none is found."""
    active, shares = np.empty(6, np.int64), np.zeros(6)
    n, all_known = _active(corners, plane, points, contacts, active, shares)
    if n == 0 or not all_known or not weakest_direction(centers, axes, active, shares, n, u, h, 0.0):
        return np.inf
    return support(u, points, 0, centers, axes, np.empty(6))[2]


@njit(cache=True)
def descended(u, least, scale, corners, plane, points, contacts, centers, axes):
    """Return the lowest h on the way from u (6,) to a minimum, and move u there; infinity if none is below `least`.

    The minimum is followed from rounder contacts to those that are: where a contact touches with a whole disk h has a
    kink, into which Newton's method does not find.
    """
    active, shares, s = np.empty(6, np.int64), np.zeros(6), np.empty(6)
    n, _ = _active(corners, plane, points, contacts, active, shares)
    if n == 0:
        return np.inf
    best, lowest, width = u.copy(), np.inf, _WIDEST
    h = support(u, points, 0, centers, axes, s)[2]
    while width > _NARROWEST:
        weakest_direction(centers, axes, active, shares, n, u, h, width * scale)
        length = 0.0
        for j in range(6):
            length += u[j] * u[j]
        if not length > 0.0:
            break
        for j in range(6):
            u[j] /= np.sqrt(length)
        h = support(u, points, 0, centers, axes, s)[2]
        if h < min(least, lowest):
            lowest = h
            best[:] = u
        width *= 0.5
    u[:] = best
    return lowest


@njit(cache=True)
def _active(corners, plane, points, contacts, active, shares):
    """Find the round contacts of a facet's corners; return how many, and whether that of each corner is known.

    `active` (6,) gets their numbers and `shares` (6,) the barycentric weights of the facet's point nearest to the
    origin. There are none if the facet is too flat for them.
    """
    system, weights = np.empty((6, 6)), np.empty(6)
    for j in range(6):
        weights[j] = plane[6] * plane[j]
        for k in range(6):
            system[j, k] = points[corners[k], j]
    if not solve(system, weights, 6):
        return 0, False
    n, all_known = 0, True
    for k in range(6):
        contact = contacts[corners[k]]
        if contact < 0:
            all_known = False
            continue
        i = 0
        while i < n and active[i] != contact:
            i += 1
        if i == n:
            active[n] = contact
            n += 1
        shares[i] += weights[k]
    return n, all_known

"""Support function of the hull of wrenches, or of round contacts, and the points that reach it (compiled).

Notation: see nearest_facet.py.
"""

import numpy as np

from surehold.store.kernels import njit

__all__ = ["rim_points", "support", "support_of_contact"]


@njit(cache=True)
def support(u, points, m, centers, axes, s):
    """Write the point that is farthest in direction u to s; return its index, its contact and h(u).

    Without round contacts it is one of the first m points, and the contact -1; with them it is on a contact, and the
    index m: the points are inside the contacts' hull and are not looked at.
    """
    best = -1
    h = -np.inf
    if len(centers) == 0:
        for i in range(m):
            value = 0.0
            for j in range(6):
                value += u[j] * points[i, j]
            if value > h:
                best, h = i, value
        for j in range(6):
            s[j] = points[best, j]
        return best, -1, h
    for i in range(len(centers)):
        value = support_of_contact(u, centers, axes, i)
        if value > h:
            best, h = i, value
    square = 0.0
    for j in range(6):
        s[j] = 0.0
    for k in range(3):
        component = 0.0
        for j in range(6):
            component += u[j] * axes[best, j, k]
        square += component * component
        for j in range(6):
            s[j] += component * axes[best, j, k]
    for j in range(6):
        s[j] = centers[best, j] + (s[j] / np.sqrt(square) if square > 0.0 else 0.0)
    return m, best, h


@njit(cache=True)
def support_of_contact(u, centers, axes, i):
    """Return u.a + |B' u| of round contact i."""
    value, square = 0.0, 0.0
    for k in range(3):
        component = 0.0
        for j in range(6):
            component += u[j] * axes[i, j, k]
        square += component * component
    for j in range(6):
        value += u[j] * centers[i, j]
    return value + np.sqrt(square)


@njit(cache=True)
def rim_points(centers, axes, stride):
    """Return the points a + B z of every stride-th round contact for z = plus and minus each unit vector, (m, 6)."""
    points = np.empty((6 * len(centers), 6))
    m = 0
    for i in range(0, len(centers), stride):
        for k in range(3):
            square = 0.0
            for j in range(6):
                square += axes[i, j, k] ** 2
            if k > 0 and square == 0.0:  # hard contacts have no third axis
                continue
            for j in range(6):
                points[m, j] = centers[i, j] + axes[i, j, k]
                points[m + 1, j] = centers[i, j] - axes[i, j, k]
            m += 2
    return points[:m]

"""The direction in which round contacts resist least, to rounding: Newton's method from a good guess (compiled).

Notation
--------
a_i, B_i   round contact: all a_i + B_i z with |z| <= 1, (6,) and (6, 3)
h_i(u)     its support function u.a_i + |B_i' u|; gradient s_i(u) = a_i + B_i B_i' u / |B_i' u|, a point of the contact
h(u)       the largest h_i(u): support function of the hull of all contacts
e          local minimum of h over unit vectors u, reached by the active contacts i with weights l_i

At a minimum the nearest point of the hull's surface is a mean of points of the active contacts,

    sum_i l_i s_i(u) = e u,   h_i(u) = e,   |u| = 1,   all l_i >= 0,

and then sum_i l_i = 1, as u.s_i = h_i: as many equations as unknowns u, e, l_i. A contact whose weight turns out
negative is left out, one whose h_i is above e is taken in, and Newton's method starts again.

Symmetric contacts have continua of minima, and of weights, in which the equations F are singular. Damped steps, those
of Levenberg and Marquardt with |F| as the damping, get there as fast (Yamashita and Fukushima 2001). And h may be least
where B_i'u = 0, a kink of h_i. To each contact a ball of radius `width` is added, h_i = a_i.u + sqrt(|B_i'u|^2 +
width^2 |u|^2), which has none and is higher by no more than the width.
"""

import numpy as np

from surehold.grasping.wrench.hull.support import support_of_contact
from surehold.store.kernels import njit

__all__ = ["solve", "weakest_direction"]

_MOST_ACTIVE = 6
_ROUNDS = 8  # of changes of the active contacts
_STEPS = 12  # of Newton's method in each
_DAMPED_STEPS = 20  # with rounder contacts
_SMALL = 1e-12  # step of a direction at which it has converged


@njit(cache=True)
def weakest_direction(centers, axes, active, weights, n_active, u, e, width):
    """Return whether Newton's method converged to a minimum near u (6,), which is overwritten with where it is.

    `active` (6,) holds the numbers of the first n_active contacts believed to be active and `weights` (6,) their
    weights; both are overwritten. e is a guess of the minimum. Where minima may form a continuum or have kinks,
    contacts are taken to be rounder by a `width` above 0, and steps are damped.
    """
    n = 13
    system, right = np.empty((n, n + 1)), np.empty(n)
    for _ in range(_ROUNDS):
        if not _newton(centers, axes, active, weights, n_active, u, e, system, right, width):
            return False
        least = 0
        for i in range(1, n_active):
            if weights[i] < weights[least]:
                least = i
        if weights[least] < 0.0:
            if n_active == 1:
                return False
            n_active -= 1
            active[least], weights[least] = active[n_active], weights[n_active]
            continue
        e = support_of_contact(u, centers, axes, active[0])
        highest, other = e, -1
        for i in range(len(centers)):
            h = support_of_contact(u, centers, axes, i)
            if h > highest:
                highest, other = h, i
        if other < 0 or highest - e <= _SMALL + 2.0 * width:
            return True
        for i in range(n_active):
            if active[i] == other:
                return False  # rounding
        if n_active == _MOST_ACTIVE:
            return False
        active[n_active], weights[n_active] = other, 0.0
        n_active += 1
    return False


@njit(cache=True)
def _newton(centers, axes, active, weights, n_active, u, e, system, right, width):
    """Solve the equations for a fixed set of active contacts, u and weights in place; False if they do not converge."""
    size = 7 + n_active
    z = np.empty(3)
    for _ in range(_DAMPED_STEPS if width > 0.0 else _STEPS):
        for i in range(size):
            right[i] = 0.0
            for j in range(size):
                system[i, j] = 0.0
        square = 0.0
        for j in range(6):
            system[j, j] = -e
            right[j] = e * u[j]
            system[j, 6] = system[6, j] = -u[j]
            square += u[j] * u[j]
        right[6] = 0.5 * (square - 1.0)
        for i in range(n_active):
            a, weight, row = active[i], weights[i], 7 + i
            length, height = 0.0, 0.0
            for k in range(3):
                z[k] = 0.0
                for j in range(6):
                    z[k] += u[j] * axes[a, j, k]
                length += z[k] * z[k]
            length = np.sqrt(length + square * width * width)
            if not length > 0.0:
                return False
            for k in range(3):
                z[k] /= length
            for j in range(6):
                point = centers[a, j] + width * width / length * u[j]
                for k in range(3):
                    point += axes[a, j, k] * z[k]
                system[j, row] = system[row, j] = point
                right[j] -= weight * point
                height += u[j] * point
            system[row, 6] = -1.0
            right[row] = e - height
            for p in range(6):
                along = system[p, row] - centers[a, p]
                for q in range(6):
                    total = width * width if p == q else 0.0
                    for k in range(3):
                        total += axes[a, p, k] * axes[a, q, k]
                    system[p, q] += weight * (total - along * (system[q, row] - centers[a, q])) / length
        if width > 0.0:
            residual = 0.0
            for i in range(size):
                residual += right[i] * right[i]
            if residual < (1e-2 * width) ** 2:
                for j in range(6):
                    u[j] /= np.sqrt(square)
                return True
            system, right = _damped(system, right, size)
        if not solve(system, right, size):
            return False
        step = 0.0
        for j in range(6):
            u[j] += right[j]
            step += right[j] * right[j]
        e += right[6]
        for i in range(n_active):
            weights[i] += right[7 + i]
        if not np.isfinite(step) or step > 4.0:
            return False
        if step < _SMALL * _SMALL:
            length = 0.0
            for j in range(6):
                length += u[j] * u[j]
            for j in range(6):
                u[j] /= np.sqrt(length)
            return True
    return False


@njit(cache=True)
def _damped(system, right, size):
    """Return system and right side whose solution is the damped step: (S' S + |r| 1) x = S' r."""
    squared, projected, length = np.zeros(system.shape), np.zeros(len(right)), 0.0
    for i in range(size):
        length += right[i] * right[i]
        for k in range(size):
            projected[i] += system[k, i] * right[k]
            for j in range(size):
                squared[i, j] += system[k, i] * system[k, j]
    for i in range(size):
        squared[i, i] += np.sqrt(length) + 1e-15
    return squared, projected


@njit(cache=True)
def solve(system, right, size):
    """Solve a linear system in place (Gauss with partial pivoting); False if it is singular."""
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(system[i, k]) > abs(system[pivot, k]):
                pivot = i
        if not abs(system[pivot, k]) > 1e-300:
            return False
        if pivot != k:
            for j in range(k, size):
                system[k, j], system[pivot, j] = system[pivot, j], system[k, j]
            right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, size):
            factor = system[i, k] / system[k, k]
            if factor != 0.0:
                for j in range(k + 1, size):
                    system[i, j] -= factor * system[k, j]
                right[i] -= factor * right[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            right[k] -= system[k, j] * right[j]
        right[k] /= system[k, k]
    return True

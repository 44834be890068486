"""The simplex of seven wrenches far apart with which an inscribed polytope begins (compiled).

Notation: see nearest_facet.py; facet k of the simplex is the one without corner k.
"""

import numpy as np

from surehold.store.kernels import njit

__all__ = ["first_simplex"]


@njit(cache=True)
def first_simplex(points, m, tolerance, vertices, neighbors, planes):
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

"""Expansions with the memory and the tolerance they need, for wrenches and for round contacts (compiled).

Should rounding spoil an expansion, as wrenches apart by about the tolerance can, it is repeated with a coarser one.
"""

import numpy as np

from surehold.grasping.wrench.hull.nearest_facet import DONE, FAILED, FLAT, OUTSIDE, SPENT, expand_nearest
from surehold.grasping.wrench.hull.support import rim_points
from surehold.grasping.wrench.hull.workspace import workspace
from surehold.store.kernels import njit

__all__ = ["FACETS", "ROUND_GAP", "ROUND_NEAR", "TOLERANCES", "expand", "largest"]

TOLERANCES = (1e-11, 1e-9)
"""Tried in turn: distances below this fraction of the largest wrench count as zero."""
ROUND_TOLERANCES = (1e-11, 1e-9, 1e-7)
"""The same for round contacts, which Qhull cannot take."""
FACETS = 16_384
"""Facets of the first try; grasps need hundreds to thousands."""
MORE_FACETS = (65_536, 1_048_576)
"""Facets of the next tries; round contacts, which are bounded all the same, end with the first of them."""
ROUND_NEAR = 1e-4
"""Difference of the bounds at which the minimum is looked for, as a fraction of the largest wrench."""
ROUND_GAP = 1e-9
"""Difference of the bounds at which round contacts count as measured without that, as a fraction of the largest wrench.

Symmetric contacts around an axis, whose weakest directions form a continuum, and almost symmetric ones end at about
1e-3, soft fingers at up to 4e-2; the minimum is looked for then, too.
"""
_CORNERS = 16  # round contacts of whose rims the first simplex is made, if they span one


@njit(cache=True)
def expand(wrenches, centers, axes, work):
    """Measure the ball in the hull of wrenches (m, 6), or of round contacts (c, 6), (c, 6, 3) if there are any.

    Arguments as of `expand_nearest`; the wrenches are not looked at where there are round contacts; the workspace has
    `FACETS`. Return (status, epsilon, lower, upper, u, expansions, facets, fallbacks). The status is DONE if there is a
    ball, FLAT or OUTSIDE if not, FAILED if rounding spoiled all tries. epsilon is the upper bound, the
    least h found; the lower one where rounding spoiled all tries and the last met no ball.
    """
    rounded = len(centers) > 0
    stride = max(1, len(centers) // _CORNERS)
    corners = rim_points(centers, axes, stride) if rounded else wrenches
    flat = np.zeros(6)
    if len(corners) < 7 and stride == 1:
        return FLAT, 0.0, 0.0, 0.0, flat, 0, 0, 0
    gap, near = (ROUND_GAP, ROUND_NEAR) if rounded else (0.0, 0.0)
    tries = len(ROUND_TOLERANCES) if rounded else len(TOLERANCES)
    best = FAILED, 0.0, 0.0, 0.0, flat, 0, 0, tries
    for fallbacks in range(tries):
        tolerance = ROUND_TOLERANCES[fallbacks] if rounded else TOLERANCES[fallbacks]
        last = rounded and fallbacks == tries - 1
        result = expand_nearest(corners, centers, axes, tolerance, gap, near, last, work)
        if result[0] == FLAT and stride > 1:
            stride = 1
            corners = rim_points(centers, axes, stride)
            result = expand_nearest(corners, centers, axes, tolerance, gap, near, last, work)
        for more in range(1 if rounded else 2):
            if result[0] == SPENT:
                room = workspace(MORE_FACETS[more])
                result = expand_nearest(corners, centers, axes, tolerance, gap, near, rounded, room)
        status, lower, upper, u, expansions, facets = result
        epsilon = upper
        zero = tolerance * largest(corners)
        if (status == SPENT and rounded) or (status == DONE and lower <= zero):
            status = OUTSIDE
        if status != FAILED and status != SPENT:
            return status, epsilon, lower, upper, u, expansions, facets, fallbacks
        if rounded and lower > max(best[2], zero):
            best = DONE, lower, lower, upper, u, expansions, facets, tries
    return best


@njit(cache=True)
def largest(wrenches):
    """Return the norm of the largest wrench."""
    most = 0.0
    for i in range(len(wrenches)):
        square = 0.0
        for j in range(6):
            square += wrenches[i, j] ** 2
        most = max(most, square)
    return np.sqrt(most)

"""Many trials in one compiled loop that lets other threads run: closing, contacts and epsilon of round cones."""

from typing import Final

import numpy as np

from surehold.grasping.closing.attempt import attempt, times
from surehold.grasping.grasp import STATUSES
from surehold.grasping.wrench.ellipsoids import ellipsoids, tangent_field
from surehold.grasping.wrench.hull.expansion import FACETS, expand
from surehold.grasping.wrench.hull.nearest_facet import DONE, FAILED
from surehold.grasping.wrench.hull.workspace import workspace
from surehold.store.kernels import njit

__all__ = ["UNDECIDED", "run_trials"]

UNDECIDED: Final = -1
"""Status of a trial whose measure rounding has spoiled: it is tried again by itself, where the full hull decides."""
_OK, _NO_CONTACT, _COLLISION, _NOT_CLOSED = range(len(STATUSES))


@njit(cache=True, nogil=True)
def run_trials(nodes, frame, hand, to_object, poses, starts, model, adaptive, depth, cones, out):
    """Try poses (n, 3, 4) of the palm in the world with starts (n, f, j) of the motion.

    Write to out (n, 6): epsilon (of a collision 0), status, depth of the deepest body inside the object [m], depths of
    all together [m], number of contacts, fallbacks. `cones` are `RoundCones`; other arguments
    as of `attempt`.
    """
    work = workspace(FACETS)
    for k in range(len(poses)):
        tried = attempt(nodes, frame, hand, times(to_object, poses[k]), starts[k], model, adaptive, depth)
        row = out[k]
        row[:] = 0.0
        row[2], row[3] = tried.deepest, tried.deep
        if tried.deepest > 0.0:
            row[1] = _COLLISION
            continue
        rows = tried.rows[tried.rows[:, 6] > 0.0]
        row[4] = len(rows)
        if len(rows) < 2:
            row[1] = _NO_CONTACT
            continue
        normals, arms = rows[:, 3:6].copy(), (rows[:, :3] - cones.origin) / cones.torque_length
        friction, torsion = np.full(len(rows), cones.friction), np.full(len(rows), cones.torsion)
        centers, axes = ellipsoids(normals, tangent_field(normals), arms, friction, torsion, rows[:, 6] / cones.divisor)
        status, epsilon, _, _, _, _, _, fallbacks = expand(np.empty((0, 6)), centers, axes, work)
        row[1] = UNDECIDED if status == FAILED else _OK if status == DONE else _NOT_CLOSED
        row[0], row[5] = epsilon if status == DONE else 0.0, fallbacks

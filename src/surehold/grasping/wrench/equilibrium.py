"""How well contacts balance themselves and a load: the min-weight quality and the residual of a quadratic program.

Notation
--------
w, W   wrenches of the cone edges, W (m, 6), contact by contact
a      weights of the edges in a convex combination, (m,)
x      pressures along the edges, x >= 0, (m,); a contact's pressure p_i is the sum over its edges
t      external wrench, (6,)
l*     min-weight quality: m max l  such that  W' a = 0, sum a = 1, a >= l              0 to 1
r(t)   residual: min |W' x + t|  such that  x >= 0, p_i <= 1, sum of the p_i >= 1

l* is above 0 exactly in force closure, for wrenches of rank six (Li, Culbertson, Burdick and Ames 2023, FRoGGeR);
where it is large, all contacts share the squeeze and none is needed entirely. It bounds epsilon from below up to a
factor (Li, Culbertson and Ames 2024). r is what the contacts cannot take over of a load, after the measure that
DexGraspBench reports (Chen, Ke and Wang 2024).
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.grasping.wrench.friction_cones import finite_array

__all__ = ["LOADS", "LOAD_SHARE", "balance_quality", "load_residual", "min_weight"]

Array = NDArray[np.float64]

LOAD_SHARE: Final = 0.1  #: force of a load, where the pressure of one contact is 1 at most
#: Pushes along the six directions of the axes, (6, 6): force, no torque about the center of mass.
LOADS: Final = np.hstack((LOAD_SHARE * np.vstack((np.eye(3), -np.eye(3))), np.zeros((6, 3))))

_EXACT: Final = 1e4  # weight of equalities in a least-squares problem: they hold to about 1e-8


def min_weight(wrenches: ArrayLike) -> float:
    """Return l* of wrenches (m, 6) by a linear program (HiGHS); 0 without force closure, 1 where all weigh the same.

    Raises InputError if the wrenches are not finite or not of shape (m, 6).
    """
    from scipy.optimize import linprog

    w = finite_array("wrenches", wrenches, (None, 6))
    m = len(w)
    if m < 7 or np.linalg.matrix_rank(w, tol=1e-9 * np.abs(w).max()) < 6:
        return 0.0
    # a = b + l with b >= 0:  W' b + l W' 1 = 0,  sum b + m l = 1;  variables b (m), l
    total = np.vstack((np.column_stack((w.T, w.sum(axis=0))), np.append(np.ones(m), float(m))))
    found = linprog(
        np.append(np.zeros(m), -1.0), A_eq=total, b_eq=np.append(np.zeros(6), 1.0), bounds=(0.0, None), method="highs"
    )
    return min(max(0.0, m * float(found.x[-1])), 1.0) if found.x is not None else 0.0


def load_residual(wrenches: ArrayLike, per_contact: int, load: ArrayLike) -> float:
    """Return r(t) of wrenches (m, 6), `per_contact` edges each contact, under a load t (6,), in units of force.

    Raises InputError if an array is not finite or of another shape, or contacts do not have equally many edges.
    """
    from scipy.optimize import nnls

    w, t = finite_array("wrenches", wrenches, (None, 6)), finite_array("load", load, (6,))
    if per_contact < 1 or len(w) % per_contact:
        raise InputError(f"{len(w)} wrenches cannot belong to contacts of {per_contact!r} edges each.")
    m, contacts = len(w), len(w) // max(per_contact, 1)
    if not contacts:
        return float(np.linalg.norm(t))
    # A slack s >= 0 turns sum x >= 1 into sum x - s = 1: nonnegative least squares with a heavy row.
    rows = np.zeros((7, m + 1))
    rows[:6, :m], rows[6, :m], rows[6, m] = w.T, _EXACT, -_EXACT
    x, _ = nnls(rows, np.append(-t, _EXACT), maxiter=30 * (m + 1))
    x = x[:m]
    if x.reshape(contacts, per_contact).sum(axis=1).max() > 1.0 + 1e-9:  # and p_i + u_i = 1 where that is needed
        full = np.zeros((7 + contacts, m + 1 + contacts))
        full[:7, : m + 1] = rows
        full[7:, :m] = _EXACT * np.kron(np.eye(contacts), np.ones(per_contact))
        full[7:, m + 1 :] = _EXACT * np.eye(contacts)
        x, _ = nnls(full, np.concatenate((-t, np.full(1 + contacts, _EXACT))), maxiter=30 * full.shape[1])
        x = x[:m]
    return float(np.linalg.norm(w.T @ x + t))


def balance_quality(wrenches: ArrayLike, per_contact: int, loads: ArrayLike = LOADS) -> float:
    """Return 1 - mean residual over the loads (k, 6) by their mean length, at least 0: 1 where each is taken over.

    Raises InputError as `load_residual`, and without a load that is not zero.
    """
    every = finite_array("loads", loads, (None, 6))
    size = np.linalg.norm(every, axis=1).mean() if len(every) else 0.0
    if size == 0.0:
        raise InputError("loads must hold at least one wrench that is not zero, shape (k, 6).")
    residual = np.mean([load_residual(wrenches, per_contact, load) for load in every])
    return max(1.0 - float(residual) / float(size), 0.0)

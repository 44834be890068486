"""Force closure and resistance to given wrenches by linear programs, independent of the convex hull.

Notation
--------
W   wrenches of the cone edges, (m, 6)
x   nonnegative combination of the wrenches, (m,)
t   external wrench on the object, weighted, (6,)
"""

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.grasping.wrench.friction_cones import finite_array

__all__ = ["force_closure", "gravity_wrenches", "task_quality"]


def force_closure(wrenches: ArrayLike) -> bool:
    """Return whether nonnegative combinations of wrenches (m, 6) reach every wrench.

    They do if and only if the wrenches have rank six and some x > 0 has W' x = 0 (all entries positive). As x may be
    scaled, x >= 1 can be asked for: a linear program (HiGHS) that is feasible or not. A solution is known to a
    tolerance only, and is then made exact: the smallest correction y with W' (x + y) = 0 must leave all of x + y
    positive, which proves closure. The answer is no if the program is infeasible or the proof fails.

    Raises InputError if the wrenches are not finite or not of shape (m, 6).
    """
    from scipy.optimize import linprog

    w = finite_array("wrenches", wrenches, (None, 6))
    largest = np.sqrt(np.max(np.sum(w * w, axis=1))) if len(w) else 0.0
    if len(w) < 7 or largest == 0.0:
        return False
    w = w / largest
    spread = np.linalg.svd(w, compute_uv=False)
    if spread[-1] <= 1e-11 * spread[0]:
        return False
    tight = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = linprog(np.ones(len(w)), A_eq=w.T, b_eq=np.zeros(6), bounds=(1.0, None), method="highs", options=tight)
    if found.x is None:
        return False
    correction = np.linalg.lstsq(w.T, -(w.T @ found.x), rcond=None)[0]
    return bool(np.all(found.x + correction > 0.0))


def task_quality(wrenches: ArrayLike, task: ArrayLike) -> float:
    """Return the largest scale at which the grasp still balances every one of the external wrenches, >= 0.

    Parameters: wrenches (m, 6), the contacts' unit wrenches; task (k, 6), k >= 1 external wrenches in the same
    scaling (see `gravity_wrenches`), each as large as it weighs. Contact forces are limited in sum (L1): W' x =
    -scale t with x >= 0, sum of x <= 1, one linear program (HiGHS) for each t. For a grasp in force closure this is
    the distance from the origin to the hull's surface along -t, in units of t, the smallest over the task (Li and
    Sastry 1988). 0 means that some wrench cannot be balanced at all. A wrench of zero asks for nothing; infinity if
    all are.

    Raises InputError if an array is not finite or not of shape (m, 6).
    """
    from scipy.optimize import linprog

    w = finite_array("wrenches", wrenches, (None, 6))
    targets = finite_array("task", task, (None, 6))
    if not len(targets):
        raise InputError("task must hold at least one external wrench, shape (k, 6) with k >= 1.")
    scale = np.inf
    for t in targets:
        size = np.sqrt(t @ t)
        if size == 0.0:
            continue
        if not len(w):
            return 0.0
        # variables x (m), scale; maximize the scale
        for method in ("highs", "highs-ipm"):  # the second is the fallback; a failure is never scored as 0
            found = linprog(
                np.append(np.zeros(len(w)), -1.0),
                A_ub=np.append(np.ones(len(w)), 0.0)[None, :],
                b_ub=[1.0],
                A_eq=np.column_stack((w.T, t / size)),
                b_eq=np.zeros(6),
                bounds=(0.0, None),
                method=method,
            )
            if found.x is not None:
                break
        if found.x is None:
            raise ArithmeticError(f"the linear program of the task wrench {t} failed: {found.message}")
        scale = min(scale, max(0.0, float(found.x[-1])) / size)
    return scale


def gravity_wrenches(
    weight: float,
    center_of_mass: ArrayLike,
    directions: ArrayLike | None = None,
    torque_length: float = 1.0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
) -> NDArray[np.float64]:
    """Return the external wrenches of gravity, (k, 6), for `task_quality`.

    Parameters: weight, mass times 9.81 divided by the normal force that all contacts together may apply (then a
    quality of 1 means: just held); center_of_mass (3,) [m]; directions (k, 3) unit vectors in which gravity may
    point, default the six axis directions; torque_length [m] and origin [m] as given to `contact_wrenches`. Raises
    InputError for unusable values.
    """
    if not (isinstance(weight, Real) and np.isfinite(weight) and weight > 0.0):
        raise InputError(f"weight must be finite and above 0, not {weight!r}.")
    if not (isinstance(torque_length, Real) and np.isfinite(torque_length) and torque_length > 0.0):
        raise InputError(f"torque_length must be a finite length above 0 [m], not {torque_length!r}.")
    arm = (finite_array("center_of_mass", center_of_mass, (3,)) - finite_array("origin", origin, (3,))) / float(
        torque_length
    )
    axes = np.vstack((np.eye(3), -np.eye(3))) if directions is None else directions
    forces = float(weight) * finite_array("directions", axes, (None, 3))
    return np.hstack((forces, np.cross(arm, forces)))

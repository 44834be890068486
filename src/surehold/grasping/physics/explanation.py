"""Why a grasp is not held: too weak a squeeze for the weight, or the grasp itself."""

from typing import Final

import numpy as np

from surehold.grasping.grasp import Grasp
from surehold.grasping.physics.check import RATED, GraspCheck, GraspChecker

__all__ = ["explained", "motion_in_words", "needed_force"]

_STRONGER: Final = (2.0, 4.0, 8.0)  # times the force of the hand
_STRONGEST: Final = 1000.0  # N; no more is tried


def needed_force(checker: GraspChecker, grasp: Grasp) -> float | None:
    """Return the finger force [N] of those tried, 2, 4 and 8 times the checker's, from which a grasp is held, or None.

    A force that is k times as large is, but for the moving parts' inertia, a mass that is k times as small.
    """
    for times in _STRONGER:
        force = min(times * checker.finger_force, _STRONGEST)
        stronger = GraspChecker(checker.simulator, finger_force=force, mass=checker.mass, squeeze=checker.squeeze)
        if stronger.held([grasp])[0]:
            return force
    return None


def motion_in_words(moved: float, turned: float, limits: tuple[float, float], it: str = "") -> str:
    """Return how far an object moves [m], and how far it turns [rad] where that is nearer to its limit than the way."""
    turn = f" and turns{it} {np.degrees(turned):.1f} degrees" if turned / limits[1] > moved / limits[0] else ""
    return f"moves{it} {1e3 * moved:.1f} mm{turn}"


def explained(checker: GraspChecker, grasp: Grasp, check: GraspCheck) -> str:
    """Return in words why a check did not end with "held"; "" if it did."""
    if check.verdict == "held":
        return ""
    if grasp.status == "initial collision":
        return "the open hand is inside the object"
    if grasp.status == "no contact":
        return "the hand touches it in fewer than two points"
    if check.verdict == "moved":
        squeezed = motion_in_words(check.settled, check.settled_turn, RATED, " it")
        return f"the squeeze {squeezed} before it holds: it is not the grasp that was rated"
    weight = f"{checker.mass:.2g} kg"
    force = needed_force(checker, grasp)
    if force is not None:
        return f"{checker.finger_force:g} N a finger are too weak for {weight}: held with {force:g} N"
    most = min(_STRONGER[-1] * checker.finger_force, _STRONGEST)
    return f"not held with {most:g} N a finger either: it is the pose, not the weight of {weight}"

"""Why a grasp is not held: too weak a squeeze for the weight, or the grasp itself."""

from typing import Final

from surehold.grasping.grasp import Grasp
from surehold.grasping.physics.check import GraspCheck, GraspChecker

__all__ = ["explained", "needed_force"]

_STRONGER: Final = (2.0, 4.0, 8.0)  # times the force of the hand


def needed_force(checker: GraspChecker, grasp: Grasp) -> float | None:
    """Return the finger force [N] of those tried, 2, 4 and 8 times the checker's, from which a grasp is held, or None.

    A force that is k times as large is, but for the moving parts' inertia, a mass that is k times as small.
    """
    for times in _STRONGER:
        force = min(times * checker.finger_force, 1000.0)
        stronger = GraspChecker(checker.simulator, finger_force=force, mass=checker.mass, squeeze=checker.squeeze)
        if stronger.held([grasp])[0]:
            return force
    return None


def explained(checker: GraspChecker, grasp: Grasp, check: GraspCheck) -> str:
    """Return in words why a check did not end with "held"; "" if it did."""
    if check.verdict == "held":
        return ""
    if grasp.status == "initial collision":
        return "the open hand is inside the object"
    if grasp.status == "no contact":
        return "the hand touches it in fewer than two points"
    if check.verdict == "moved":
        return f"the squeeze moves it {1e3 * check.settled:.0f} mm before it holds: it is not the grasp that was rated"
    weight = f"{checker.mass:.2g} kg"
    force = needed_force(checker, grasp)
    if force is not None:
        return f"{checker.finger_force:g} N a finger are too weak for {weight}: held with {force:g} N"
    most = _STRONGER[-1] * checker.finger_force
    return f"not held with {most:g} N a finger either: it is the pose, not the weight of {weight}"

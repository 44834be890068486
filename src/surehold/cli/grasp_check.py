"""What physics says of the grasps that a run found: the verdict, and how often they are held when the hand is off."""

from typing import Any

import numpy as np

__all__ = ["checked", "checker_for", "friction_in_words", "squeeze_in_words", "verdict_in_words"]

_MOST = 10_000


def checker_for(problem: Any, check: int | None, outcome: str) -> Any:
    """Return a `GraspChecker` if one is asked for: by --check, or by --outcome held. Without MuJoCo it says so at once.

    Raises
    ------
    InputError
        If MuJoCo is not installed, or the number of checks is out of range.
    """
    from surehold.errors import InputError

    if check is not None and not 0 <= check <= _MOST:
        raise InputError(f"--check is {check}; give how many perturbed grasps to check, 0 to {_MOST:,}, such as 20.")
    if check is None and outcome != "held":
        return None
    from surehold.grasping.physics.check import GraspChecker

    return GraspChecker(problem.simulator)


def checked(checker: Any, problem: Any, candidate: Any, n: int, console: Any) -> dict[str, str]:
    """Return what physics says of a candidate as lines of the report, and print them with its label.

    The n perturbed grasps are the first of the candidate's re-queries: of the same executions the share that is held
    stands beside the share that is in force closure.
    """
    from surehold.grasping.physics.explanation import explained

    outcome = problem.grasp(candidate.x)
    check = checker.check(outcome)
    lines = {"physics": verdict_in_words(check)}
    reason = explained(checker, outcome, check)
    if reason:
        lines["why"] = reason
    points = candidate.points[:n]
    if len(points):
        grasps = [problem.grasp(x) for x in points]
        held, closed = int(np.sum(checker.held(grasps))), sum(grasp.status == "ok" for grasp in grasps)
        lines["held under noise"] = f"{held} of {len(points)}; in force closure {closed} of {len(points)}"
    lines["squeeze"] = squeeze_in_words(checker)
    for name, text in lines.items():
        console.print(f"{candidate.label}: {name}: {text}", markup=False, highlight=False, soft_wrap=True)
    return lines


def friction_in_words(simulator: Any) -> str:
    """Return the coefficient of friction, such as "0.5"; of the quality simox also its own, which never changes."""
    from surehold.grasping.wrench.simox import FRICTION

    plain = f"{simulator.friction:g}"
    other = simulator.quality == "simox" and simulator.friction != FRICTION
    return f"{FRICTION:g} in simox, {plain} in force closure" if other else plain


def squeeze_in_words(checker: Any) -> str:
    """Return the force with which a checker squeezes, where it comes from, and the mass that it shakes."""
    source = checker.simulator.hand.sources.get("finger_force", "")
    return f"{checker.finger_force:g} N a finger{f' ({source})' if source else ''}, {checker.mass:.2g} kg"


def verdict_in_words(check: Any) -> str:
    """Return verdict, motions and quality of a check: the load that is nearest to its limits, or farthest beyond.

    A turn is said where it is nearer to its limit than the way is.
    """
    from surehold.grasping.physics.check import HELD, RATED
    from surehold.grasping.physics.explanation import motion_in_words

    worst = max(check.loads, key=lambda load: max(load.moved / HELD[0], load.turned / HELD[1]))
    far = motion_in_words(worst.moved, worst.turned, HELD)
    moved = f"{far} under {worst.load}" if worst.moved < 1.0 else f"lost under {worst.load}"
    lost = [load.load for load in check.loads if load.verdict in ("slipped", "dropped")]
    if len(lost) == len(check.loads):
        moved = "lost under every load"
    if not np.isfinite(check.settled):
        return f"{check.verdict}, {moved}"
    squeezed = motion_in_words(check.settled, check.settled_turn, RATED, " it")
    return f"{check.verdict}, {moved}; the squeeze {squeezed}, quality then {check.settled_quality:.3f}"

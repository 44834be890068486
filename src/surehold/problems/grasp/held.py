"""Grasping as success or failure: whether the closed hand holds the object, by physics."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.grasping.grasp import Grasp
from surehold.grasping.physics.check import GraspChecker
from surehold.optimization.box import Box
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.problem import checked_points

__all__ = ["HeldGrasp"]


class HeldGrasp:
    """1 where the grasp of a problem is held, else 0: the verdict of `GraspChecker` instead of a quality.

    Meant for `Optimizer(..., outcome="success")`, which finds where a grasp is held most often under its input noise.

    Parameters
    ----------
    problem
        Where the hand is put.
    checker
        What squeezes, weighs and shakes; one with the hand's own force if not given.

    Raises
    ------
    InputError
        If MuJoCo is not installed, or the object's mesh is not watertight.
    """

    def __init__(self, problem: GraspProblem, checker: GraspChecker | None = None):
        self.problem: Final = problem
        self.checker: Final[GraspChecker] = GraspChecker(problem.simulator) if checker is None else checker
        self.name: Final[str] = f"{problem.name}, held"
        self.box: Final[Box] = problem.box

    def __call__(self, x: ArrayLike) -> float | NDArray[np.float64]:
        """Return 1.0 or 0.0 at x (d,), or an array (n,) of these at x (n, d)."""
        points, single = checked_points(x, self.box)
        values = self.checker.held([self.problem.grasp(point) for point in points]).astype(np.float64)
        return float(values[0]) if single else values

    def grasp(self, x: ArrayLike) -> Grasp:
        """Return the closed grasp at x (d,)."""
        return self.problem.grasp(x)

    def warm_up(self) -> None:
        """Compile what a trial needs, if it is not yet in the cache."""
        self.problem.warm_up()

"""How much of a grasp's worth is lost to the pose of the hand, and how much to the unknown shape.

    q(e, b)   quality with the hand off by e on the shape b; 0 no error, m the mean shape
    q00 = q(0, m)   q10 = E_e q(e, m)   q01 = E_b q(0, b)   q11 = E_e,b q(e, b)

    pose  = ((q00 - q10) + (q01 - q11)) / 2      shape = ((q00 - q01) + (q10 - q11)) / 2      pose + shape = q00 - q11

Which of both comes first is arbitrary; each share is the mean over both orders (Shapley 1953).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.perturbation import perturbed_points

__all__ = ["ShapeLoss", "shape_loss"]


class ShapeLoss(NamedTuple):
    """Worth of a grasp under both uncertainties, and what each takes."""

    nominal: float  #: q00, on the mean shape with the hand where it was commanded
    pose: float  #: lost to the pose
    shape: float  #: lost to the unknown shape
    robust: float  #: q11, what is left


def shape_loss(problem: GraspProblem, x: ArrayLike, noise: InputNoise, n: int = 50, seed: int = 0) -> ShapeLoss:
    """Return what a grasp at x (d,) loses to the pose and to the shape, from n disturbed trials on each shape."""
    points = perturbed_points(x, problem.box, noise, n, seed)
    exact = problem.over_shapes(x).mean()
    nominal = problem.grasp(x).quality
    mean_shape = np.mean([problem.grasp(point).quality for point in points])
    both = np.mean([problem.over_shapes(point).mean() for point in points])
    pose = 0.5 * ((nominal - mean_shape) + (exact - both))
    shape = 0.5 * ((nominal - exact) + (mean_shape - both))
    return ShapeLoss(float(nominal), float(pose), float(shape), float(both))

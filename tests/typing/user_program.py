"""What a user writes, for the type checker alone: test_typing.py runs pyright on it."""

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import surehold as sh

box = sh.Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
optimizer = sh.Optimizer(box, input_noise=sh.InputNoise({"dx": 0.003, "dy": 0.003}), surrogate="gp", seed=0)
x = optimizer.ask()
assert_type(x, NDArray[np.float64])
optimizer.tell(x, 0.5)
best = optimizer.recommend()
assert_type(best, sh.Recommendation)
assert_type(best.mean, float)


def outcome(x: NDArray[np.float64]) -> float:
    return -float(x @ x)


result = sh.maximize(outcome, box, 40, seed=1)
assert_type(result, sh.Result)
grasp = sh.problems.GraspProblem("mug", variables=("dx", "dy"), contact="graded")
assert_type(grasp(x), float | NDArray[np.float64])
assert_type(sh.__version__, str)

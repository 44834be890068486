"""From a plan's words to the problem itself: synthetic functions, grasps, functions of one's own."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.plan import ProblemSetup
from surehold.errors import InputError, unknown_name
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.problem import Problem

__all__ = ["build_problem", "checked_problem", "noise_of", "observer"]


def checked_problem(label: str, on: ProblemSetup) -> None:
    """Check the names in a problem without building what is expensive to build.

    Raises
    ------
    InputError
        For an unknown function or argument, with the nearest valid name.
    """
    from surehold.problems.grasp.options import OPTIONS
    from surehold.problems.synthetic import SYNTHETIC

    own = ":" in on.function
    valid = ("bounds",) if own else OPTIONS if on.function == "grasp" else ()
    if not own and on.function != "grasp" and on.function not in SYNTHETIC:
        known = [*SYNTHETIC, "grasp", "package.module:function", "path/file.py:function"]
        raise unknown_name(f"function of problem '{label}'", on.function, known)
    for name in on.arguments:
        if not valid:
            raise InputError(f"problem '{label}' gives {name!r}, but '{on.function}' takes no arguments; leave it out.")
        if name not in valid:
            raise unknown_name(f"argument of problem '{label}'", name, valid)
    if own and "bounds" not in on.arguments:
        raise InputError(f"problem '{label}' has no bounds; give for example arguments: {{bounds: 'dx=-0.05:0.05'}}.")


def build_problem(on: ProblemSetup) -> Problem:
    """Return the problem.

    Raises
    ------
    InputError
        If an argument has no valid value, or an own function cannot be loaded.
    """
    if on.function == "grasp":
        from surehold.problems.grasp.description import described_grasp

        # The published measure is 0 for a collision: plans that ask for it say nothing else of collisions.
        worth = {"collision": "zero"} if on.arguments.get("quality") == "simox" else {}
        return described_grasp({**worth, **on.arguments})
    if ":" in on.function:
        from surehold.problems.function import Function, load_function, parse_bounds

        return Function(load_function(on.function), parse_bounds(str(on.arguments["bounds"])), on.function)
    from surehold.problems.synthetic import synthetic_function

    return synthetic_function(on.function)


def noise_of(on: ProblemSetup) -> InputNoise | None:
    """Return the input noise of a problem."""
    return None if on.input_noise is None else InputNoise.unit(on.input_noise)


def observer(problem: Problem, on: ProblemSetup, seed: int) -> Callable[[NDArray[np.float64]], tuple[float, float]]:
    """Return a function of u (d,) in the unit cube that gives the value told to the optimizer, and the true one.

    The noise of trial t depends on seed and t alone: every method meets the same one.
    """
    rng = np.random.default_rng([seed, 7])

    def observe(u: NDArray[np.float64]) -> tuple[float, float]:
        value = float(np.asarray(problem(problem.box.from_unit(u))).reshape(()))
        noise = abs(float(rng.standard_normal())) * on.observation_noise
        return value - noise, value

    return observe

"""From a plan's words to the problem itself: synthetic functions, grasps, functions of one's own."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.plan import ProblemSetup
from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.samples import Samples
from surehold.problems.problem import Problem

if TYPE_CHECKING:
    from surehold.problems.robust import RobustProblem

__all__ = ["build_problem", "checked_problem", "noise_of", "observer", "robust_problem_of", "unit_noise_of"]


def checked_problem(label: str, on: ProblemSetup) -> None:
    """Check the names in a problem without building what is expensive to build.

    Raises
    ------
    InputError
        For an unknown function or argument, with the nearest valid name.
    """
    from surehold.problems.grasp.options import OPTIONS
    from surehold.problems.named import NAMES, has_own_noise, unknown_function

    own = ":" in on.function
    valid = ("bounds",) if own else OPTIONS if on.function == "grasp" else ()
    if not own and on.function != "grasp" and on.function not in NAMES:
        raise unknown_function(f"function of problem '{label}'", on.function, ("grasp",))
    for name in on.arguments:
        if not valid:
            raise InputError(f"problem '{label}' gives {name!r}, but '{on.function}' takes no arguments; leave it out.")
        if name not in valid:
            raise unknown_name(f"argument of problem '{label}'", name, valid)
    if on.input_noise == "own" and not has_own_noise(on.function):
        raise InputError(f"problem '{label}': '{on.function}' states no input noise of its own; give a number.")
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
    from surehold.problems.named import named_function

    return named_function(on.function)


def robust_problem_of(on: ProblemSetup) -> "RobustProblem | None":
    """Return the robust problem whose own noise and score a plan asks for; None where it does not.

    Raises
    ------
    InputError
        If that problem states no input noise.
    """
    if on.input_noise != "own":
        return None
    from surehold.problems.named import robust_problem

    problem = robust_problem(on.function)
    if problem.noise is None:
        raise InputError(f"'{on.function}' has exact inputs; leave input_noise out.")
    return problem


def noise_of(on: ProblemSetup) -> InputNoise | None:
    """Return the input noise of a problem, in the units of its box."""
    asked = robust_problem_of(on)
    if asked is not None:
        return asked.noise
    return None if on.input_noise is None else InputNoise.unit(float(on.input_noise))


def unit_noise_of(on: ProblemSetup) -> InputNoise | None:
    """Return the input noise of a problem for the unit cube, in which methods work."""
    asked = robust_problem_of(on)
    if asked is None or asked.noise is None:
        return noise_of(on)
    noise, box = asked.noise, asked.function.box
    names = Box.unit(box.dimension).names
    covariance = noise.unit_covariance(box)
    deviations = np.sqrt(np.diag(covariance))
    if isinstance(noise.kind, Samples):
        return InputNoise.samples(noise.kind.errors / box.widths)
    if noise.varies:
        return InputNoise.varying(lambda u: noise.unit_covariance(box, box.from_unit(u)))
    if noise.bounded:
        return InputNoise.uniform(dict(zip(names, (3.0**0.5 * deviations).tolist(), strict=True)))
    if np.count_nonzero(covariance - np.diag(np.diag(covariance))):
        return InputNoise(covariance=covariance)
    return InputNoise(dict(zip(names, deviations.tolist(), strict=True)))


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

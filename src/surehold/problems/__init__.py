"""What is maximized: synthetic functions, grasping, a user's own function; and how an answer is scored when shaken."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surehold.problems.function import Function, load_function, parse_bounds
    from surehold.problems.grasp.problem import GraspProblem as Grasp
    from surehold.problems.perturbation import RobustScore, perturbed_points, robust_score
    from surehold.problems.problem import Optimum, Problem
    from surehold.problems.robust import RobustProblem, robust_problem
    from surehold.problems.synthetic import GF, GM, RKHS, GaussianBumps, robust_optimum, synthetic_function

__all__ = [
    "GF",
    "GM",
    "RKHS",
    "Function",
    "GaussianBumps",
    "Grasp",
    "Optimum",
    "Problem",
    "RobustProblem",
    "RobustScore",
    "load_function",
    "parse_bounds",
    "perturbed_points",
    "robust_optimum",
    "robust_problem",
    "robust_score",
    "synthetic_function",
]

_HOMES = {
    "Function": "function",
    "load_function": "function",
    "parse_bounds": "function",
    "Grasp": "grasp.problem:GraspProblem",
    "RobustScore": "perturbation",
    "perturbed_points": "perturbation",
    "robust_score": "perturbation",
    "Optimum": "problem",
    "Problem": "problem",
    "RobustProblem": "robust",
    "robust_problem": "robust",
    "GF": "synthetic",
    "GM": "synthetic",
    "RKHS": "synthetic",
    "GaussianBumps": "synthetic",
    "robust_optimum": "synthetic",
    "synthetic_function": "synthetic",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home, _, own_name = _HOMES[name].partition(":")
    value = getattr(import_module(f"{__name__}.{home}"), own_name or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)

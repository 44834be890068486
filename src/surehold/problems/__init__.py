"""What is maximized: synthetic functions, grasping, a user's own function; and how an answer is scored when shaken."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surehold.problems.function import Function, load_function, parse_bounds
    from surehold.problems.grasp.problem import Grasp
    from surehold.problems.named import robust_problem
    from surehold.problems.perturbation import RobustScore, perturbed_points, robust_score
    from surehold.problems.problem import Optimum, Problem
    from surehold.problems.robust import RobustProblem
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
    "Grasp": "grasp.problem",
    "RobustScore": "perturbation",
    "perturbed_points": "perturbation",
    "robust_score": "perturbation",
    "Optimum": "problem",
    "Problem": "problem",
    "RobustProblem": "robust",
    "robust_problem": "named",
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
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)

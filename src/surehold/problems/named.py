"""Problems by name: the thesis' functions, the harder ones of our own, and those of other papers."""

from collections.abc import Callable
from typing import Any, Final

from surehold.errors import unknown_name
from surehold.problems.high_dimensional import HIGH_DIMENSIONAL, HIGH_DIMENSIONAL_ROBUST
from surehold.problems.published import PUBLISHED
from surehold.problems.robust import ROBUST, RobustProblem
from surehold.problems.synthetic import SYNTHETIC

__all__ = ["NAMES", "has_own_noise", "named_function", "robust_problem"]

_ROBUST: Final[dict[str, Callable[[], RobustProblem]]] = {
    **ROBUST,
    **PUBLISHED,
    **HIGH_DIMENSIONAL_ROBUST,
}
#: All names that a plan, a study and the command line understand.
NAMES: Final = (*SYNTHETIC, *_ROBUST, *HIGH_DIMENSIONAL)


def robust_problem(name: str) -> RobustProblem:
    """Return the robust problem of that name: "needle-2", ... (`robust`), "nes-polynomial", ... (`published`).

    Raises
    ------
    InputError
        If there is none; the message names the nearest.

    Examples
    --------
    >>> problem = robust_problem("nes-sin-linear")
    >>> problem.trials, float(problem.optimum.value)
    (23, 1.042098)
    """
    if name not in _ROBUST:
        raise unknown_name("robust problem", name, _ROBUST)
    return _ROBUST[name]()


def has_own_noise(name: str) -> bool:
    """Return whether that name is a robust problem, which states its own input noise."""
    return name in _ROBUST


def named_function(name: str) -> Any:
    """Return the function of that name, of the thesis, of a robust problem, or of many variables.

    Raises
    ------
    InputError
        If there is none; the message names the nearest.
    """
    if name in SYNTHETIC:
        return SYNTHETIC[name]()
    if name in HIGH_DIMENSIONAL:
        return HIGH_DIMENSIONAL[name]()
    if name not in _ROBUST:
        raise unknown_name("problem", name, NAMES)
    return _ROBUST[name]().function

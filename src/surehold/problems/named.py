"""Problems by name: the thesis' functions, the harder ones of our own, and those of other papers."""

from collections.abc import Callable
from typing import Any, Final

from surehold.errors import InputError, unknown_name
from surehold.problems.high_dimensional import HIGH_DIMENSIONAL, HIGH_DIMENSIONAL_ROBUST
from surehold.problems.published import PUBLISHED
from surehold.problems.robust import ROBUST, RobustProblem
from surehold.problems.synthetic import SYNTHETIC

__all__ = ["NAMES", "has_own_noise", "named_function", "robust_problem", "unknown_function"]

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


def unknown_function(kind: str, text: str, more: tuple[str, ...] = ()) -> InputError:
    """Return the error for a text that is no name of a problem, nor the reference of a function with its colon."""
    if text.endswith(".py"):
        return InputError(
            f"{kind} {text!r} is a file; say which of its functions, behind a colon, for example '{text}:quality'."
        )
    return unknown_name(kind, text, [*NAMES, *more, "package.module:function", "path/file.py:function"])


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

"""Answers to the trials of a study that succeed or fail: kept as shares of executions, 1 and 0 of a single one."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.optimization.success import counted

__all__ = ["answer", "count_told"]

_WORDS: Final = {"success": 1.0, "failure": 0.0, True: 1.0, False: 0.0, "1": 1.0, "0": 0.0}


def answer(
    optimizer: Mapping[str, Any], value: Any, successes: int | None = None, of: int | None = None
) -> tuple[Any, int]:
    """Return the value to keep of what was told and its number of executions, by a study's settings of the optimizer.

    Raises
    ------
    InputError
        If the study is about success and something else was told, or the other way round; if successes come with a
        value, or are no count.
    """
    if isinstance(value, np.generic):  # what comparing or counting with NumPy gives
        value = value.item()
    if optimizer.get("outcome", "value") != "success":
        if successes is not None or of is not None:
            said = f"{successes} successes of {of} were"
        elif isinstance(value, bool) or (isinstance(value, str) and (value in ("success", "failure") or "/" in value)):
            said = f"{str(value)[:60]!r} was"
        else:
            return value, 1
        raise InputError(f"{said} told, but this study is told values; create one with --outcome success.")
    if value is not None and (successes is not None or of is not None):
        raise InputError(f"{str(value)[:60]!r} and a count of successes were told; leave one of the two out.")
    if isinstance(value, str) and "/" in value:
        try:
            successes, of = (int(part) for part in value.split("/"))
        except ValueError:
            raise InputError(
                f"{value[:60]!r} is no count of successes; tell two whole numbers, such as 7/10."
            ) from None
    elif successes is None and of is None:
        if value is None:
            return None, 1
        if not isinstance(value, (str, bool, int, float)) or value not in _WORDS:
            raise InputError(
                f"{str(value)[:60]!r} was told, but this study is about success; tell success, failure or, of several "
                "executions, 7/10."
            )
        return _WORDS[value], 1
    if successes is None or of is None:
        raise InputError(f"successes are {successes} of {of}; tell both, such as successes=7, of=10.")
    share, executions, _ = counted("success", None, None, successes, of, False)
    return share, executions


def count_told(share: Any, of: Any) -> str:
    """Return successes and executions as they are told, "7/10", of a stored share; raises InputError if it is none."""
    try:
        executions, successes = int(of), float(share) * int(of)
        if executions < 1 or abs(successes - round(successes)) > 1e-6:
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{str(share)[:60]!r} is no share of {str(of)[:60]!r} executions that succeeded.") from None
    return f"{round(successes)}/{executions}"

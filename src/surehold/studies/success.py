"""Answers to the trials of a study that succeed or fail: kept as 1 and 0."""

from collections.abc import Mapping
from typing import Any, Final

from surehold.errors import InputError

__all__ = ["answer"]

_WORDS: Final = {"success": 1.0, "failure": 0.0, True: 1.0, False: 0.0, "1": 1.0, "0": 0.0}


def answer(optimizer: Mapping[str, Any], value: Any) -> Any:
    """Return the value to keep of what was told, by a study's settings of the optimizer.

    Raises
    ------
    InputError
        If the study is about success and something else was told, or the other way round.
    """
    if optimizer.get("outcome", "value") != "success":
        if isinstance(value, str) and value in ("success", "failure"):
            raise InputError(f"'{value}' was told, but this study is told values; create one with --outcome success.")
        return value
    if value is None:
        return None
    if not isinstance(value, (str, bool, int, float)) or value not in _WORDS:
        raise InputError(f"{str(value)[:60]!r} was told, but this study is about success; tell success or failure.")
    return _WORDS[value]

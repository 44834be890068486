"""One family of errors: catch `SureholdError` to catch everything surehold raises on purpose."""

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["InputError", "SureholdError", "unknown_name"]


class SureholdError(Exception):
    """Base of all errors that surehold raises on purpose."""


class InputError(SureholdError, ValueError):
    """The caller gave something unusable; the message names the value, what is valid and the next step."""


def unknown_name(kind: str, name: object, valid: Iterable[str]) -> InputError:
    """Return the error for a name that is not among the valid ones, with the nearest valid name first.

    >>> str(unknown_name("facet", "lefft", ["left", "right"]))
    "facet 'lefft' is unknown; did you mean 'left'? Choose one of: left, right."
    """
    choices = list(valid)
    near = get_close_matches(str(name), choices, n=1)
    hint = f" did you mean '{near[0]}'?" if near else ""
    text = f"{kind} {str(name)!r} is unknown;{hint} Choose one of: {', '.join(choices)}."
    return InputError(text.replace("; Choose", "; choose"))

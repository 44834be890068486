"""Parameters as a person types them: `dx=-0.05:0.05, force=0.1:100:log, fingers=2:5:int, grip=pinch/power`.

Choices are separated by "/", which needs no quotes in a shell, or by "|".
"""

from typing import Any

from surehold.errors import InputError
from surehold.studies.search_space import SearchSpace

__all__ = ["parse_assignments", "parse_search_space"]

_FORM = "write NAME=LOWER:UPPER, with :log, :int or :step=0.5 behind it where wanted, or NAME=this/that"


def parse_search_space(text: str) -> SearchSpace:
    """Return the search space that a text describes.

    Raises
    ------
    InputError
        If the text does not follow the form, repeats a name, or holds bounds that are none.

    Examples
    --------
    >>> space = parse_search_space("dx=-0.05:0.05, force=0.1:100:log, fingers=2:5:int, grip=pinch|power")
    >>> space.distributions["fingers"]
    IntDistribution(high=5, log=False, low=2, step=1)
    """
    parameters: dict[str, Any] = {}
    for part in text.split(","):
        name, equals, described = (piece.strip() for piece in part.partition("="))
        if not equals or not name or not described:
            raise InputError(f"parameter {part.strip()!r} is not understood; {_FORM}.")
        if name in parameters:
            raise InputError(f"parameter {name!r} is named twice; give each once.")
        try:
            parameters[name] = _described(described)
        except ValueError as error:
            raise InputError(f"parameter {part.strip()!r} is not understood ({error}); {_FORM}.") from None
    return SearchSpace(parameters)


def parse_assignments(text: str, what: str) -> dict[str, str]:
    """Return `{name: value}` from a text of the form NAME=VALUE,NAME=VALUE; `what` says in messages what it is."""
    found: dict[str, str] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name or not value:
            raise InputError(f"{what} {text!r} is not of the form NAME=VALUE,NAME=VALUE.")
        if name in found:
            raise InputError(f"{what} names {name!r} twice; give each once.")
        found[name] = value
    return found


def _described(described: str) -> list[Any] | tuple[Any, ...]:
    """Return what `SearchSpace` takes for the bounds, or the choices, of one parameter."""
    for between in ("|", "/"):  # "/" needs no quotes in a shell; with "|", choices may hold a "/"
        if between in described:
            choices = [choice.strip() for choice in described.split(between)]
            if "" in choices:
                raise ValueError("a choice is empty")
            return choices
    lower, *rest = described.split(":")
    if not rest:
        try:
            float(described)
        except ValueError:
            raise ValueError(f"{described!r} is neither a range nor a choice of several") from None
        raise ValueError("one number is no range")
    options = [_checked_option(option.strip()) for option in rest[1:]]
    low, high = float(lower), float(rest[0])
    if "log" in options and not low > 0.0:
        raise ValueError("a logarithmic range lies above 0")
    return low, high, *options


def _checked_option(text: str) -> str:
    name, _, value = text.partition("=")
    if name in ("int", "log") and not value:
        return name
    if name == "step" and value:
        if not float(value) > 0.0:
            raise ValueError(f"a step of {value} leads nowhere")
        return text
    raise ValueError(f"{text!r} is none of log, int, step=...")

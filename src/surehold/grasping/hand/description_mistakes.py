"""What is wrong with a description of a hand, in words: each key and value with its line in the file."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml
from pydantic_core import ErrorDetails

from surehold.grasping.plain_data import regular_bytes

__all__ = ["mistakes_in_words"]

_MOST: Final = 6  # mistakes that are told at once
_LONGEST: Final = 60  # characters of a value
_PACKAGED: Final = "PackagedModel"


class _Mistake(NamedTuple):
    line: int  #: from 1; 0 where none is known
    text: str


def mistakes_in_words(
    path: str | Path, content: Mapping[str, Any], errors: Sequence[ErrorDetails], keys: Mapping[str, Sequence[str]]
) -> str:
    """Return what is unknown, missing or no valid value in a description, in the order of its lines.

    `keys` are the valid ones of each mapping, {place: names}: "" is the file, "palm" a mapping in it, and "preshapes.*"
    any in "preshapes".
    """
    tree = yaml.compose(regular_bytes(path).decode("utf-8"), Loader=yaml.SafeLoader)
    found = []
    for error in errors:
        place = _place(error["loc"], content)
        if place is not None:
            found.append(_mistake(place, error, tree, keys))
    found = sorted(set(found), key=lambda mistake: mistake.line or 10**9)
    texts = [f"line {line}: {text}" if line else text for line, text in found[:_MOST]]
    return "; ".join(texts) + (f"; and {len(found) - _MOST} more" if len(found) > _MOST else "")


def _place(loc: tuple[int | str, ...], content: Mapping[str, Any]) -> tuple[int | str, ...] | None:
    """Return where an error is in the file; None for one of the kind of model that is not meant."""
    if loc[:1] != ("model",) or len(loc) < 2:
        return loc
    given = content.get("model")
    packaged = isinstance(given, Mapping) and bool(given.keys() & {"package", "distribution", "path"})
    return ("model", *loc[2:]) if (loc[1] == _PACKAGED) == packaged else None


def _mistake(
    place: tuple[int | str, ...], error: ErrorDetails, tree: Any, keys: Mapping[str, Sequence[str]]
) -> _Mistake:
    of_key = place[-1:] == ("[key]",)
    place = place[:-1] if of_key else place
    name = ".".join(map(str, place))
    if error["type"] == "missing":
        return _Mistake(_line(tree, place[:-1]) if len(place) > 1 else 0, f"{name!r} is missing")
    if error["type"] == "extra_forbidden" or of_key:
        valid = _valid(place[:-1], keys)
        near = get_close_matches(str(place[-1]), valid, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"choose one of {', '.join(valid)}"
        return _Mistake(_line(tree, place), f"{name[:_LONGEST]!r} is no key here ({hint})")
    value = repr(error["input"])
    shown = value if len(value) <= _LONGEST else f"{value[:_LONGEST]}..."
    if error["type"] in ("model_type", "dict_type"):
        valid = _valid(place, keys)
        wanted = "a mapping" + (f" with {', '.join(valid)}" if valid else "")
        wanted = "a mapping such as {file: hand.xml}" if name == "model" else wanted
    else:
        said = error["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
        wanted = said[:1].lower() + said[1:]
    return _Mistake(_line(tree, place), f"{name!r} is {shown}, and must be: {wanted}")


def _valid(place: Sequence[int | str], keys: Mapping[str, Sequence[str]]) -> Sequence[str]:
    """Return the valid keys of a mapping; none where they are the author's own."""
    parts = [str(part) for part in place]
    any_of = [parts[0], "*", *parts[2:]] if len(parts) > 1 else parts
    return keys.get(".".join(parts)) or keys.get(".".join(any_of)) or ()


def _line(node: Any, place: Sequence[int | str]) -> int:
    """Return the line of a place in the file, or of the nearest one around it."""
    line = 0
    for part in place:
        if isinstance(node, yaml.MappingNode):
            pair = next(((key, value) for key, value in node.value if key.value == str(part)), None)
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            pair = node.value[part], node.value[part]
        else:
            pair = None
        if pair is None:
            break
        line, node = pair[0].start_mark.line + 1, pair[1]
    return line

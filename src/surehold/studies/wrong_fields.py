"""What is wrong with a message to a study, field by field, and what to send instead.

Not what Pydantic says: where several types are valid each of them complains, and what it repeats JSON cannot hold.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

from surehold.errors import unknown_name

__all__ = ["example", "shown", "wrong_field"]

_ANY: Final = "a finite number, a text, true or false"
#: What is valid where several types are; without this each of them would complain of its own.
_VALID: Final = {
    "failed": 'true, false, or "rig" in tell',
    "reached": _ANY,
    "parameters": _ANY,
    "constraints": "a finite number, or null where it was not measured",
}
_VALUE: Final = "a finite number, or leave it out and send failed: true"
_SUCCESS: Final = 'true or "success", false or "failure", or in its place successes and of'


def wrong_field(error: Any, where: Sequence[Any], fields: Mapping[str, Any], counted: bool) -> tuple[Any, str]:
    """Return a field, and what is wrong with it; a field may come more than once, with the same words.

    Parameters
    ----------
    error
        One of Pydantic's, a dictionary.
    where
        Names and numbers that lead from the message to what is wrong.
    fields
        Of the message, by name.
    counted
        Whether the study is about success.
    """
    name = ".".join(map(str, where))
    if error["type"] == "missing":
        return (name, "missing"), f"field '{name}' is missing; send {example(fields)}."
    if error["type"] == "extra_forbidden":
        unknown = unknown_name("field", name, fields) if len(where) == 1 and fields else f"field '{name}' is unknown."
        return (name, "unknown"), str(unknown)
    if where[0] == "value":
        return "value", f"value is {shown(error['input'])}; send {_SUCCESS if counted else _VALUE}."
    if where[0] in _VALID and len(where) > 1:
        name = "failed" if where[0] == "failed" else ".".join(map(str, where[:2]))
        return name, f"{name} is {shown(error['input'])}; send {_VALID[where[0]]}."
    valid = error["msg"].replace("Input should be", "it must be").replace("valid dictionary", "JSON object")
    return (name, valid), f"{name} is {shown(error['input'])}; {valid}."


def example(fields: Mapping[str, Any]) -> str:
    """Return how a message is written that has the fields that it needs."""
    needed = [name for name, field in fields.items() if field.is_required()]
    body = "{" + ", ".join(f'"{name}": ...' for name in needed) + "}"
    others = [name for name in fields if name not in needed]
    return body + f", where wanted with {', '.join(others)}" * bool(others)


def shown(value: Any) -> str:
    """Return a value as JSON writes it, cut where it is long."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else f"{text[:60]}..."

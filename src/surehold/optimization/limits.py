"""Limits of further outputs of a trial: given at construction, held against what is told."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.values import LARGEST_SQUARED

__all__ = ["Limit", "checked_outputs", "limits_of", "parsed_limit", "returned_outputs"]


@dataclass(frozen=True)
class Limit:
    """Between what an output must stay."""

    name: str
    lower: float
    """-inf for none"""
    upper: float
    """inf for none"""

    @property
    def watched(self) -> bool:
        """Whether the output has no limit and is recorded only."""
        return self.lower == -np.inf and self.upper == np.inf

    @property
    def stated(self) -> tuple[float | None, float | None]:
        """The limits as `limits_of` takes them and a file can hold them."""
        return (None if self.lower == -np.inf else self.lower, None if self.upper == np.inf else self.upper)

    def missed_by(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return by how much values are beyond the nearer limit: negative inside, NaN of NaN."""
        return np.maximum(self.lower - values, values - self.upper)


def limits_of(constraints: Mapping[str, Sequence[float | None]] | None) -> tuple[Limit, ...]:
    """Return the limits of `Optimizer(constraints={name: (lower, upper)})`; None is no limit.

    Raises InputError for limits that are no numbers, contradict each other or are equal.
    """
    if constraints is None:
        return ()
    if not isinstance(constraints, Mapping):
        raise InputError(
            f"constraints are {constraints!r}; give {{name: (lower, upper)}}, None where there is no limit."
        )
    found = []
    for name, pair in constraints.items():
        if not isinstance(name, str) or not name:
            raise InputError(f"the name of a constraint is {name!r}; name each output, such as 'torque'.")
        try:
            lower, upper = pair
            low = -np.inf if lower is None else _number(lower)
            high = np.inf if upper is None else _number(upper)
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"limits of '{name}' are {pair!r}; give (lower, upper), None where there is none."
            ) from None
        if np.isnan(low) or np.isnan(high) or low == np.inf or high == -np.inf or not low < high:
            raise InputError(
                f"limits of '{name}' are {pair!r}; the lower one must be smaller than the upper one. (Both None: the "
                "output is recorded only.)"
            )
        found.append(Limit(name, low, high))
    return tuple(found)


def parsed_limit(text: str) -> tuple[str, tuple[float | None, float | None]]:
    """Return the name and the limits that a text describes: "torque <= 3", "1 <= torque <= 3", "torque >= 1".

    A name alone is an output that is recorded only. Raises InputError where the text does not follow the form.
    """
    parts = [part.strip() for part in re.split(r"(<=|>=|<|>)", text)]
    sides, signs = parts[::2], {sign[0] for sign in parts[1::2]}
    named = [i for i, side in enumerate(sides) if not _is_number(side)]
    middle = {1: [0], 2: [0, 1], 3: [1]}.get(len(sides), [])
    name = sides[named[0]] if len(named) == 1 and named[0] in middle else ""
    if len(signs) > 1 or not name or any(sign in name for sign in "=≤≥"):  # "torque=<3" would name an output "torque="
        raise InputError(f"constraint {text!r} is not understood; write 'torque<=3', '1<=torque<=3' or 'torque>=1'.")
    numbers = [float(side) for i, side in enumerate(sides) if i != named[0]]
    if len(sides) == 1:
        return name, (None, None)
    if len(sides) == 3:
        return name, (numbers[0], numbers[1]) if signs == {"<"} else (numbers[1], numbers[0])
    above = (signs == {">"}) == (named[0] == 0)
    return name, (numbers[0], None) if above else (None, numbers[0])


def checked_outputs(
    limits: tuple[Limit, ...], told: Mapping[str, float | None] | None, failed: bool
) -> tuple[float, ...]:
    """Return the outputs of one trial in the order of the limits, NaN where one was not measured (None).

    A trial that failed, and an output that is only watched, need none. Raises InputError for an unknown name, a value
    that is no finite number, and one that is missing.
    """
    if told is not None and not isinstance(told, Mapping):
        raise InputError(f"constraints are {told!r}; give {{name: value}}.")
    names = [limit.name for limit in limits]
    given = dict(told or {})
    for name in given:
        if not names:
            raise InputError(
                f"output {name!r} was told, but this optimizer has no constraints; say "
                f"Optimizer(constraints={{{name!r}: (None, 3.0)}}), or (None, None) to record it only."
            )
        if name not in names:
            raise unknown_name("output", name, names)
    found = []
    for limit in limits:
        if limit.name not in given and not failed and not limit.watched:
            raise InputError(
                f"the trial says nothing about '{limit.name}'; tell constraints={{{limit.name!r}: value}} "
                f"(--constraints {limit.name}=VALUE), or None where it could not be measured."
            )
        value = given.get(limit.name)
        try:
            number = np.nan if value is None else _number(value)
        except (TypeError, ValueError, OverflowError):
            number = np.inf
        if value is not None and not abs(number) <= LARGEST_SQUARED:
            raise InputError(
                f"output '{limit.name}' is {repr(value)[:60]}; give one number up to {LARGEST_SQUARED:g}, or None."
            )
        found.append(number)
    return tuple(found)


def returned_outputs(
    limits: tuple[Limit, ...], returned: Mapping[str, float | None]
) -> tuple[Mapping[str, float | None], str]:
    """Return what a function has returned besides its value, as far as it is to be told; or {} and what is wrong.

    What has no limit and is not watched is left out, unless an output that has one is missing: it may be its name.
    """
    names = [limit.name for limit in limits]
    missing = [limit.name for limit in limits if not limit.watched and limit.name not in returned]
    told = {name: value for name, value in returned.items() if name in names}
    if missing and len(told) == len(returned):
        return {}, (
            f"the function returned nothing of '{missing[0]}'; return (value, {{{missing[0]!r}: number}}), None as the "
            "number where it could not be measured"
        )
    try:
        checked_outputs(limits, returned if missing else told, failed=False)
    except InputError as error:
        return {}, str(error).rstrip(".")
    return told, ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(value: Any) -> float:
    if isinstance(value, bool):
        raise TypeError("a truth value is no limit")
    return float(value)

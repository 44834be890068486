"""A linear constraint between variables, such as `a + 2*b <= 3`.

Legend: w weights (d,), l lower and u upper limit, in the box's units: l <= w'x <= u.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name

__all__ = ["ROUNDING", "Linear"]

ROUNDING: Final = 1e-10  # of a constraint's largest values: an input on its border is allowed

_NUMBER: Final = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_TERM: Final = re.compile(rf"\s*([+-]?)\s*(?:({_NUMBER})\s*\*?\s*)?([^\W\d][\w.]*)?\s*")
_SIDES: Final = re.compile(r"(<=|>=|<|>|=+)")
_FORM: Final = "write for example 'a + 2*b <= 3', or '0 <= a - b <= 1'"


@dataclass(frozen=True)
class Linear:
    """lower <= sum of weights[name] * x[name] <= upper, in the box's units.

    Raises InputError for weights that are not finite or all 0, and limits that are missing, not finite or
    contradictory.

    Examples
    --------
    >>> Linear({"a": 1.0, "b": 2.0}, upper=3.0) == Linear.parse("a + 2*b <= 3")
    True
    """

    weights: Mapping[str, float]
    """{name: weight}; variables that are left out weigh 0"""
    lower: float | None = field(default=None, kw_only=True)
    upper: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.weights, Mapping):
            raise InputError(f"weights are {self.weights!r}; give {{name: weight}}, such as {{'a': 1, 'b': 2}}.")
        try:
            values = {name: float(value) for name, value in self.weights.items()}
            limits = [None if limit is None else float(limit) for limit in (self.lower, self.upper)]
        except (TypeError, ValueError):
            raise InputError(f"{self._shown()} holds what is no number; {_FORM}.") from None
        object.__setattr__(self, "weights", values)
        object.__setattr__(self, "lower", limits[0])
        object.__setattr__(self, "upper", limits[1])
        if not np.isfinite([*values.values(), *(limit for limit in limits if limit is not None)]).all():
            raise InputError(
                f"{self._shown()} holds a number that is not finite; leave a limit out where there is none."
            )
        if not any(values.values()):
            raise InputError(f"{self._shown()} weighs no variable; {_FORM}.")
        if limits == [None, None]:
            raise InputError(f"{self._shown()} has no limit; give lower= or upper=.")
        if self.lower is not None and self.upper is not None and self.lower >= self.upper:
            raise InputError(
                f"{self._shown()} leaves nothing; lower must be smaller than upper. (Where the sum is to have one "
                "value, leave one of the variables out of the box and compute it.)"
            )

    @classmethod
    def parse(cls, text: str) -> "Linear":
        """Return the constraint that a text describes; raises InputError where it does not follow the form."""
        parts = [part.strip() for part in _SIDES.split(text)]
        sides, signs = parts[::2], set(parts[1::2])
        if len(sides) not in (2, 3) or not (signs <= {"<=", "<"} or signs <= {">=", ">"}):
            raise InputError(f"constraint {text!r} is not understood; {_FORM}.")
        if signs <= {">=", ">"}:
            sides.reverse()
        read = [_side(side, text) for side in sides]  # ascending
        named = [i for i, (weights, _) in enumerate(read) if weights]
        if len(sides) == 3:
            if named != [1]:
                raise InputError(f"constraint {text!r} is not understood; {_FORM}.")
            weights, constant = read[1]
            return cls(weights, lower=read[0][1] - constant, upper=read[2][1] - constant)
        (low, a), (high, b) = read
        weights = {name: low.get(name, 0.0) - high.get(name, 0.0) for name in {**low, **high}}
        if named == [1]:  # 3 <= a + b reads better as a lower limit
            return cls(high, lower=a - b)
        return cls(weights, upper=b - a)

    def row(self, names: tuple[str, ...]) -> NDArray[np.float64]:
        """Return w (d,) in the order of the names; raises InputError for a name that is not among them."""
        for name in self.weights:
            if name not in names:
                raise unknown_name("variable of a linear constraint", name, names)
        return np.array([self.weights.get(name, 0.0) for name in names])

    def _shown(self) -> str:
        return f"linear constraint with weights {dict(self.weights)!r} and limits ({self.lower}, {self.upper})"

    def __str__(self) -> str:
        total = " + ".join(name if value == 1.0 else f"{value:g}*{name}" for name, value in self.weights.items())
        left = "" if self.lower is None else f"{self.lower:g} <= "
        return left + total.replace("+ -", "- ") + ("" if self.upper is None else f" <= {self.upper:g}")


def _side(side: str, text: str) -> tuple[dict[str, float], float]:
    """Return the weights and the constant of one side of an inequality."""
    weights: dict[str, float] = {}
    constant, position = 0.0, 0
    while position < len(side):
        found = _TERM.match(side, position)
        if found is None or not (found[2] or found[3]) or (position > 0 and not found[1]):
            raise InputError(f"constraint {text!r} is not understood at {side[position:]!r}; {_FORM}.")
        value = float(found[2] or 1.0) * (-1.0 if found[1] == "-" else 1.0)
        if found[3]:
            weights[found[3]] = weights.get(found[3], 0.0) + value
        else:
            constant += value
        position = found.end()
    if not side:
        raise InputError(f"constraint {text!r} lacks a side; {_FORM}.")
    return weights, constant

"""What a variable of a box can be: a number, linear or logarithmic, of any value or in steps; or a choice.

variable                        coordinates of the box
number                          the value
number, log                     its natural logarithm
number with step, integer       the value, in cells of equal width around each level
integer, log                    the logarithm of the value, in cells that end halfway between the integers
choice of k                     k coordinates in [0, 1], 1 for the choice that is taken (one-hot)
"""

import re
from math import isfinite
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name

__all__ = ["Choice", "Number", "Variable", "variable_of"]

_LARGEST: Final = 1e100  # magnitude of a bound; what is computed with larger ones overflows
_LONE: Final = re.compile("[\ud800-\udfff]")  # surrogates that are no pair
_FORM: Final = (
    "give two numbers (lower, upper), with 'log', 'int' or 'step=0.5' behind them where wanted, or a list of texts"
)


class Number(NamedTuple):
    """A variable that is a number."""

    name: str
    low: float
    high: float
    step: float = 0.0
    """0 where every value of the range can be tried"""
    log: bool = False
    integer: bool = False

    @property
    def described(self) -> tuple[Any, ...]:
        """What `variable_of` takes."""
        step = f"step={self.step:.17g}" if self.step and not (self.integer and self.step == 1.0) else ""
        words = ("int" if self.integer else "", "log" if self.log else "", step)
        return (self.low, self.high, *(word for word in words if word))

    def bounds(self) -> tuple[float, float]:
        """Return the limits of the coordinate: with steps, half a cell beyond the first and the last level."""
        half = 0.5 * self.step
        lower, upper = self.to_coordinate(np.array([self.low - half, self.high + half])).tolist()
        return lower, upper

    def to_coordinate(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the coordinates of values."""
        return np.log(values) if self.log else values

    def from_coordinate(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values at coordinates, whether they can be tried or not."""
        return np.exp(coordinates) if self.log else coordinates

    def to_value(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest values that can be tried."""
        values = self.from_coordinate(coordinates)
        if self.step:
            values = self.low + self.step * np.round((values - self.low) / self.step)
        return np.clip(values, self.low, self.high)

    def decoded(self, coordinate: float) -> int | float:
        """Return the nearest value that can be tried, as a Python number."""
        value = float(self.to_value(np.float64(coordinate)))  # type: ignore[arg-type]
        return round(value) if self.integer else value

    def checked(self, value: Any, what: str) -> int | float:
        """Return a value that can be tried.

        Raises
        ------
        InputError
            If it is no finite number, outside the range by more than the rounding of single precision, or no level.
        """
        low, high, step = self.low, self.high, self.step
        number = _finite(self.name, value, what, f"a finite number between {low:g} and {high:g}")
        slack = 1e-9 * (high - low) + min(2.0**-23 * max(abs(low), abs(high)), 1e-3 * (high - low))
        if not low - slack <= number <= high + slack:  # as in Box.rounding
            raise InputError(f"{what}: {self.name} = {number:g} lies outside its range from {low:g} to {high:g}.")
        number = min(max(number, low), high)
        if step:
            level = low + step * round((number - low) / step)
            if abs(number - level) > 1e-6 * step:
                raise InputError(
                    f"{what}: {self.name} = {number:g} is no level; it goes from {low:g} in steps of {step:g}."
                )
            number = level
        return round(number) if self.integer else number

    def anywhere(self, value: Any, what: str) -> int | float:
        """Return a value that was reached, within the range or not; raises InputError where that has no coordinate."""
        number = _finite(self.name, value, what, "a finite number")
        if abs(number) > _LARGEST or (number <= 0.0 and self.log):
            raise InputError(f"{what}: {self.name} is {value!r}; give a number that can be reached.")
        return round(number) if number.is_integer() and self.integer else number


class Choice(NamedTuple):
    """A variable that is one of several things."""

    name: str
    choices: tuple[Any, ...]

    @property
    def described(self) -> tuple[Any, ...]:
        """What `variable_of` takes."""
        return self.choices

    @property
    def coordinates(self) -> list[str]:
        """Names of the coordinates, one a choice."""
        texts = [str(choice) for choice in self.choices]
        if len(set(texts)) < len(texts):  # such as 1 and "1"
            texts = [f"{choice!r} ({i})" for i, choice in enumerate(self.choices)]
        return [f"{self.name}={text}" for text in texts]

    def place(self, value: Any) -> int:
        """Return the number of the choice that a value names; raises InputError where it names none."""
        for i, choice in enumerate(self.choices):
            if choice is value or (value == choice and isinstance(value, bool) == isinstance(choice, bool)):
                return i
        texts = [str(choice) for choice in self.choices]
        if isinstance(value, (str, int, float, np.generic)) and str(value) in texts:
            return texts.index(str(value))
        raise unknown_name(f"choice for '{self.name}'", value, texts)

    def checked(self, value: Any, what: str) -> Any:
        """Return the choice that a value names; raises InputError where it names none."""
        return self.choices[self.place(value)]

    def anywhere(self, value: Any, what: str) -> Any:
        """Return the choice that a value names; see `checked`."""
        return self.checked(value, what)


Variable = Number | Choice


def variable_of(name: Any, given: Any) -> Variable:
    """Return the variable that bounds, or choices, describe.

    Raises
    ------
    InputError
        If the name is no text, bounds are reversed, equal or not finite, or a description is not understood.

    Examples
    --------
    >>> variable_of("fingers", (2, 5, "int"))
    Number(name='fingers', low=2, high=5, step=1.0, log=False, integer=True)
    >>> variable_of("grip", ["pinch", "power"])
    Choice(name='grip', choices=('pinch', 'power'))
    """
    if not isinstance(name, str) or not name:
        raise InputError(f"variable name {name!r} is not a non-empty string; name each variable, such as 'dx'.")
    choices = [part for part in given if isinstance(part, str)] if isinstance(given, (list, tuple)) else []
    for text in (name, *choices):
        if _LONE.search(text):
            raise InputError(f"{text!r} of variable {name!r} holds half a character, which no file can; write it anew.")
    if isinstance(given, (Number, Choice)):
        return given
    try:
        parts = [part.item() if isinstance(part, np.generic) else part for part in given]
        if isinstance(given, (str, set, frozenset)) or len(parts) < 2:  # sets have no order
            raise TypeError
        chosen = all(isinstance(part, (str, bool)) for part in parts)
        lower, upper = (0.0, 0.0) if chosen else (float(parts[0]), float(parts[1]))
        words = parts[2:]
        if any(not isinstance(word, str) for word in words) and not chosen:
            raise TypeError
    except (TypeError, ValueError, OverflowError):
        shown = repr(given)
        shown = shown if len(shown) <= 80 else f"{shown[:77]}..."
        raise InputError(f"bounds of '{name}' are {shown}; {_FORM}.") from None
    return _choice(name, tuple(parts)) if chosen else _number(name, lower, upper, words)


def _choice(name: str, choices: tuple[Any, ...]) -> Choice:
    if len(set(choices)) < len(choices):
        raise InputError(f"choices of '{name}' are {choices!r}; each can be there once.")
    return Choice(name, choices)


def _number(name: str, lower: float, upper: float, words: list[str]) -> Number:
    if not (np.isfinite(lower) and np.isfinite(upper)):
        raise InputError(f"bounds of '{name}' are ({lower}, {upper}); both must be finite numbers.")
    if lower < upper and not np.isfinite(upper - lower):
        raise InputError(f"bounds of '{name}' are ({lower}, {upper}); they are too far apart for a computer's numbers.")
    if not lower < upper:
        raise InputError(
            f"bounds of '{name}' are ({lower}, {upper}); lower must be smaller than upper: swap or widen them."
        )
    options: dict[str, Any] = {}
    for word in words:
        option, _, value = word.partition("=")
        try:
            options[option] = float(value) if option == "step" else value == ""
        except ValueError:
            options[option] = False
        if option not in ("log", "int", "step") or not options[option] > 0.0:
            raise InputError(f"variable '{name}' is {word!r}; {_FORM}.")
    integer, log, step = "int" in options, "log" in options, options.get("step", 0.0)
    if log and lower <= 0.0:
        raise InputError(f"bounds of '{name}' are ({lower}, {upper}); a logarithmic variable is positive.")
    if step and log:
        raise InputError(f"variable '{name}' is logarithmic and has steps; leave one of the two out.")
    if integer:
        step = step or 1.0
        if not (lower.is_integer() and upper.is_integer() and step.is_integer()):
            raise InputError(f"variable '{name}' goes from {lower:g} to {upper:g} by {step:g}; give whole numbers.")
    if step:
        slack = 0.0 if integer else 1e-12  # steps such as 0.1 are rounded
        levels = np.floor((upper - lower) / step * (1.0 + slack))
        if levels < 1:
            raise InputError(f"variable '{name}' has steps of {step:g}, wider than its range; give smaller ones.")
        upper = lower + step * float(levels)
    if integer:
        return Number(name, int(lower), int(upper), step, log, True)
    return Number(name, lower, upper, step, log)


def _finite(name: str, value: Any, what: str, wanted: str) -> float:
    try:
        number = float("nan") if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if not isfinite(number):
        raise InputError(f"{what}: {name} is {str(value)[:60]!r}; give {wanted}.")
    return number

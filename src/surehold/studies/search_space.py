"""The parameters of a study: Optuna's distributions and the box in which the optimizer works.

    distribution                    coordinates of the box
    float                           the value
    float, log                      its natural logarithm
    float with step, integer        the value, in cells of equal width around each level
    integer, log                    the logarithm of the value, in cells that end halfway between the integers
    choice of k                     k coordinates in [0, 1], 1 for the choice that is taken (one-hot)

Parameters that can take one value only are left out of the box. Input noise is given in the units of the coordinates
(of a log parameter: the standard deviation of the logarithm, which is the relative deviation); choices carry none.
"""

import json
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
    distribution_to_json,
    json_to_distribution,
)

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.lattice import Lattice
from surehold.optimization.noise.input_noise import InputNoise, checked_input_noise

__all__ = ["SearchSpace"]
_LARGEST: Final = 1e100  # magnitude of a bound; what is computed with larger ones overflows


class _Numeric(NamedTuple):
    """One coordinate of a number."""

    name: str
    low: float
    high: float
    step: float
    """0 where every value of the range can be tried"""
    log: bool

    def bounds(self) -> tuple[float, float]:
        half = 0.5 * self.step
        lower, upper = self.to_coordinate(np.array([self.low - half, self.high + half])).tolist()
        return lower, upper

    def to_coordinate(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.log(values) if self.log else values

    def to_value(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest values that can be tried."""
        values = np.exp(coordinates) if self.log else coordinates
        if self.step:
            values = self.low + self.step * np.round((values - self.low) / self.step)
        return np.clip(values, self.low, self.high)


class SearchSpace:
    """Named parameters, and their map to a box.

    Parameters
    ----------
    parameters
        A `Box`, or `{name: (lower, upper)}`, or `{name: distribution}` of Optuna.

    Attributes
    ----------
    distributions : Optuna's distribution of each parameter
    box : Box, or None where every parameter can take one value only
    lattice : Lattice of the box, or None where all of the box can be tried

    Raises
    ------
    InputError
        If there is no parameter, or bounds are reversed or not finite.
    """

    def __init__(self, parameters: Box | Mapping[str, tuple[float, float] | BaseDistribution]):
        if isinstance(parameters, Box):
            parameters = {
                name: (float(lower), float(upper))
                for name, lower, upper in zip(parameters.names, parameters.lower, parameters.upper, strict=True)
            }
        if not isinstance(parameters, Mapping) or not parameters:
            raise InputError(f"search space is {parameters!r}; give a Box, or {{name: distribution}} of Optuna.")
        self.distributions: Final = {name: _distribution(name, value) for name, value in parameters.items()}
        self._numeric: list[tuple[int, _Numeric]] = []
        self._choices: list[tuple[int, str, CategoricalDistribution]] = []
        self._fixed: dict[str, Any] = {}
        bounds: dict[str, tuple[float, float]] = {}
        for name, distribution in self.distributions.items():
            if distribution.single():
                self._fixed[name] = _only_value(distribution)
            elif isinstance(distribution, CategoricalDistribution):
                self._choices.append((len(bounds), name, distribution))
                texts = [str(choice) for choice in distribution.choices]
                if len(set(texts)) < len(texts):  # such as 1 and "1"
                    texts = [f"{choice!r} ({i})" for i, choice in enumerate(distribution.choices)]
                bounds |= {f"{name}={text}": (0.0, 1.0) for text in texts}
            else:
                numeric = _numeric(name, distribution)
                self._numeric.append((len(bounds), numeric))
                bounds[name] = numeric.bounds()
        self.box: Final = Box(bounds) if bounds else None
        smooth = np.zeros(len(bounds), dtype=bool)
        for column, numeric in self._numeric:
            smooth[column] = not numeric.step
        self.lattice: Final = None if smooth.all() else Lattice(self._snap, smooth)

    @property
    def variables(self) -> int:
        """Number of parameters that can vary: a choice is one, however many coordinates it has."""
        return len(self._numeric) + len(self._choices)

    @property
    def numbers(self) -> Box | None:
        """The box of the parameters that are numbers and can vary: those that input noise is given for."""
        return Box({numeric.name: numeric.bounds() for _, numeric in self._numeric}) if self._numeric else None

    def encode(self, parameters: Mapping[str, Any]) -> NDArray[np.float64]:
        """Return the point (d,) of the box for parameters that are inside; see `check`."""
        return self.encode_all([parameters])[0]

    def encode_all(self, rows: list[Mapping[str, Any]], *, anywhere: bool = False) -> NDArray[np.float64]:
        """Return the points (n, d) of the box for n sets of parameters; `anywhere`: numbers may lie outside of it."""
        X = np.zeros((len(rows), 0 if self.box is None else self.box.dimension))
        for column, numeric in self._numeric:
            values = np.array([row[numeric.name] for row in rows], dtype=np.float64)
            X[:, column] = numeric.to_coordinate(values if anywhere else np.clip(values, numeric.low, numeric.high))
        for column, name, distribution in self._choices:
            taken = np.array([int(distribution.to_internal_repr(row[name])) for row in rows], dtype=np.intp)
            X[np.arange(len(rows)), column + taken] = 1.0
        return X

    def decode(self, x: NDArray[np.float64]) -> dict[str, Any]:
        """Return the parameters of the point x (d,) of the box: plain Python numbers, strings, ..."""
        found = dict(self._fixed)
        for column, numeric in self._numeric:
            value = float(numeric.to_value(x[column]))
            found[numeric.name] = round(value) if self._is_integer(numeric.name) else value
        for column, name, distribution in self._choices:
            k = len(distribution.choices)
            found[name] = distribution.choices[int(np.argmax(x[column : column + k]))]
        return {name: found[name] for name in self.distributions}

    def contains(self, parameters: Mapping[str, Any]) -> bool:
        """Tell whether stored parameters name all of this space, and lie inside it."""
        return all(
            name in parameters and _holds(distribution, parameters[name])
            for name, distribution in self.distributions.items()
        )

    def check(self, parameters: Mapping[str, Any], what: str = "parameters") -> dict[str, Any]:
        """Return the parameters in the order of this space, numbers given as text or integers converted.

        Raises
        ------
        InputError
            If one is missing, unknown, of the wrong kind, not finite or outside its range by more than the rounding of
            single precision.
        """
        if not isinstance(parameters, Mapping):
            raise InputError(f"{what} are {parameters!r}; give {{name: value}} for {', '.join(self.distributions)}.")
        for name in parameters:
            if name not in self.distributions:
                raise unknown_name("parameter", name, self.distributions)
        missing = [name for name in self.distributions if name not in parameters]
        if missing:
            raise InputError(f"{what} say nothing about {', '.join(missing)}; give a value for each parameter.")
        return {name: _checked(name, d, parameters[name], what) for name, d in self.distributions.items()}

    def check_reached(self, commanded: Mapping[str, Any], reached: Mapping[str, Any]) -> dict[str, Any]:
        """Return what a trial truly reached: the commanded parameters with those that differ, wherever they lie.

        A robot that strays may leave the ranges, and numbers that count in steps may lie between them.

        Raises
        ------
        InputError
            If a name is unknown, a number is not finite (of a logarithmic one: not positive), or a choice is none.
        """
        if not isinstance(reached, Mapping):
            raise InputError(f"reached is {reached!r}; give {{name: value}} for {', '.join(self.distributions)}.")
        found = dict(commanded)
        for name, value in reached.items():
            if name not in self.distributions:
                raise unknown_name("parameter", name, self.distributions)
            distribution = self.distributions[name]
            if isinstance(distribution, CategoricalDistribution):
                found[name] = _checked(name, distribution, value, "reached")
                continue
            number = _number(name, value, "reached", "a finite number")
            if abs(number) > _LARGEST or (number <= 0.0 and _numeric(name, distribution).log):
                raise InputError(f"reached: {name} is {value!r}; give a number that can be reached.")
            found[name] = round(number) if number.is_integer() and self._is_integer(name) else number
        return found

    def encodes(self, parameters: Mapping[str, Any]) -> bool:
        """Tell whether stored parameters name all of this space and have coordinates, inside the box or not."""
        try:
            given = {name: parameters[name] for name in self.distributions}
            return bool(np.isfinite(self.encode_all([self.check_reached(given, given)], anywhere=True)).all())
        except (InputError, KeyError, TypeError, ValueError):
            return False

    def input_noise(self, noise: InputNoise | None) -> InputNoise | None:
        """Return noise that was given for the numbers of this space as noise of its box, none on choices.

        Raises
        ------
        InputError
            If its names are not those of the numbers, or choices meet noise that is correlated or varies.
        """
        noise = checked_input_noise(noise, tuple(numeric.name for _, numeric in self._numeric))
        if noise is None or self.box is None or not self._choices:
            return noise
        numbers = self.numbers
        if numbers is None:
            raise InputError("input noise is given, but all parameters are choices, which carry none; leave it out.")
        if noise.varies:
            raise InputError("input noise varies from place to place, and some parameters are choices; give constants.")
        covariance = noise.unit_covariance(numbers)
        if np.any(covariance != np.diag(np.diag(covariance))):
            raise InputError("input noise is correlated, and some parameters are choices; give standard deviations.")
        deviations = dict.fromkeys(self.box.names, 0.0)
        deviations |= dict(zip(numbers.names, (np.sqrt(np.diag(covariance)) * numbers.widths).tolist(), strict=True))
        if noise.bounded:
            return InputNoise.uniform({name: 3.0**0.5 * deviation for name, deviation in deviations.items()})
        return InputNoise(deviations)

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as plain data."""
        return {name: json.loads(distribution_to_json(d)) for name, d in self.distributions.items()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "SearchSpace":
        """Return the space that `to_json` described."""
        return cls({name: json_to_distribution(json.dumps(described)) for name, described in data.items()})

    def _is_integer(self, name: str) -> bool:
        return isinstance(self.distributions[name], IntDistribution)

    def _snap(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        box = self.box
        if box is None:
            return U
        snapped = np.array(U, dtype=np.float64)
        for column, numeric in self._numeric:
            if numeric.step:
                low, width = box.lower[column], box.widths[column]
                value = numeric.to_value(low + U[..., column] * width)
                snapped[..., column] = (numeric.to_coordinate(value) - low) / width
        for column, _, distribution in self._choices:
            k = len(distribution.choices)
            taken = np.argmax(U[..., column : column + k], axis=-1)
            snapped[..., column : column + k] = np.arange(k) == taken[..., None]
        return snapped


def _distribution(name: str, value: Any) -> BaseDistribution:
    if isinstance(value, BaseDistribution):
        for limit in () if isinstance(value, CategoricalDistribution) else _numeric(name, value)[1:3]:
            if not abs(limit) <= _LARGEST:
                raise InputError(
                    f"parameter '{name}' has the bound {str(limit)[:20]}; bounds are finite numbers up to {_LARGEST:g}."
                )
        return value
    box = Box({name: value})
    return _distribution(name, FloatDistribution(float(box.lower[0]), float(box.upper[0])))


def _numeric(name: str, distribution: BaseDistribution) -> _Numeric:
    if isinstance(distribution, IntDistribution):
        return _Numeric(name, distribution.low, distribution.high, distribution.step, distribution.log)
    if isinstance(distribution, FloatDistribution):
        return _Numeric(name, distribution.low, distribution.high, distribution.step or 0.0, distribution.log)
    raise InputError(f"parameter '{name}' has the unknown distribution {distribution!r}.")


def _only_value(distribution: BaseDistribution) -> Any:
    if isinstance(distribution, CategoricalDistribution):
        return distribution.choices[0]
    return distribution.low  # type: ignore[attr-defined]


def _holds(distribution: BaseDistribution, value: Any) -> bool:
    try:
        return bool(distribution._contains(distribution.to_internal_repr(value)))
    except (TypeError, ValueError):
        return False


def _number(name: str, value: Any, what: str, wanted: str) -> float:
    try:
        number = float("nan") if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if not np.isfinite(number):
        raise InputError(f"{what}: {name} is {str(value)[:60]!r}; give {wanted}.")
    return number


def _checked(name: str, distribution: BaseDistribution, value: Any, what: str) -> Any:
    if isinstance(distribution, CategoricalDistribution):
        for choice in distribution.choices:
            if value == choice and isinstance(value, bool) == isinstance(choice, bool):
                return choice
        texts = {str(choice): choice for choice in distribution.choices}
        if isinstance(value, str) and value in texts:
            return texts[value]
        raise unknown_name(f"choice for '{name}'", value, texts)
    low, high, step, _ = _numeric(name, distribution)[1:]
    number = _number(name, value, what, f"a finite number between {low:g} and {high:g}")
    slack = 1e-9 * (high - low) + min(2.0**-23 * max(abs(low), abs(high)), 1e-3 * (high - low))  # as in Box.rounding
    if not low - slack <= number <= high + slack:
        raise InputError(f"{what}: {name} = {number:g} lies outside its range from {low:g} to {high:g}.")
    number = min(max(number, low), high)
    if step:
        level = low + step * round((number - low) / step)
        if abs(number - level) > 1e-6 * step:
            raise InputError(f"{what}: {name} = {number:g} is no level; it goes from {low:g} in steps of {step:g}.")
        number = level
    return round(number) if isinstance(distribution, IntDistribution) else number

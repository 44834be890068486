"""The parameters of a study: Optuna's distributions and the box in which the optimizer works.

Parameters that can take one value only are left out of the box; what the others are there says
`optimization.variables`.
"""

import json
import warnings
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any, Final

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
from surehold.optimization.trial_inputs import astray_in_words
from surehold.optimization.variables import Choice, Number, Variable

__all__ = ["SearchSpace"]
_LARGEST: Final = 1e100  # magnitude of a bound; what is computed with larger ones overflows


class SearchSpace:
    """Named parameters, and their map to a box.

    Parameters
    ----------
    parameters
        A `Box`, or `{name: (lower, upper)}` and whatever else a box takes, or `{name: distribution}` of Optuna.

    Attributes
    ----------
    distributions : Optuna's distribution of each parameter
    fixed : {name: value} of the parameters that can take one value only
    box : Box of the others, None where there are none

    Raises
    ------
    InputError
        If there is no parameter, bounds are reversed or not finite, two choices are equal, or a variable of the box is
        uncontrolled.
    """

    def __init__(self, parameters: Box | Mapping[str, Any]):
        if isinstance(parameters, Box):
            if parameters.uncontrolled is not None:
                raise InputError(
                    f"a study chooses all of its parameters, but of {parameters} some are not set by anybody; take a "
                    "surehold.Optimizer, which averages over them."
                )
            parameters = {variable.name: variable for variable in parameters.variables}
        if not isinstance(parameters, Mapping) or not parameters:
            raise InputError(f"search space is {parameters!r}; give a Box, or {{name: distribution}} of Optuna.")
        self.distributions: Final = {name: _distribution(name, value) for name, value in parameters.items()}
        self.fixed: Final[dict[str, Any]] = {}
        self._variables: dict[str, Variable] = {}
        for name, distribution in self.distributions.items():
            if distribution.single():
                self.fixed[name] = _only_value(distribution)
            self._variables[name] = _variable(name, distribution)
        varying = {name: variable for name, variable in self._variables.items() if name not in self.fixed}
        self.box: Final = Box(varying) if varying else None

    def encode_all(self, rows: Sequence[Mapping[str, Any]], *, anywhere: bool = False) -> NDArray[np.float64]:
        """Return the points (n, d) of the box for n sets of parameters; `anywhere`: numbers may lie outside of it."""
        if self.box is None:
            return np.zeros((len(rows), 0))
        found = self.box.encode([{v.name: row[v.name] for v in self.box.variables} for row in rows])
        return found if anywhere else np.clip(found, self.box.lower, self.box.upper)

    def encode(self, parameters: Mapping[str, Any]) -> NDArray[np.float64]:
        """Return the point (d,) of the box for parameters that are inside; see `check`."""
        return self.encode_all([parameters])[0]

    def decode(self, x: NDArray[np.float64]) -> dict[str, Any]:
        """Return the parameters of the point x (d,) of the box: plain Python numbers, strings, ..."""
        return self.complete({} if self.box is None else self.box.as_dict(x))

    def complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return parameters of the box with those that can take one value only, in the order of this space."""
        found = self.fixed | dict(parameters)
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
        return {name: variable.checked(parameters[name], what) for name, variable in self._variables.items()}

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
            found[name] = self._variables[name].anywhere(value, "reached")
        return found

    def warn_if_astray(self, reached: Mapping[str, Any], stacklevel: int) -> None:
        """Warn where what a trial reached, as `check_reached` returns it, lies far outside of the ranges.

        `stacklevel` is how far above the caller of this function the user's line is, which calls a method of a study.
        """
        if self.box is None:
            return
        U = self.box.to_unit(self.encode_all([reached], anywhere=True))
        if astray := astray_in_words(self.box, U):
            warnings.warn(astray, stacklevel=2 + stacklevel)

    def encodes(self, parameters: Mapping[str, Any]) -> bool:
        """Tell whether stored parameters name all of this space and have coordinates, inside the box or not."""
        try:
            given = {name: parameters[name] for name in self.distributions}
            return bool(np.isfinite(self.encode_all([self.check_reached(given, given)], anywhere=True)).all())
        except (InputError, KeyError, TypeError, ValueError):
            return False

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as plain data."""
        return {name: json.loads(distribution_to_json(d)) for name, d in self.distributions.items()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "SearchSpace":
        """Return the space that `to_json` described."""
        return cls({name: json_to_distribution(json.dumps(described)) for name, described in data.items()})


def _distribution(name: str, value: Any) -> BaseDistribution:
    if isinstance(value, BaseDistribution):
        for limit in (getattr(value, "low", 0.0), getattr(value, "high", 0.0)):
            if not abs(limit) <= _LARGEST:
                raise InputError(
                    f"parameter '{name}' has the bound {str(limit)[:20]}; bounds are finite numbers up to {_LARGEST:g}."
                )
        return value
    (variable,) = Box({name: value}).variables
    if isinstance(variable, Choice):
        return CategoricalDistribution(variable.choices)
    if variable.integer:
        return IntDistribution(int(variable.low), int(variable.high), log=variable.log, step=int(variable.step))
    high = variable.high
    if variable.step:  # as Optuna counts, in decimals: else it takes the last level for outside, and warns
        levels = round((high - variable.low) / variable.step)
        high = float(Decimal(str(variable.low)) + levels * Decimal(str(variable.step)))
    return _distribution(name, FloatDistribution(variable.low, high, log=variable.log, step=variable.step or None))


def _variable(name: str, distribution: BaseDistribution) -> Variable:
    if isinstance(distribution, CategoricalDistribution):
        _check_different(name, distribution)
        return Choice(name, tuple(distribution.choices))
    if isinstance(distribution, IntDistribution):
        return Number(name, distribution.low, distribution.high, distribution.step, distribution.log, True)
    if isinstance(distribution, FloatDistribution):
        return Number(name, distribution.low, distribution.high, distribution.step or 0.0, distribution.log)
    raise InputError(f"parameter '{name}' has the unknown distribution {distribution!r}.")


def _check_different(name: str, distribution: CategoricalDistribution) -> None:
    """Raise InputError where two choices are equal: trials of the second one are stored as of the first one."""
    for place, choice in enumerate(distribution.choices):
        first = int(distribution.to_internal_repr(choice))
        if first != place:
            raise InputError(
                f"parameter '{name}' has the choices {distribution.choices[first]!r} and {choice!r}, which are equal: "
                "Optuna stores both as the first one. Leave one out, or name them by texts."
            )


def _only_value(distribution: BaseDistribution) -> Any:
    if isinstance(distribution, CategoricalDistribution):
        return distribution.choices[0]
    return distribution.low  # type: ignore[attr-defined]


def _holds(distribution: BaseDistribution, value: Any) -> bool:
    try:
        return bool(distribution._contains(distribution.to_internal_repr(value)))
    except (TypeError, ValueError, OverflowError):
        return False

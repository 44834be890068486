"""Rules that are said of the variables of a box, kept in its coordinates.

They differ where a box is not plain: the coordinate of a logarithmic variable is its logarithm, and a choice has
several.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.constraints.linear import ROUNDING, Linear
from surehold.optimization.variables import Choice

__all__ = ["Rule", "of_coordinates"]

Rule = Linear | Callable[[Any], Any]


def of_coordinates(box: Box, rule: Rule) -> Rule:
    """Return a rule of the box's variables as a rule of its coordinates.

    A function takes x (d,), and of a box that is not plain {name: value}; a `Linear` weighs values in the variables'
    own units. Raises InputError where it weighs a choice among texts, or something unknown.
    """
    if box.plain:
        return rule
    if not isinstance(rule, Linear):
        return _Named(box, rule, getattr(rule, "__name__", "a function"))
    variables = {variable.name: variable for variable in box.variables}
    for name in rule.weights:
        if name not in variables:
            raise unknown_name("variable of a linear constraint", name, variables)
        if isinstance(variable := variables[name], Choice) and any(isinstance(c, str) for c in variable.choices):
            raise InputError(f"'{name}' is a choice among names, which a linear constraint cannot weigh; leave it out.")
    if not any(isinstance(v := variables[name], Choice) or v.log for name in rule.weights):
        return rule
    return _Named(box, partial(_holds, rule), str(rule))


class _Named:
    """A function of {name: value} as one of the point x (d,); a class, so that an optimizer can be pickled."""

    def __init__(self, box: Box, function: Callable[[Any], Any], name: str):
        self.__name__ = name
        self._box: Final = box
        self._function: Final = function

    def __call__(self, x: NDArray[np.float64]) -> Any:
        """Return what the function says of x."""
        return self._function(self._box.as_dict(x))


def _holds(rule: Linear, values: Mapping[str, Any]) -> bool:
    low = -np.inf if rule.lower is None else rule.lower
    high = np.inf if rule.upper is None else rule.upper
    parts = [weight * float(values[name]) for name, weight in rule.weights.items()]
    slack = ROUNDING * sum(map(abs, parts))
    return bool(low - slack <= sum(parts) <= high + slack)

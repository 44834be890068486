"""Rules that are said of the variables of a box, kept in its coordinates.

They differ where a box is not plain: the coordinate of a logarithmic variable is its logarithm, and a choice has
several.
"""

from collections.abc import Callable
from typing import Any

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
        function = rule

        def answers(x: NDArray[np.float64]) -> Any:
            return function(box.as_dict(x))

        answers.__name__ = getattr(rule, "__name__", "a function")
        return answers
    variables = {variable.name: variable for variable in box.variables}
    for name in rule.weights:
        if name not in variables:
            raise unknown_name("variable of a linear constraint", name, variables)
        if isinstance(variable := variables[name], Choice) and any(isinstance(c, str) for c in variable.choices):
            raise InputError(f"'{name}' is a choice among names, which a linear constraint cannot weigh; leave it out.")
    if not any(isinstance(v := variables[name], Choice) or v.log for name in rule.weights):
        return rule
    low = -np.inf if rule.lower is None else rule.lower
    high = np.inf if rule.upper is None else rule.upper

    def holds(x: NDArray[np.float64]) -> bool:
        values = box.as_dict(x)
        parts = [weight * float(values[name]) for name, weight in rule.weights.items()]
        slack = ROUNDING * sum(map(abs, parts))
        return bool(low - slack <= sum(parts) <= high + slack)

    holds.__name__ = str(rule)
    return holds

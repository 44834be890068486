"""Input constraints of a study: said in its parameters, kept in the coordinates of its box."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.constraints.input import Rule, checked_rules
from surehold.optimization.constraints.linear import Linear
from surehold.studies.search_space import SearchSpace

__all__ = ["allowed_in"]


def allowed_in(space: SearchSpace, allowed: Any) -> list[Rule] | None:
    """Return the rules of `Sampler(allowed=)` as rules of the space's box.

    A `Linear` constraint weighs parameters in their own units, logarithmic ones, integers and those with one value
    included. Raises InputError where it weighs a choice among names, or something unknown.
    """
    rules = checked_rules(allowed)
    return [_translated(space, rule) for rule in rules] or None


def _translated(space: SearchSpace, rule: Rule) -> Rule:
    if not isinstance(rule, Linear):
        function: Callable[[Any], Any] = rule
        return lambda x: function(space.decode(x))
    names = tuple(space.distributions)
    weights = rule.row(names)
    for name in rule.weights:
        if isinstance(_example(space, name), str):
            raise InputError(f"'{name}' is a choice among names, which a linear constraint cannot weigh; leave it out.")
    logarithmic = any(getattr(space.distributions[name], "log", False) for name in rule.weights)
    if space.box is not None and set(rule.weights) <= set(space.box.names) and not logarithmic:
        return rule
    low = -np.inf if rule.lower is None else rule.lower
    high = np.inf if rule.upper is None else rule.upper
    used = np.flatnonzero(weights)

    def holds(x: NDArray[np.float64]) -> bool:
        parameters = space.decode(x)
        total = sum(weights[k] * float(parameters[names[k]]) for k in used)
        slack = 1e-9 * sum(abs(weights[k] * float(parameters[names[k]])) for k in used)
        return bool(low - slack <= total <= high + slack)

    holds.__name__ = str(rule)
    return holds


def _example(space: SearchSpace, name: str) -> Any:
    return getattr(space.distributions[name], "choices", (0.0,))[0]

"""Input constraints of a study, whose functions take parameters by name, those that have one value only included."""

from collections.abc import Callable
from typing import Any

from surehold.optimization.constraints.by_name import Rule
from surehold.optimization.constraints.input import checked_rules
from surehold.optimization.constraints.linear import Linear
from surehold.studies.search_space import SearchSpace

__all__ = ["allowed_in"]


def allowed_in(space: SearchSpace, allowed: Any) -> list[Rule] | None:
    """Return the rules of `Sampler(allowed=)` as rules of the space's box."""
    return [_of_box(space, rule) for rule in checked_rules(allowed)] or None


def _of_box(space: SearchSpace, rule: Rule) -> Rule:
    if not isinstance(rule, Linear):
        function: Callable[[dict[str, Any]], Any] = rule

        def answers(x: Any) -> Any:
            return function(space.complete(x if isinstance(x, dict) else space.decode(x)))

        answers.__name__ = getattr(rule, "__name__", "a function")
        return answers
    held = {name: value for name, value in space.fixed.items() if name in rule.weights}
    constant = sum(rule.weights[name] * float(value) for name, value in held.items())
    rest = {name: weight for name, weight in rule.weights.items() if name not in held}
    lower, upper = (None if limit is None else limit - constant for limit in (rule.lower, rule.upper))
    return Linear(rest, lower=lower, upper=upper) if held else rule

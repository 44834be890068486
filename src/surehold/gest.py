"""surehold as a generator of gest-api: for Xopt, optimas, libEnsemble and whatever else speaks it.

gest-api describes a problem as VOCS: variables, objectives, constraints, constants and observables. One objective is
optimized; limits of constraints are kept with a probability; observables are read by nobody.
"""

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.extras import require
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer, check_settings
from surehold.optimization.points import numbers_of
from surehold.optimization.recommendation import Recommendation
from surehold.optimization.trial_inputs import trial_input
from surehold.optimization.trials import AskedTrial
from surehold.optimization.values import LARGEST, LARGEST_SQUARED

try:
    from gest_api.generator import Generator
    from gest_api.vocs import (
        VOCS,
        BoundsConstraint,
        ContinuousVariable,
        DiscreteVariable,
        ExploreObjective,
        GreaterThanConstraint,
        MaximizeObjective,
    )
except ImportError:
    require("gest", "surehold.gest")
    raise

__all__ = ["RobustGenerator"]


class RobustGenerator(Generator):
    """Suggests the trials after which `recommend` knows what still holds when the input is off.

    Parameters
    ----------
    vocs
        One objective, to be minimized or maximized. Continuous variables have finite domains; the values of a discrete
        one are choices without an order. Constraints are limits of further outputs, kept by the answer with the
        probability `feasible` of `Optimizer`. Contextual variables are refused.
    input_noise
        As in `Optimizer`, in the variables' units; `InputNoise.unit(0.03)` is 3 % of every range.
    seed
        Non-negative integer.
    **settings
        Of `Optimizer`: surrogate, criterion, n_initial, risk, noise, noise_while_exploring, ...; trials tell values.

    Attributes
    ----------
    optimizer : Optimizer
        Holds all trials and the model.

    Raises
    ------
    InputError
        For such variables, several objectives or none, and bad settings.

    Examples
    --------
    >>> from gest_api.vocs import VOCS
    >>> vocs = VOCS(variables={"x": [0.0, 1.0]}, objectives={"f": "MINIMIZE"})
    >>> generator = RobustGenerator(vocs, input_noise=InputNoise.unit(0.03))
    >>> for point in generator.suggest(3):
    ...     generator.ingest([{**point, "f": (point["x"] - 0.4) ** 2}])
    >>> generator.optimizer.recommend().n
    3
    """

    returns_id = True

    def __init__(self, vocs: VOCS, *, input_noise: InputNoise | None = None, seed: int = 0, **settings: Any):
        super().__init__(vocs)
        check_settings(settings)
        if "direction" in settings or "constraints" in settings:
            raise InputError("direction and constraints of a generator are those of its vocs; leave them out.")
        if settings.get("outcome", "value") != "value" or settings.get("noise") == "told":
            raise InputError(
                "points of a generator tell a value alone: take a surehold.Optimizer where trials succeed or fail, are "
                "compared, or tell their noise."
            )
        self.vocs: Final = vocs
        ((self._objective, objective),) = vocs.objectives.items()
        self._values = {
            name: {str(value): value for value in sorted(variable.values, key=str)}
            for name, variable in vocs.variables.items()
            if isinstance(variable, DiscreteVariable)
        }
        self.optimizer: Final = Optimizer(
            Box({name: self._bounds(name) for name in vocs.variables}),
            direction="maximize" if isinstance(objective, MaximizeObjective) else "minimize",
            input_noise=input_noise,
            seed=seed,
            constraints={name: _limits(constraint) for name, constraint in vocs.constraints.items()} or None,
            **settings,
        )
        self._asked: dict[int, AskedTrial] = {}

    def _validate_vocs(self, vocs: VOCS) -> None:
        if len(vocs.objectives) != 1 or isinstance(next(iter(vocs.objectives.values())), ExploreObjective):
            named = ", ".join(vocs.objectives) or "none"
            raise InputError(f"objectives are {named}; give one, to be minimized or maximized.")
        for name, variable in vocs.variables.items():
            if isinstance(variable, DiscreteVariable):
                continue
            if not isinstance(variable, ContinuousVariable) or not np.isfinite(variable.domain).all():
                raise InputError(f"variable '{name}' has no finite domain; give it one, or make it a constant.")

    def suggest(self, num_points: int | None = None) -> list[dict[str, Any]]:
        """Return the next points, one where `num_points` is None; each holds constants and an `_id`."""
        points = []
        for trial in self.optimizer.ask_trial(1 if num_points is None else num_points):
            self._asked[trial.number] = trial
            constants = {name: constant.value for name, constant in self.vocs.constants.items()}
            points.append({**self._variables(trial.parameters), **constants, "_id": trial.number})
        return points

    def ingest(self, results: list[dict[str, Any]]) -> None:
        """Learn from points that were evaluated, whether they were suggested or not: from all of them, or from none.

        An objective that is missing or no finite number is a failed trial. Raises InputError for an `_id` that is not
        under way or there twice, for a point that lacks a variable or a constraint, and for what is no number.
        """
        trials = [self._read(result) for result in results]
        numbers = [place.number for place, _ in trials if isinstance(place, AskedTrial)]
        if len(set(numbers)) < len(numbers):
            raise InputError(f"points {numbers} hold an _id twice; a suggested point is evaluated once.")
        for place, told in trials:
            self.optimizer.tell(place, **told)
            if isinstance(place, AskedTrial):
                del self._asked[place.number]

    def _read(self, result: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Return where a point was evaluated, and what is to be told of it."""
        number = result.get("_id")
        if number is None or (isinstance(number, float) and math.isnan(number)):
            place: Any = self._place(result)
        elif number in self._asked:
            place = self._asked[number]
        else:
            raise InputError(f"point {number!r} is not under way; leave _id out of points that others suggested.")
        value = self._number(result, self._objective)
        if not abs(value) <= LARGEST:
            return place, {"failed": True}
        names = list(self.vocs.constraints)
        if missing := [name for name in names if result.get(name) is None]:
            raise InputError(f"point {number!r} lacks {', '.join(missing)}; give every constraint its value.")
        measured = {name: self._number(result, name) for name in names}
        outputs = {name: number if abs(number) <= LARGEST_SQUARED else None for name, number in measured.items()}
        return place, {"y": value, "constraints": outputs or None}

    def _place(self, result: dict[str, Any]) -> dict[str, Any]:
        """Return the variables of a point that others suggested; they are checked as the optimizer does."""
        box = self.optimizer.box
        if missing := [name for name in self.vocs.variables if name not in result]:
            raise InputError(f"a point without _id lacks {', '.join(missing)}; give every variable its value.")
        place = {name: self._told(name, result[name]) for name in self.vocs.variables}
        if np.any(np.abs(trial_input(box, "point", place) - 0.5) > 0.5):
            raise InputError(f"point {place} lies outside {box}; give points of the domains.")
        return place

    @staticmethod
    def _number(result: dict[str, Any], name: str) -> float:
        """Return the number of that name in a point, NaN where there is none."""
        value = result.get(name)
        try:
            return math.nan if value is None else float(numbers_of(value).reshape(()))
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"{name} is {value!r}; give one number, or None for a trial that gave nothing.") from None

    def recommend(self) -> Recommendation:
        """Return the answer so far, its parameters as values of the vocs; see `Optimizer.recommend`."""
        answer = self.optimizer.recommend()
        return replace(answer, parameters=self._variables(answer.parameters))

    def _bounds(self, name: str) -> Any:
        if name in self._values:
            return list(self._values[name])
        lower, upper = self.vocs.variables[name].domain
        return lower, upper

    def _variables(self, parameters: dict[str, Any]) -> dict[str, Any]:
        """Return parameters of the box as values of the vocs."""
        return {
            name: self._values[name][value] if name in self._values else value for name, value in parameters.items()
        }

    def _told(self, name: str, value: Any) -> Any:
        if name not in self._values:
            return value
        return next((text for text, known in self._values[name].items() if known == value), str(value))


def _limits(constraint: Any) -> tuple[float | None, float | None]:
    if isinstance(constraint, BoundsConstraint):
        return constraint.range[0], constraint.range[1]
    if isinstance(constraint, GreaterThanConstraint):
        return constraint.value, None
    return None, constraint.value

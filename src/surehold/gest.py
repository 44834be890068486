"""surehold as a generator of gest-api: for Xopt, optimas, libEnsemble and whatever else speaks it.

gest-api describes a problem as VOCS: variables, objectives, constraints, constants and observables. One objective is
optimized; limits of constraints are kept with a probability; observables are read by nobody.
"""

import math
from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.extras import require
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.recommendation import Recommendation
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
        Of `Optimizer`: surrogate, criterion, n_initial, risk, noise, noise_while_exploring, ...

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
        if "direction" in settings or "constraints" in settings:
            raise InputError("direction and constraints of a generator are those of its vocs; leave them out.")
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
            variables = {
                name: self._values[name][value] if name in self._values else value
                for name, value in trial.parameters.items()
            }
            points.append({**variables, **constants, "_id": trial.number})
        return points

    def ingest(self, results: list[dict[str, Any]]) -> None:
        """Learn from points that were evaluated, whether they were suggested or not.

        An objective that is missing or no finite number is a failed trial. Raises InputError for an `_id` that is not
        under way, and for a constraint that is missing.
        """
        for result in results:
            number = result.get("_id")
            if number is None or (isinstance(number, float) and math.isnan(number)):
                place: Any = {name: self._told(name, result[name]) for name in self.vocs.variables}
            elif number in self._asked:
                place = self._asked[number]
            else:
                raise InputError(f"point {number!r} is not under way; leave _id out of points that others suggested.")
            value = result.get(self._objective)
            if value is None or not abs(value) <= LARGEST:
                self.optimizer.tell(place, failed=True)
            else:
                names = list(self.vocs.constraints)
                if missing := [name for name in names if result.get(name) is None]:
                    raise InputError(f"point {number!r} lacks {', '.join(missing)}; give every constraint its value.")
                told = {name: result[name] if abs(result[name]) <= LARGEST_SQUARED else None for name in names}
                self.optimizer.tell(place, float(value), constraints=told or None)
            if isinstance(place, AskedTrial):
                del self._asked[place.number]

    def recommend(self) -> Recommendation:
        """Return the answer so far; see `Optimizer.recommend`."""
        return self.optimizer.recommend()

    def _bounds(self, name: str) -> Any:
        if name in self._values:
            return list(self._values[name])
        lower, upper = self.vocs.variables[name].domain
        return lower, upper

    def _told(self, name: str, value: Any) -> Any:
        return str(value) if name in self._values else value


def _limits(constraint: Any) -> tuple[float | None, float | None]:
    if isinstance(constraint, BoundsConstraint):
        return constraint.range[0], constraint.range[1]
    if isinstance(constraint, GreaterThanConstraint):
        return constraint.value, None
    return None, constraint.value

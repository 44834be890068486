"""An algorithm for pymoo (tested with 0.6.2): `python examples/pymoo_algorithm.py`.

One objective, which pymoo minimizes; real variables with bounds; no constraints.
"""

from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population
from pymoo.core.problem import ElementwiseProblem
from pymoo.optimize import minimize

import surehold as sh


class RobustAlgorithm(Algorithm):
    """Asks for trials after which `optimizer.recommend()` knows what still holds when the variables are off."""

    def __init__(self, input_noise: sh.InputNoise, settings: dict[str, Any] | None = None, **of_pymoo: Any):
        super().__init__(**of_pymoo)
        self.input_noise, self.settings = input_noise, settings or {}

    def _setup(self, problem: Any, **kwargs: Any) -> None:
        if problem.n_obj != 1 or problem.n_constr:
            raise ValueError("RobustAlgorithm takes one objective without constraints.")
        bounds = zip(*problem.bounds(), strict=True)
        box = sh.Box({f"x{i + 1}": (float(low), float(high)) for i, (low, high) in enumerate(bounds)})
        self.optimizer = sh.Optimizer(box, direction="minimize", input_noise=self.input_noise, **self.settings)

    def _initialize_infill(self) -> Population:
        return self._infill()

    def _infill(self) -> Population:
        self._asked = self.optimizer.ask_trial()
        return Population.new("X", self._asked.x[None, :])

    def _initialize_advance(self, infills: Population | None = None, **kwargs: Any) -> None:
        self._advance(infills)

    def _advance(self, infills: Population | None = None, **kwargs: Any) -> None:
        value = float(infills[0].F[0])
        if np.isfinite(value):
            self.optimizer.tell(self._asked, value)
        else:
            self.optimizer.tell(self._asked, failed=True)
        self.pop = infills if self.pop is None else Population.merge(self.pop, infills)


class Peaks(ElementwiseProblem):
    """The mixture of Gaussians of the published experiments, turned over."""

    def __init__(self) -> None:
        self.peaks = sh.problems.GM()
        super().__init__(n_var=2, n_obj=1, xl=self.peaks.box.lower, xu=self.peaks.box.upper)

    def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = -float(self.peaks(x))


def run(n: int) -> tuple[sh.Recommendation, np.ndarray]:
    """Run n evaluations of pymoo's own loop; return what holds, and the lowest that was observed."""
    algorithm = RobustAlgorithm(sh.InputNoise.unit(0.1), {"seed": 2})
    result = minimize(Peaks(), algorithm, ("n_eval", n))
    return result.algorithm.optimizer.recommend(), result.X


if __name__ == "__main__":
    answer, lowest = run(50)
    print("lowest observed:", lowest)
    print("holds when the variables are off:", answer.x)

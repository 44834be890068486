"""A generation node for Ax (tested with 1.3): `python examples/ax_generation_node.py`.

Ax hands over the experiment before every trial; the optimizer is rebuilt from it, which is all that `ask` depends on.
Range parameters, linear in scale or logarithmic, integer or not; linear parameter constraints; one objective.
"""

from typing import Any

import numpy as np
from ax.api.client import Client
from ax.api.configs import RangeParameterConfig
from ax.core.data import Data
from ax.core.experiment import Experiment
from ax.core.parameter import ParameterType, RangeParameter
from ax.core.trial_status import TrialStatus
from ax.core.types import TParameterization
from ax.generation_strategy.external_generation_node import ExternalGenerationNode
from ax.generation_strategy.generation_strategy import GenerationStrategy

import surehold as sh


class RobustNode(ExternalGenerationNode):
    """Generates trials after which `answer` knows what still holds when the parameters are off.

    A failed trial is a place that gave nothing, an abandoned one says nothing of its place.

    Parameters
    ----------
    input_noise, settings
        As in `surehold.Optimizer`.
    """

    def __init__(self, input_noise: sh.InputNoise | None = None, **settings: Any):
        # Under input noise a place may be worth a second trial, and asked again without news it is the same.
        super().__init__(name="surehold", should_deduplicate=False)
        self.input_noise, self.settings = input_noise, settings

    def update_generator_state(self, experiment: Experiment, data: Data) -> None:
        """Take over parameters, objective and all trials that ended."""
        if experiment.optimization_config is None or experiment.optimization_config.all_constraints:
            raise ValueError("RobustNode takes an objective without outcome constraints.")
        objective = experiment.optimization_config.objective
        if not objective.is_single_objective:
            raise ValueError(f"RobustNode takes one metric as objective, not {objective.expression}.")
        (metric,) = objective.metric_names
        measured = data.df[data.df["metric_name"] == metric].set_index("trial_index")["mean"]
        self.box = sh.Box({name: _bounds(name, given) for name, given in experiment.search_space.parameters.items()})
        self.fixed = {
            "direction": "minimize" if objective.minimize else "maximize",
            "allowed": [
                sh.Linear(constraint.constraint_dict, upper=constraint.bound)
                for constraint in experiment.search_space.parameter_constraints
            ]
            or None,
        }
        self.told: list[tuple[TParameterization, float]] = []
        self.abandoned: list[TParameterization] = []
        for index, trial in experiment.trials.items():
            for arm in trial.arms:
                if trial.status == TrialStatus.ABANDONED:
                    self.abandoned.append(arm.parameters)
                elif trial.status == TrialStatus.FAILED:
                    self.told.append((arm.parameters, np.nan))
                elif index in measured.index:
                    self.told.append((arm.parameters, float(measured[index])))

    def get_next_candidate(self, pending_parameters: list[TParameterization]) -> TParameterization:
        """Return the parameters of the next trial."""
        waiting = [place for place in pending_parameters if place not in self.abandoned]
        return self.optimizer(waiting).ask_trial().parameters

    def answer(self, experiment: Experiment) -> sh.Recommendation:
        """Return the setting that holds, by all trials of the experiment that ended."""
        self.update_generator_state(experiment, experiment.lookup_data())
        return self.optimizer([]).recommend()

    def optimizer(self, waiting: list[TParameterization]) -> sh.Optimizer:
        """Return an optimizer that was told all trials that ended, and of those under way."""
        optimizer = sh.Optimizer(self.box, input_noise=self.input_noise, **self.fixed, **self.settings)
        X = self.box.encode([place for place, _ in self.told])
        optimizer.restore(X, [value for _, value in self.told], pending=self.box.encode(waiting))
        return optimizer


def _bounds(name: str, parameter: Any) -> tuple[Any, ...]:
    if not isinstance(parameter, RangeParameter) or parameter.logit_scale:
        raise ValueError(f"parameter '{name}' is {parameter}; RobustNode takes ranges, linear or logarithmic.")
    words = ["log"] * parameter.log_scale + ["int"] * (parameter.parameter_type == ParameterType.INT)
    return parameter.lower, parameter.upper, *words


def run(n: int) -> tuple[sh.Recommendation, np.ndarray]:
    """Run n trials of Ax's own loop; return what holds, and the highest that was observed."""
    f = sh.problems.GM()
    limits = zip(f.box.names, f.box.lower, f.box.upper, strict=True)
    client = Client()
    client.configure_experiment(
        [RangeParameterConfig(name=name, bounds=(float(a), float(b)), parameter_type="float") for name, a, b in limits]
    )
    client.configure_optimization(objective="value")
    node = RobustNode(sh.InputNoise.unit(0.1), seed=2)
    client.set_generation_strategy(GenerationStrategy(nodes=[node]))
    for _ in range(n):
        for index, place in client.get_next_trials(max_trials=1).items():
            client.complete_trial(index, {"value": float(f([place[name] for name in f.box.names]))})
    highest, *_ = client.get_best_parameterization(use_model_predictions=False)
    return node.answer(client._experiment), np.array([highest[name] for name in f.box.names])


if __name__ == "__main__":
    answer, highest = run(50)
    print("highest observed:", highest)
    print("holds when the parameters are off:", answer.x)

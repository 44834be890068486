"""What the generation node takes over from an experiment of Ax: parameters, direction, constraints, failures."""

import numpy as np
import pytest

import surehold as sh

pytest.importorskip("ax")
pytestmark = pytest.mark.filterwarnings("ignore")  # of Ax and what it imports

from ax.api.client import Client  # noqa: E402
from ax.api.configs import ChoiceParameterConfig, RangeParameterConfig  # noqa: E402
from ax.generation_strategy.generation_strategy import GenerationStrategy  # noqa: E402

from .test_other_loops import example  # noqa: E402

PARAMETERS = [
    RangeParameterConfig(name="x", bounds=(0.0, 1.0), parameter_type="float"),
    RangeParameterConfig(name="y", bounds=(0.0, 1.0), parameter_type="float"),
    RangeParameterConfig(name="force", bounds=(0.1, 10.0), parameter_type="float", scaling="log"),
    RangeParameterConfig(name="turns", bounds=(1, 5), parameter_type="int"),
]


def client_and_node(parameters=PARAMETERS, objective="-loss", **experiment):
    client = Client()
    client.configure_experiment(parameters, **experiment)
    client.configure_optimization(objective=objective)
    node = example("ax_generation_node").RobustNode(
        sh.InputNoise({"x": 0.05, "y": 0.05, "force": 0.0, "turns": 0.0}), n_initial=6, seed=0
    )
    client.set_generation_strategy(GenerationStrategy(nodes=[node]))
    return client, node


def loss(place):
    return (place["x"] - 0.3) ** 2 + (place["y"] - 0.3) ** 2 + np.log10(place["force"]) ** 2 + (place["turns"] - 3) ** 2


def test_a_loss_falls_within_the_constraint_over_all_kinds_of_ranges():
    client, node = client_and_node(parameter_constraints=["x + y <= 0.4"])
    for _ in range(7):
        for index, place in client.get_next_trials(max_trials=3).items():
            assert place["x"] + place["y"] <= 0.4 + 1e-6
            client.complete_trial(index, {"loss": loss(place)})
    best = node.answer(client._experiment).parameters
    assert best["turns"] == 3
    assert loss(best) < 0.1


def test_trials_under_way_are_kept_away_from_and_failures_are_told_apart():
    client, node = client_and_node()
    trials = client.get_next_trials(max_trials=3)
    assert len({tuple(place.values()) for place in trials.values()}) == 3
    client.mark_trial_failed(0)
    client.mark_trial_abandoned(1)
    client.complete_trial(2, {"loss": 1.0})
    client.get_next_trials(max_trials=1)
    assert [value for _, value in node.told] == [pytest.approx(np.nan, nan_ok=True), 1.0]
    assert [place for place, _ in node.told] == [trials[0], trials[2]]
    assert node.abandoned == [trials[1]]


def test_what_it_does_not_take_is_named():
    grip = ChoiceParameterConfig(name="grip", values=["pinch", "power"], parameter_type="str")
    client, _ = client_and_node([*PARAMETERS, grip])
    with pytest.raises(ValueError, match="'grip'"):
        client.get_next_trials(max_trials=1)
    client, _ = client_and_node(objective="gain, -loss")
    with pytest.raises(ValueError, match="one metric"):
        client.get_next_trials(max_trials=1)

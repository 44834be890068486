"""What a study's trials say, and what is damaged in them."""

import numpy as np
import optuna
import pytest
from optuna.distributions import FloatDistribution
from optuna.trial import FrozenTrial, create_trial

import surehold as sh
from surehold.errors import InputError
from surehold.studies.history import EXECUTIONS, OUTPUTS, REACHED, history_of
from surehold.studies.search_space import SearchSpace
from surehold.studies.warm_start import trials_of_study

SPACE = SearchSpace(sh.Box({"x": (0.0, 2.0)}))


def trial(number: int, x: float, value: float = 0.5, **attributes) -> FrozenTrial:
    made = create_trial(
        value=value, params={"x": x}, distributions={"x": FloatDistribution(0.0, 2.0)}, user_attrs=attributes
    )
    made.number = number
    return made


def test_trials_come_in_the_order_of_their_numbers_with_what_was_measured():
    told = [
        trial(4, 1.0, 0.7, **{OUTPUTS: {"torque": 2.0}, EXECUTIONS: 10}),
        trial(1, 0.5, 0.1, **{REACHED: {"x": 2.2}}),
    ]
    history = history_of(told, SPACE, outputs=["torque"])
    assert history.numbers.tolist() == [1, 4]
    assert history.y.tolist() == [0.1, 0.7]
    np.testing.assert_allclose(history.X[:, 0], [0.5, 1.0])
    np.testing.assert_allclose(history.reached[:, 0], [2.2, 1.0])
    np.testing.assert_array_equal(history.outputs, [[np.nan], [2.0]])
    assert history.executions.tolist() == [1, 10]


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("values", "ab"),
        ("values", {"a": 1}),
        ("values", [[]]),
        ("user_attrs", {REACHED: "left"}),
        ("user_attrs", {OUTPUTS: [0.3]}),
        ("user_attrs", []),
        ("system_attrs", {"retry_history": 3}),
        ("system_attrs", {"retry_history": [[]]}),
    ],
)
def test_a_damaged_trial_is_named(attribute, value):
    damaged = trial(3, 1.0)
    object.__setattr__(damaged, f"_{attribute}", value)
    with pytest.raises(InputError, match=r"trial 3 of the study is damaged \(.+\); restore a copy"):
        history_of([trial(0, 0.3), damaged], SPACE, outputs=["torque"])


def test_pruned_trials_are_taken_over_as_they_are_read():
    """Of a study made by Optuna's own means: told where they have a value, failed where they have none."""
    study = optuna.create_study()
    study.optimize(pruned, n_trials=3)
    history = history_of(study.get_trials(), SPACE)
    found = trials_of_study(study, {"x": "x"}, "minimize")
    assert [trial.value for trial in found] == [None, 1.0, 2.0]
    np.testing.assert_array_equal(history.y, [np.nan, 1.0, 2.0])
    assert [trial.failed for trial in found] == [True, False, False]


def pruned(trial):
    trial.suggest_float("x", 0.0, 2.0)
    if trial.number == 1:
        trial.report(1.0, 0)
    if trial.number < 2:
        raise optuna.TrialPruned
    return 2.0

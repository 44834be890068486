"""Which place of the initial design is asked for next, beside trials that were told from elsewhere."""

import numpy as np
import pytest

import surehold as sh

FIRST = [[0.2], [0.8]]


def optimizer(**settings):
    return sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), initial_points=FIRST, n_initial=4, seed=0, **settings)


def test_a_trial_told_before_the_first_ask_takes_no_initial_point_away():
    warm = optimizer()
    warm.tell([0.5], 0.7)
    assert [warm.ask()[0] for _ in range(2)] == [0.2, 0.8]


def test_nor_do_restored_ones_and_those_told_between():
    warm = optimizer()
    warm.restore([[0.5]], [0.7])
    warm.tell(warm.ask(), 0.1)
    warm.tell([0.6], 0.8)
    assert warm.ask() == pytest.approx([0.8])


def test_numbered_trials_go_on_with_the_design_after_told_ones_however_many_are_under_way():
    plain = [optimizer().ask(number=number)[0] for number in range(4)]
    warm = optimizer()
    warm.restore([[0.5], [0.6]], [0.7, 0.8], numbers=[0, 3])
    asked = [warm.ask(number=number)[0] for number in (1, 2)]
    assert asked == plain[:2] == [0.2, 0.8]
    later = optimizer()  # another worker, that sees neither of the two
    later.restore([[0.5], [0.6]], [0.7, 0.8], numbers=[0, 3])
    assert later.ask(number=2)[0] == 0.8


def test_a_place_of_the_design_is_the_same_whatever_the_uncontrolled_conditions_were():
    box = sh.Box({"x": (0.0, 1.0)}, uncontrolled={"t": np.linspace(0.0, 1.0, 11)})
    free = sh.Optimizer(box, n_initial=4, seed=0)
    asked = []
    for k in range(4):
        trial = free.ask_trial()
        asked.append(trial.parameters["x"])
        free.tell(trial, float(k), reached={**trial.parameters, "t": 0.1 * k})
    assert len(set(asked)) == 4


@pytest.mark.parametrize(
    "settings",
    [{}, {"input_noise": sh.InputNoise.unit(0.03), "risk": "worst"}, {"preset": "thesis"}],
    ids=["exact", "worst", "thesis"],
)
def test_trials_under_way_at_the_same_time_are_at_different_places(settings):
    told = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), seed=0, **settings)
    for _ in range(14):
        x = told.ask()
        told.tell(x, -((x[0] - 0.3) ** 2))
    assert np.diff(np.sort(told.ask(6).ravel())).min() >= 1e-3


def test_where_every_place_is_under_way_noisy_ones_are_asked_for_again():
    few = sh.Optimizer(sh.Box({"grip": ["pinch", "power"]}), noise=0.1, n_initial=2, seed=0)
    for _ in range(4):
        trial = few.ask_trial()
        few.tell(trial, float(trial.parameters["grip"] == "pinch"))
    assert {trial.parameters["grip"] for trial in few.ask_trial(4)} <= {"pinch", "power"}


def test_of_several_trials_asked_for_all_are_or_none():
    stopped = []

    def allowed(x):
        if stopped and len(search.pending) == 2:
            raise KeyboardInterrupt
        return True

    box, always = sh.Box({"x": (0.0, 1.0)}), lambda x: True
    search, other = (sh.Optimizer(box, n_initial=2, seed=0, allowed=rule) for rule in (allowed, always))
    for x in np.linspace(0.1, 0.9, 4):
        for one in (search, other):
            one.tell([x], float(x))
    stopped.append(True)
    with pytest.raises(KeyboardInterrupt):
        search.ask(3)
    assert len(search.pending) == 0
    stopped.clear()
    np.testing.assert_array_equal(search.ask(3), other.ask(3))

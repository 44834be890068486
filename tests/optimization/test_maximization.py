import numpy as np
import pytest

from surehold.errors import InputError, SureholdError
from surehold.optimization.box import Box
from surehold.optimization.maximization import maximize
from surehold.optimization.noise.input_noise import InputNoise

BOX = Box({"x": (-1.0, 2.0)})


def parabola(x):
    return float(-((x[0] - 0.5) ** 2))


def test_finds_the_maximum_and_reports_every_trial():
    seen = []
    result = maximize(parabola, BOX, n_trials=12, seed=0, callback=seen.append)
    assert result.recommendation.x[0] == pytest.approx(0.5, abs=0.01)
    assert len(result.trials) == len(seen) == 12
    assert [trial.index for trial in seen] == list(range(12))
    np.testing.assert_allclose([trial.y for trial in seen], result.y)
    np.testing.assert_allclose([trial.x for trial in seen], result.X)
    np.testing.assert_allclose([trial.best for trial in seen], np.maximum.accumulate(result.y))
    assert seen[0].recommendation is None
    assert seen[-1].recommendation == result.recommendation
    assert result.best_index == int(np.argmax(result.y))
    assert not result.interrupted


def test_a_function_that_raises_is_a_failed_trial():
    def moody(x):
        if x[0] < 0.0:
            raise ZeroDivisionError("no grip")
        return parabola(x)

    result = maximize(moody, BOX, n_trials=15, n_initial=8, seed=1)
    failed = [trial for trial in result.trials if trial.failure]
    assert failed
    assert all(trial.failure == "ZeroDivisionError: no grip" for trial in failed)
    assert all(np.isnan(trial.y) and trial.x[0] < 0.0 for trial in failed)
    assert result.recommendation.x[0] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.nan, "nan"),
        (np.inf, "inf"),
        ([1.0, 2.0], r"shape \(2,\)"),
        ("good", "ValueError"),
        (None, "returned None.*lack a return"),
        (np.ma.masked, "masked"),
    ],
)
def test_all_failed(value, words):
    calls = []

    def failing(x):
        calls.append(x)
        return value

    with pytest.raises(SureholdError, match=f"the first 3 trials failed.*{words}.*tolerate_failures=True"):
        maximize(failing, BOX, n_trials=6)
    assert len(calls) == 3
    with pytest.raises(SureholdError, match=f"all 6 trials failed.*{words}"):
        maximize(failing, BOX, n_trials=6, tolerate_failures=True)
    assert len(calls) == 9


def test_one_number_in_an_array_is_a_number():
    assert maximize(lambda x: np.array([parabola(x)]), BOX, n_trials=6).y.shape == (6,)


def test_the_function_cannot_change_the_trial():
    def careless(x):
        x[:] = 0.0
        return 1.0

    result = maximize(careless, BOX, n_trials=6)
    assert len(np.unique(result.X)) == 6


@pytest.mark.parametrize("after", [3, 8])
def test_ctrl_c_keeps_what_was_done(after):
    calls = []

    def interrupted(x):
        if len(calls) == after:
            raise KeyboardInterrupt
        calls.append(x)
        return parabola(x)

    result = maximize(interrupted, BOX, n_trials=20, n_initial=6)
    assert result.interrupted
    assert len(result.trials) == len(result.y) == after
    assert result.recommendation.observed == result.y.max()


def test_ctrl_c_in_the_callback_keeps_the_trial():
    def stop(trial):
        if trial.index == 6:
            raise KeyboardInterrupt

    result = maximize(parabola, BOX, n_trials=20, n_initial=6, callback=stop)
    assert result.interrupted
    assert len(result.trials) == 7


def test_ctrl_c_before_anything_was_learnt():
    def never(x):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        maximize(never, BOX, n_trials=5)


def test_repeats_itself():
    runs = [maximize(parabola, BOX, n_trials=9, seed=3, input_noise=InputNoise.unit(0.05)) for _ in range(2)]
    assert np.array_equal(runs[0].X, runs[1].X)
    assert np.array_equal(runs[0].recommendation.x, runs[1].recommendation.x)


def test_fewer_trials_than_the_default_design():
    assert len(maximize(parabola, BOX, n_trials=1).trials) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"n_trials": 5, "n_initial": 6}, "n_initial is 6, but n_trials is 5"),
        ({"n_trials": 0}, "n_trials"),
        ({"n_trials": 2.5}, "n_trials"),
        ({"n_trials": True}, "n_trials"),
        ({"n_trials": 5, "surrogate": "forest"}, "surrogate"),
        ({"n_trials": 5, "f": 3}, "function"),
        ({"n_trials": 5, "box": {"x": (0, 1)}}, "Box"),
    ],
)
def test_bad_arguments(arguments, words):
    with pytest.raises(InputError, match=words):
        maximize(**({"f": parabola, "box": BOX} | arguments))

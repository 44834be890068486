import inspect
import io
import math
import sys
from html import escape

import numpy as np
import pytest

from surehold.errors import InputError, SureholdError
from surehold.optimization.box import Box
from surehold.optimization.maximization import Result, Trial, maximize, minimize
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.progress import progress_bar
from surehold.optimization.recommendation import Recommendation, in_digits
from surehold.problems.function import Function

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
        (None, "returned None.*return missing"),
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
        ({"n_trials": 5, "callback": 3}, "callback is 3; give a function"),
        ({"n_trials": 5, "box": {"x": (0, 1)}}, "Box"),
    ],
)
def test_bad_arguments(arguments, words):
    with pytest.raises(InputError, match=words):
        maximize(**({"f": parabola, "box": BOX} | arguments))


def test_minimize_does_not_maximize():
    with pytest.raises(InputError, match="direction is 'maximize'"):
        minimize(parabola, BOX, n_trials=8, direction="maximize")


# --- ending early -------------------------------------------------------------------------------------------------


def _stopping(trial):
    raise StopIteration("good enough")


@pytest.mark.parametrize("ends", [lambda trial: True, _stopping])
@pytest.mark.parametrize("after", [3, 8])
def test_the_callback_ends_the_run_and_the_result_is_kept(ends, after):
    result = maximize(
        parabola, BOX, n_trials=20, n_initial=6, callback=lambda trial: ends(trial) if trial.index == after else None
    )
    assert len(result.trials) == len(result.y) == after + 1
    assert result.stopped == "callback"
    assert not result.interrupted
    assert result.recommendation.observed == result.y.max()


def test_what_a_callback_happens_to_return_ends_nothing():
    assert len(maximize(parabola, BOX, n_trials=6, callback=lambda trial: trial).trials) == 6


def test_no_trial_is_begun_after_the_timeout(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("surehold.optimization.maximization.perf_counter", lambda: clock[0])

    def slow(x):
        clock[0] += 10.0
        return parabola(x)

    result = maximize(slow, BOX, n_trials=20, timeout=35.0)
    assert len(result.trials) == 4
    assert result.stopped == "timeout"
    assert maximize(slow, BOX, n_trials=6, timeout=60.0).stopped == ""


# --- functions that are wrong -------------------------------------------------------------------------------------


def _two_arguments(x, y):
    return 0.0


class _Wrong:
    def __call__(self):
        return 0.0


@pytest.mark.parametrize(
    "f", [lambda: 1.0, _two_arguments, _Wrong(), lambda *, x: 1.0], ids=["none", "two", "class", "key"]
)
def test_a_wrong_signature_is_found_out_at_the_first_call(f):
    seen = []
    with pytest.raises(InputError, match=r"cannot be called with one array x.*; write it as f\(x\), and use x\[0\]"):
        maximize(f, BOX, n_trials=6, callback=seen.append)
    assert not seen


def test_a_wrong_signature_behind_a_problem_is_found_out_too():
    with pytest.raises(InputError, match="cannot be called with one array x"):
        maximize(Function(_two_arguments, BOX), BOX, n_trials=6)


def test_a_type_error_inside_the_function_is_a_failed_trial():
    def moody(x):
        if x[0] < 0.0:
            raise TypeError("no grip")
        return parabola(x)

    result = maximize(moody, BOX, n_trials=8, n_initial=8, seed=1)
    assert {trial.failure for trial in result.trials} == {"", "TypeError: no grip"}


def test_an_array_where_one_number_was_expected_is_said():
    with pytest.raises(SureholdError, match=r"TypeError.*; x has shape \(1,\), take x\[0\]"):
        maximize(lambda x: math.sin(x), Box.unit(1), n_trials=5)


def test_three_failures_in_a_row_after_a_success_are_no_reason_to_give_up():
    calls = []

    def late(x):
        calls.append(x)
        if len(calls) > 1:
            raise RuntimeError("hung")
        return 1.0

    assert len(maximize(late, BOX, n_trials=6).trials) == 6


# --- minimizing ---------------------------------------------------------------------------------------------------


def valley(x):
    return -parabola(x) + 3.0


@pytest.mark.parametrize("noise", [None, InputNoise.unit(0.05)])
def test_minimizing_is_maximizing_turned_over(noise):
    low = minimize(valley, BOX, n_trials=12, seed=2, input_noise=noise)
    high = maximize(lambda x: -valley(x), BOX, n_trials=12, seed=2, input_noise=noise)
    assert np.array_equal(low.X, high.X)
    assert np.array_equal(low.y, -high.y)
    assert low.best_index == high.best_index
    assert [trial.best for trial in low.trials] == [-trial.best for trial in high.trials]
    for name in ("mean", "quantile", "observed"):
        assert getattr(low.recommendation, name) == -getattr(high.recommendation, name)
    assert low.recommendation.std == high.recommendation.std
    assert low.recommendation.quantile >= low.recommendation.mean - 1e-12, "the quantile is on the worse side"
    assert low.optimizer.predict([[0.2]])[0][0] == -high.optimizer.predict([[0.2]])[0][0]
    assert low.optimizer.promise() == high.optimizer.promise()


def test_probabilities_of_a_minimum_are_of_the_users_values():
    best = minimize(valley, BOX, n_trials=10, seed=2, input_noise=InputNoise.unit(0.05)).recommendation
    draws = np.random.default_rng(0).standard_normal(200_000)
    sampled = np.random.default_rng(1).choice(best.execution.means, 200_000) + draws * best.execution.stds.mean()
    assert best.probability_below(best.quantile) == pytest.approx(0.95, abs=1e-6)
    assert best.mean == pytest.approx(sampled.mean(), abs=0.01)


def test_a_needle_is_refused_in_words_of_minimizing():
    def f(x):
        return -float(1.5 * np.exp(-0.5 * ((x[0] - 0.8) / 0.01) ** 2) + np.exp(-0.5 * ((x[0] - 0.3) / 0.15) ** 2))

    optimizer = Optimizer(Box.unit(1), direction="minimize", input_noise=InputNoise.unit(0.05), n_initial=12, seed=0)
    for x in np.append(np.linspace(0.0, 1.0, 30), 0.8):
        optimizer.tell([x], f([x]))
    best = optimizer.recommend()
    assert 0.2 < best.x[0] < 0.4
    assert "lowest observed trial gave -1.5" in best.refused
    assert "more than -" in best.refused


# --- what is tried first, and what is not varied --------------------------------------------------------------------


def test_initial_points_are_tried_first_and_the_design_follows():
    box = Box({"a": (0.0, 1.0), "b": (0.0, 2.0)})
    optimizer = Optimizer(box, initial_points=[[0.5, 1.5], {"b": 0.25, "a": 0.125}], n_initial=6, seed=1)
    X = optimizer.ask(6)
    np.testing.assert_allclose(X[:2], [[0.5, 1.5], [0.125, 0.25]])
    slices = np.sort(np.floor(box.to_unit(X[2:]) * 4), axis=0)
    assert np.array_equal(slices, np.repeat(np.arange(4.0)[:, None], 2, axis=1)), "the rest is no Latin hypercube"
    assert Optimizer(box, initial_points=np.full((9, 2), 0.5), n_initial=6).n_initial == 9
    assert Optimizer(box, initial_points=[[0.5, 1.5]]).n_initial == Optimizer(box).n_initial


def test_two_of_three_initial_trials_keep_what_is_guessed():
    box = Box({"a": (0.0, 1.0), "force": (1.0, 100.0, "log"), "grip": ["pinch", "power", "hook"]})
    optimizer = Optimizer(
        box, guess={"force": 10.0, "grip": "power"}, initial_points=[{"a": 0.5, "force": 2.0, "grip": "hook"}], seed=1
    )
    asked = [trial.parameters for trial in optimizer.ask_trial(optimizer.n_initial)]
    assert (asked[0]["force"], asked[0]["grip"]) == (pytest.approx(2.0), "hook"), "the initial points come first"
    kept = [p["grip"] == "power" and p["force"] == pytest.approx(10.0) for p in asked[1:]]
    assert len(kept) == 14
    assert kept == [k % 3 != 2 for k in range(14)]


def test_what_is_guessed_is_tried_where_it_is_allowed():
    box = Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    X = Optimizer(box, guess={"b": 0.9}, allowed="a + b <= 1.2", n_initial=30, seed=0).ask(30)
    assert np.all(X.sum(axis=1) <= 1.2 + 1e-9)
    kept = np.isclose(X[:, 1], 0.9)
    assert np.sum(kept) == 20
    assert len(np.unique(X, axis=0)) == 30


def test_fixed_variables_keep_their_value():
    box = Box({"a": (-1.0, 1.0), "b": (0.0, 2.0), "c": (0.0, 1.0)})

    def f(x):
        return -float((x[0] - 0.3 * x[1]) ** 2 + (x[2] - 0.5) ** 2)

    result = maximize(
        f, box, n_trials=25, fixed={"b": 1.25}, seed=0, input_noise=InputNoise({"a": 0.01, "b": 0.5, "c": 0})
    )
    np.testing.assert_allclose(result.X[:, 1], 1.25)
    np.testing.assert_allclose(result.recommendation.x, [0.375, 1.25, 0.5], atol=0.05)
    assert result.optimizer.n_initial == Optimizer.default_n_initial(Box.unit(2)) == 10
    assert result.recommendation.std < 0.05, "the noise of a fixed variable counts"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"direction": "down"}, "direction 'down' is unknown"),
        ({"fixed": {"y": 1.0}}, "fixed variable 'y' is unknown"),
        ({"fixed": {"x": 9.0}}, "x = 9 lies outside its range"),
        ({"fixed": {"x": "much"}}, "give a finite number"),
        ({"fixed": {"x": 0.5}}, "every variable is fixed"),
        ({"guess": {"y": 1.0}}, "guess variable 'y' is unknown"),
        ({"guess": {"x": 9.0}}, "guess: x = 9 lies outside its range"),
        ({"guess": 0.5}, "guess is 0.5; give {name: value}"),
        ({"guess": {"x": 0.5}, "fixed": {"x": 0.5}}, "every variable is fixed"),
        ({"guess": {"x": 0.5}, "safety": 0.9, "constraints": {"c": (0, 1)}, "initial_points": [[0.5]]}, "leave one"),
        ({"initial_points": [[9.0]]}, "not inside"),
        ({"initial_points": [[0.1, 0.2]]}, "shape"),
        ({"input_noise": 0.03}, r"InputNoise.unit\(0.03\).*InputNoise\(\{'x': 0.03\}\)"),
        ({"input_noise": {"x": 0.03}}, r"give sh.InputNoise\(\{'x': 0.03\}\)"),
        ({"input_noise": "much"}, "give sh.InputNoise"),
    ],
)
def test_bad_settings(settings, words):
    with pytest.raises(InputError, match=words):
        Optimizer(BOX, **settings)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"noise": "told"}, "a function tells no noise"),
        ({"conditions": "measured"}, "a function is called at the conditions"),
    ],
)
def test_what_a_function_cannot_tell_is_refused_before_it_is_called(settings, words):
    box = Box({"x": (0.0, 1.0)}, uncontrolled={"load": [0.2, 0.4]})
    with pytest.raises(InputError, match=words):
        maximize(pytest.fail, box, n_trials=9, **settings)


@pytest.mark.parametrize("run", [maximize, minimize])
@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"n_intial": 3}, "setting 'n_intial' is unknown; did you mean 'n_initial'"),
        ({"n_job": 2}, "did you mean 'n_jobs'"),
        ({"settings": {"seed": 1}}, "setting 'settings' is unknown"),
    ],
)
def test_a_misspelt_setting_is_named(run, settings, words):
    with pytest.raises(InputError, match=words):
        run(lambda x: 0.0, BOX, 6, **settings)


# --- several processes ----------------------------------------------------------------------------------------------


def test_trials_in_processes():
    """The function is one of this test: a process cannot import this file, but is sent the function itself."""

    def f(x):
        return -float(((x - 0.3) ** 2).sum())

    result = maximize(f, BOX, n_trials=10, n_jobs=2, seed=0, n_initial=6)
    assert len(result.trials) == 10
    assert len(result.optimizer.pending) == 0
    np.testing.assert_allclose(result.y, [f(x) for x in result.X], atol=1e-15)
    assert sorted(result.optimizer._trials.numbers) == list(range(10))
    design = Optimizer(BOX, seed=0, n_initial=6).ask(6)
    early = result.X[result.optimizer._trials.numbers < 6]
    np.testing.assert_array_equal(np.sort(early, axis=0), np.sort(design, axis=0))


def test_a_callback_ends_processes_and_forgets_what_was_under_way():
    result = maximize(lambda x: float(x[0]), BOX, n_trials=10, n_jobs=2, callback=lambda trial: trial.index == 2)
    assert result.stopped == "callback"
    assert len(result.y) == 3
    assert len(result.optimizer.pending) == 0


def test_a_callback_ends_the_run_with_a_flag_of_numpy():
    assert len(maximize(parabola, BOX, n_trials=6, callback=lambda trial: np.bool_(trial.index == 1)).y) == 2


def test_what_goes_wrong_in_a_process_is_said():
    import threading

    lock = threading.Lock()
    with pytest.raises(SureholdError, match="cannot be sent to a process"):
        maximize(lambda x: lock.locked(), BOX, n_trials=6, n_jobs=2)
    with pytest.raises(InputError, match="cannot be called with one array"):
        maximize(lambda x, y: 0.0, BOX, n_trials=6, n_jobs=2)


# --- looking at it --------------------------------------------------------------------------------------------------


def test_a_result_as_a_table():
    pandas = pytest.importorskip("pandas")
    box = Box({"a": (0.0, 1.0), "value": (0.0, 2.0)})
    result = maximize(lambda x: float(x[0]) if x[1] < 1.0 else np.nan, box, n_trials=8, n_initial=8, seed=0)
    table = result.to_dataframe()
    assert list(table.columns) == ["a", "value", "trial value", "failure", "best", "seconds"]
    assert table.index.name == "trial"
    np.testing.assert_array_equal(table[["a", "value"]], [trial.x for trial in result.trials])
    np.testing.assert_array_equal(table["trial value"], result.y)
    assert isinstance(table, pandas.DataFrame)
    assert result.optimizer.predict(table[["value", "a"]])[0].shape == (8,)


def test_without_pandas_the_error_says_what_to_install(monkeypatch):
    result = maximize(parabola, BOX, n_trials=2)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(SureholdError, match="pip install pandas"):
        result.to_dataframe()


def test_what_is_shown_is_short():
    result = maximize(parabola, Box({"<x>": (-1.0, 2.0)}), n_trials=8, seed=0)
    for shown in (result, result.recommendation, result.trials[0], result.optimizer):
        assert len(repr(shown)) < 200, repr(shown)
    assert "8 trials" in repr(result)
    assert "&lt;x&gt;" in result._repr_html_()
    assert in_digits(result.recommendation.mean, result.recommendation.std, 6) in result._repr_html_()
    for kind in (Recommendation, Result, Trial):
        for name in kind.__dataclass_fields__:
            assert f"\n{name}" in inspect.getdoc(kind), f"help({kind.__name__}) says nothing about {name}"


def test_progress_is_silent_where_nobody_looks(capsys):
    maximize(parabola, BOX, n_trials=3, progress=True)
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


@pytest.mark.parametrize("wanted", [True, False])
def test_progress_is_shown_after_two_seconds_on_a_terminal(monkeypatch, wanted):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    screen, clock = Terminal(), [0.0]
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setattr("surehold.optimization.progress.perf_counter", lambda: clock[0])
    with progress_bar(4, wanted) as advance:
        advance(1.0)
        assert screen.getvalue() == ""
        clock[0] = 2.1
        advance(2.5)
        advance(2.5)
    assert ("best 2.5" in screen.getvalue()) == wanted


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"timeout": 0.0}, "timeout"),
        ({"timeout": "1"}, "timeout"),
        ({"n_jobs": 0}, "n_jobs"),
        ({"n_jobs": True}, "n_jobs"),
    ],
)
def test_bad_limits(arguments, words):
    with pytest.raises(InputError, match=words):
        maximize(parabola, BOX, n_trials=3, **arguments)


def test_what_is_shown_of_a_mixed_box_is_what_can_be_commanded():
    box = Box({"f": (1e-9, 1e-6, "log"), "grip": ["pinch", "<power>"]})
    result = minimize(lambda p: 1e6 + np.log(p["f"] / 1e-7) ** 2, box, 8, n_initial=8, seed=0)
    best, shown = result.recommendation, result._repr_html_()
    assert f"<th>f</th><td>{best.parameters['f']:.6g}</td>" in shown
    assert f"<th>grip</th><td>{escape(best.parameters['grip'])}</td>" in shown
    first = result.trials[0]
    assert first.parameters.keys() == {"f", "grip"}
    assert f"'grip': '{first.parameters['grip']}'" in repr(first)
    assert "mean=1e+06" not in repr(result), "and a mean far from zero in the digits that say something"

    def wrong(p):
        raise ValueError("no rig")

    with pytest.raises(
        SureholdError, match=r"at x = \{'f': [0-9.]+e-0[6-9], 'grip': '(pinch|<power>)'\}: ValueError: no rig"
    ):
        maximize(wrong, box, 8, seed=0)

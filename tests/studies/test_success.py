"""A study whose trials succeed or fail."""

import numpy as np
import pytest

from surehold import Box, Optimizer
from surehold.errors import InputError
from surehold.studies.history import EXECUTIONS, history_of
from surehold.studies.parameter_text import parse_search_space
from surehold.studies.robot import RobotStudy
from surehold.studies.settings import StudySettings
from surehold.studies.status import rows, to_csv
from surehold.studies.warm_start import FormerTrial, import_trials, trials_of_csv, trials_of_study


def created(tmp_path, **optimizer):
    settings = StudySettings(parse_search_space("x=0:1"), None, {}, {"seed": 0, **optimizer})
    return RobotStudy.create("rig", settings, str(tmp_path / "journal.log"))


def test_asks_as_an_optimizer_that_was_told_the_same(tmp_path):
    study = created(tmp_path, outcome="success", n_initial=6)
    for k in range(7):
        asked = study.ask()
        study.tell(asked.id, "success" if 0.4 < asked.parameters["x"] < 0.8 else "failure", failed=False)
        assert k == asked.id
    assert 0.3 < study.recommend().parameters["x"] < 0.9


def test_what_is_told_must_be_success_or_failure(tmp_path):
    study = created(tmp_path, outcome="success")
    asked = study.ask()
    with pytest.raises(InputError, match="tell success, failure or, of several executions, 7/10"):
        study.tell(asked.id, 0.7)
    assert study.tell(asked.id, "failure").value == 0.0


@pytest.mark.parametrize("told", [np.float64(0.7) > 0.5, np.int64(1), np.float32(1.0), True])
def test_what_numpy_says_of_success_is_taken(told, tmp_path):
    study = created(tmp_path, outcome="success")
    assert study.tell(study.ask().id, told).value == 1.0


def test_a_study_of_values_takes_no_success(tmp_path):
    study = created(tmp_path)
    with pytest.raises(InputError, match="--outcome success"):
        study.tell(study.ask().id, "success")
    with pytest.raises(InputError, match="'True' was told, but this study is told values"):
        study.tell(0, np.float64(0.7) > 0.5)


def hill(x):
    """Successes of ten at x in [0, 1], the most at 0.6."""
    return round(10 * 2.0 ** (-(((x - 0.6) / 0.2) ** 2)))


def test_counts_of_executions_reach_the_optimizer(tmp_path):
    study = created(tmp_path, outcome="success", n_initial=5)
    optimizer = Optimizer(Box({"x": (0.0, 1.0)}), outcome="success", n_initial=5, seed=0)
    for _ in range(8):
        asked = study.ask()
        trial = optimizer.ask_trial()
        assert asked.parameters == pytest.approx(trial.parameters, abs=1e-12)
        assert study.tell(asked.id, f"{hill(asked.parameters['x'])}/10").of == 10
        optimizer.tell(trial, successes=hill(trial.x[0]), of=10)
    study.close()
    again = RobotStudy.open("rig", str(tmp_path / "journal.log"))
    assert again.next() == pytest.approx(optimizer.ask_trial().parameters, abs=1e-9)
    assert again.recommend().mean == pytest.approx(optimizer.recommend().mean, abs=1e-9)


def test_a_share_of_many_executions_says_more_than_one_of_few(tmp_path):
    quantiles = {}
    for of in (2, 20):
        (tmp_path / str(of)).mkdir()
        study = created(tmp_path / str(of), outcome="success", n_initial=4)
        for x in (0.1, 0.5, 0.9):
            study.add({"x": x}, successes=of // 2, of=of)
        study.add({"x": 0.7}, successes=of, of=of)
        quantiles[of] = study.recommend(write=False).quantile
    assert quantiles[20] > quantiles[2] + 0.1


def test_the_same_count_again_is_harmless_and_another_is_refused(tmp_path):
    study = created(tmp_path, outcome="success")
    study.ask()
    assert not study.tell(0, successes=7, of=10).already
    assert study.tell(0, "7/10").already
    with pytest.raises(InputError, match=r"told before: value 0\.7; .*of 20 executions, not 10"):
        study.tell(0, successes=14, of=20)


BAD = [
    ({"value": "8/7"}, "8 of 7; there cannot be more"),
    ({"value": "-1/3"}, "successes is -1; give a whole number of 0 or more"),
    ({"value": "0/0"}, "of is 0; give a whole number of 1 or more"),
    ({"value": "x/3"}, "'x/3' is no count of successes; tell two whole numbers, such as 7/10"),
    ({"value": "1/2/3"}, "'1/2/3' is no count"),
    ({"value": "1/99999999999999999999999"}, "at most 1000000 executions"),
    ({"value": "success", "successes": 1, "of": 2}, "'success' and a count of successes were told"),
    ({"value": "1/2", "of": 2}, "'1/2' and a count of successes were told"),
    ({"successes": 7}, "successes are 7 of None; tell both"),
    ({"successes": True, "of": 2}, "successes is True; give a whole number"),
    ({"successes": 1.5, "of": 2}, r"successes is 1\.5; give a whole number"),
    ({"successes": 1, "of": 2, "failed": True}, "a failed trial has no value"),
    ({}, "the trial has no value"),
]


@pytest.mark.parametrize(("told", "message"), BAD)
def test_what_is_no_count_is_refused_and_leaves_no_trace(tmp_path, told, message):
    study = created(tmp_path, outcome="success")
    study.ask()
    for tell in (lambda: study.tell(0, **told), lambda: study.add({"x": 0.5}, **told)):
        with pytest.raises(InputError, match=message) as error:
            tell()
        assert "\n" not in str(error.value)
    (trial,) = study.trials()
    assert not trial.state.is_finished()
    assert EXECUTIONS not in trial.user_attrs


@pytest.mark.parametrize("told", [{"value": "7/10"}, {"successes": 7, "of": 10}])
def test_a_study_of_values_takes_no_count(tmp_path, told):
    study = created(tmp_path)
    with pytest.raises(InputError, match="this study is told values; create one with --outcome success"):
        study.tell(study.ask().id, **told)


def test_counts_survive_export_and_import(tmp_path):
    study = created(tmp_path, outcome="success")
    study.add({"x": 0.5}, "7/10")
    study.add({"x": 0.25}, "failure")
    study.add({"x": 0.125}, failed=True)
    (tmp_path / "trials.csv").write_text(to_csv(study))
    names = {"x": "x"}
    for name, found in (
        ("csv", trials_of_csv(str(tmp_path / "trials.csv"), names)),
        ("study", trials_of_study(study.study, names, "maximize")),
    ):
        (tmp_path / name).mkdir()
        other = created(tmp_path / name, outcome="success")
        assert import_trials(other, found).left_out == []
        assert [(r["value"], r["of"]) for r in rows(other)] == [(0.7, 10), (0.0, 1), (None, 1)]
    with pytest.raises(InputError, match=r"'0\.7' is no share of '3' executions"):
        import_trials(other, [FormerTrial("line 2", {"x": 0.5}, "0.7", False, {}, "3")])


def test_foreign_attributes_of_executions_count_as_one(tmp_path):
    study = created(tmp_path, outcome="success")
    for of in ("ten", 0, True, 10**30, 2.5):
        trial = study.study.ask({"x": study.settings.space.distributions["x"]})
        trial.set_user_attr(EXECUTIONS, of)
        study.study.tell(trial, 1.0)
    history = history_of(study.trials(), study.settings.space)
    assert history.executions.tolist() == [1] * 5


def test_success_within_limits(tmp_path):
    study = created(tmp_path, outcome="success", n_initial=5, constraints={"force": [None, 0.5]})
    optimizer = Optimizer(
        Box({"x": (0.0, 1.0)}), outcome="success", n_initial=5, seed=0, constraints={"force": (None, 0.5)}
    )
    for _ in range(7):
        asked, trial = study.ask(), optimizer.ask_trial()
        assert asked.parameters == pytest.approx(trial.parameters, abs=1e-9)
        x = asked.parameters["x"]
        study.tell(asked.id, f"{hill(x)}/10", constraints={"force": x})
        optimizer.tell(trial, successes=hill(x), of=10, constraints={"force": x})
    best = study.recommend()
    assert best.parameters["x"] <= 0.5
    assert best.feasible == pytest.approx(optimizer.recommend().feasible, abs=1e-6)
    assert best.outputs["force"] == pytest.approx(best.parameters["x"], abs=0.01)
    study.tell(study.ask().id, failed=True)
    assert len(study.trials()) == 8


def test_the_answer_of_trials_that_all_failed_is_the_least_hopeless_of_them(tmp_path):
    study = created(tmp_path, outcome="success", n_initial=3, constraints={"force": [None, 0.5]})
    optimizer = Optimizer(
        Box({"x": (0.0, 1.0)}), outcome="success", n_initial=3, seed=0, constraints={"force": (None, 0.5)}
    )
    for _ in range(3):
        study.tell(study.ask().id, failed=True)
        optimizer.tell(optimizer.ask_trial(), failed=True)
        best, wanted = study.recommend(), optimizer.recommend()
        assert best.parameters == pytest.approx(wanted.parameters, abs=1e-9)
        assert (best.observed, best.best_value, best.n) == (0.0, 0.0, wanted.n)
    assert study.promise() is None, "no trial may become the answer, and JSON knows no infinity"

import importlib.util
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from optuna import logging
from optuna.trial import TrialState

import surehold as sh
from surehold.errors import InputError
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.stop_rule import StopRule
from surehold.studies.storage import StorageFailure
from surehold.studies.trial_function import problem_of, trial_function
from surehold.studies.worker import work

SPACE = SearchSpace({"x": (0.0, 1.0)})


@pytest.fixture
def study(tmp_path):
    study = RobotStudy.create("rig", StudySettings(SPACE, optimizer={"n_initial": 4}), str(tmp_path / "journal.log"))
    study.set_stop_rule(StopRule(trials=8))
    return study


def attempt(f):
    return trial_function(f, SPACE)


def test_killed_workers_lose_nothing(url):
    """The experiment of benchmarks/study_survival.py, shortened."""
    path = Path(__file__).parents[2] / "benchmarks" / "study_survival.py"
    spec = importlib.util.spec_from_file_location("study_survival", path)
    survival = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(survival)
    found = survival.survive(url, workers=2, trials=12, every=1.0, seconds=0.3, lifetime=2.0, most=3)
    assert (found["trials"], found["complete"], found["failed"], found["left_running"]) == (12, 12, 0, 0), found
    assert found["parameters_twice"] == 0
    assert found["answers_not_stored"] <= found["kills"]
    assert found["recommendation_agrees"]
    assert found["kills"] > 0


def test_failures_are_told_and_do_not_end_the_worker(study):
    def f(x):
        if x[0] > 0.5:
            raise RuntimeError("slipped")
        return np.nan if x[0] > 0.4 else x[0]

    seen = []
    assert work(study, attempt(f), after=lambda asked, outcome: seen.append(outcome)) == 8
    states = [t.state for t in study.trials()]
    assert states.count(TrialState.FAIL) == sum(bool(o.failure) for o in seen) > 0
    assert "RuntimeError: slipped" in {o.failure for o in seen}
    assert work(study, attempt(f)) == 0


def test_a_function_that_exits_has_failed(study):
    seen = []
    function = attempt(lambda x: sys.exit("no robot"))
    assert work(study, function, most=2, after=lambda asked, outcome: seen.append(outcome.failure)) == 2
    assert seen == ["it called sys.exit(no robot)"] * 2
    assert [trial.state for trial in study.trials()] == [TrialState.FAIL] * 2


def test_a_worker_makes_no_more_than_it_may(study):
    assert work(study, attempt(lambda x: x[0]), most=3) == 3
    assert len(study.trials()) == 3


def test_interrupting_lets_the_trial_go(study):
    def interrupted(x):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work(study, attempt(interrupted))
    time.sleep(0.01)
    assert study.ask("other", lifetime=60.0).id == 0


def test_a_trial_that_was_let_go_often_has_ended_nobody(study):
    def interrupted(x):
        raise KeyboardInterrupt

    for _ in range(7):
        with pytest.raises(KeyboardInterrupt):
            work(study, attempt(interrupted))
        time.sleep(0.01)
    (trial,) = study.trials()
    assert trial.state == TrialState.RUNNING
    assert study.ask("other").id == 0


def test_interrupting_while_the_storage_is_away_lets_the_trial_go(study, monkeypatch):
    away = []

    def fails(*arguments, **named):
        away.append(arguments)
        raise StorageFailure("away")

    def interrupted(seconds):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, "tell", fails)
    monkeypatch.setattr("surehold.studies.worker.time.sleep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        work(study, attempt(lambda x: x[0]))
    monkeypatch.undo()
    time.sleep(0.01)
    assert len(away) == 1
    assert study.ask("other", lifetime=60.0).id == 0


def test_a_slow_trial_is_kept_by_signs_of_life(study):
    others = []

    def slow(x):
        time.sleep(1.2)
        others.append(study.ask("other").id)
        return x[0]

    work(study, attempt(slow), lifetime=0.8, most=1)
    assert others == [1]
    assert study.trials()[0].state == TrialState.COMPLETE


def test_an_answer_outlives_a_storage_that_is_away(study, monkeypatch):
    monkeypatch.setattr("surehold.studies.worker._PATIENCE", (0.0, 0.0, 0.0))
    tell, failures = study.tell, [StorageFailure("busy"), StorageFailure("busy")]

    def troubled(*arguments, **named):
        if failures:
            raise failures.pop()
        return tell(*arguments, **named)

    monkeypatch.setattr(study, "tell", troubled)
    assert work(study, attempt(lambda x: x[0]), most=2) == 2
    assert [t.state for t in study.trials()] == [TrialState.COMPLETE] * 2
    failures += [StorageFailure("gone")] * 9
    with pytest.raises(StorageFailure, match=r"trial 2 \(value 0\.\d+\) could not be stored: gone"):
        work(study, attempt(lambda x: x[0]), most=1)


def test_a_late_answer_of_another_value_is_refused_and_the_worker_goes_on(study, caplog):
    def overtaken(x):
        study.tell(study.trials()[-1].number, -1.0)
        return x[0]

    assert work(study, attempt(overtaken), most=2) == 2
    assert [t.value for t in study.trials()] == [-1.0, -1.0]


def test_workers_wait_while_the_study_is_paused(study):
    study.pause("lunch")
    thread = threading.Thread(target=work, args=(study, attempt(lambda x: x[0])), kwargs={"most": 1})
    thread.start()
    time.sleep(0.3)
    assert study.trials() == []
    study.resume()
    thread.join(timeout=600)
    assert len(study.trials()) == 1


def test_parameters_reach_the_function_as_numbers_or_by_name():
    space = SearchSpace({"a": (0.0, 1.0), "b": (0.0, 2.0)})
    assert trial_function(lambda x: float(x @ [1.0, 10.0]), space)({"b": 2.0, "a": 1.0}).value == 21.0
    from optuna.distributions import CategoricalDistribution, IntDistribution

    mixed = SearchSpace({"n": IntDistribution(1, 3), "c": CategoricalDistribution(["p", "q"])})
    outcome = trial_function(lambda p: p["n"] * (10 if p["c"] == "q" else 1), mixed)({"n": 3, "c": "q"})
    assert outcome == (30.0, "", {})


def test_the_problem_of_a_study_is_found_again(tmp_path):
    assert problem_of(StudySettings(SPACE, problem={"synthetic": "rkhs"})).box == sh.problems.RKHS().box
    (tmp_path / "own.py").write_text("def f(x):\n    return 7.0\n")
    assert problem_of(StudySettings(SPACE), f"{tmp_path}/own.py:f")(0) == 7.0
    assert problem_of(StudySettings(SPACE, problem={"function": f"{tmp_path}/own.py:f"}))(0) == 7.0
    with pytest.raises(InputError, match="says nothing about what its trials are"):
        problem_of(StudySettings(SPACE))


def test_a_lifetime_must_be_positive(study):
    for lifetime in (0.0, float("nan"), float("inf"), 1e12):  # for longer no thread can wait
        with pytest.raises(InputError, match="lifetime"):
            work(study, attempt(lambda x: x[0]), lifetime=lifetime)
    assert sys.modules["surehold.studies.worker"].LIFETIME > 0.0


def test_files_of_a_problem_are_found_from_another_folder(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    Path("rig.py").write_text("def score(x):\n    return 3.0 * x[0]\n")
    trimesh.creation.box((0.06, 0.06, 0.12)).export("part.obj")
    storage = str(tmp_path / "journal.log")
    RobotStudy.create("f", StudySettings(SPACE, problem={"function": "rig.py:score"}), storage)
    RobotStudy.create("g", StudySettings(SPACE, problem={"grasp": {"object": "part.obj", "unit": "m"}}), storage)
    monkeypatch.chdir(tmp_path)
    assert problem_of(RobotStudy.open("f", storage).settings)(np.array([0.5])) == 1.5
    problem = problem_of(RobotStudy.open("g", storage).settings)
    assert problem.simulator.object.name == "part"
    monkeypatch.chdir(tmp_path / "here")  # the same study, told the same again
    RobotStudy.create("f", StudySettings(SPACE, problem={"function": "rig.py:score"}), storage, resume=True)


def test_a_worker_says_for_what_it_waits(study, caplog):
    logging.enable_propagation()
    try:
        study.set_stop_rule(StopRule(trials=1))
        asked = study.ask("silent", lifetime=2.5)
        assert work(study, attempt(lambda x: x[0])) == 1
    finally:
        logging.disable_propagation()
    assert [trial.number for trial in study.trials() if trial.state.is_finished()] == [asked.id]
    assert sum("Waiting for the last trials of other workers" in message for message in caplog.messages) == 1

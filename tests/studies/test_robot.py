import json
import math
import subprocess
import sys
import threading
import time

import numpy as np
import optuna
import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import TrialState

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.noise.input_noise import noise_of_coordinates
from surehold.studies.history import REACHED, Reader, history_of
from surehold.studies.ledger import VETOED
from surehold.studies.replay import result_of
from surehold.studies.robot import NothingToAsk, RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.status import rows, status
from surehold.studies.stop_rule import StopRule

BOX = sh.Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
SETTINGS = StudySettings(
    SearchSpace(BOX), sh.InputNoise({"dx": 0.003, "dy": 0.003}), {"dx": "m", "dy": "m"}, {"seed": 4, "n_initial": 6}
)


def quality(p):
    return 1.0 - 40.0 * abs(p["dx"] - 0.01) - 20.0 * abs(p["dy"])


@pytest.fixture
def robot(url):
    study = RobotStudy.create("mug", SETTINGS, url)
    yield study
    study.close()


OPENED = []


@pytest.fixture(autouse=True)
def close_all():
    yield
    while OPENED:
        OPENED.pop().close()


def again(robot):
    OPENED.append(RobotStudy.open(robot.name, robot.storage.url))
    return OPENED[-1]


def test_asked_told_and_recommended(robot):
    for k in range(20):
        asked = robot.ask()
        assert asked.id == k
        assert asked.units == {"dx": "m", "dy": "m"}
        assert not asked.again
        told = robot.tell(asked.id, quality(asked.parameters))
        assert (told.state, told.already) == ("complete", False)
    best = robot.recommend()
    assert abs(best.parameters["dx"] - 0.01) < 0.005
    assert best.parameters == robot.trials()[best.trial].params
    other = again(robot)
    assert other.study.user_attrs["surehold:recommendation"] == best.as_dict()
    assert other.recommend() == best
    optimizer = sh.Optimizer(BOX, input_noise=SETTINGS.input_noise, seed=4, n_initial=6)
    for trial in robot.trials():
        optimizer.tell([trial.params["dx"], trial.params["dy"]], trial.value)
    assert best.mean == optimizer.recommend().mean


def test_a_run_interrupted_at_any_trial_asks_the_same_next_point(tmp_path):
    """At every trial of a 30-trial run, everything is opened anew from the disk."""
    whole = RobotStudy.create("mug", SETTINGS, "memory")
    asked = []
    for _ in range(30):
        trial = whole.ask()
        asked.append(trial.parameters)
        whole.tell(trial.id, quality(trial.parameters))
    for url in (str(tmp_path / "journal.log"), f"sqlite:///{tmp_path}/study.db"):
        RobotStudy.create("mug", SETTINGS, url).close()
        for k in range(30):
            resumed = RobotStudy.open("mug", url)
            assert resumed.next() == asked[k]
            trial = resumed.ask()
            assert trial.parameters == asked[k]
            resumed.close()
            told = RobotStudy.open("mug", url)
            told.tell(trial.id, quality(trial.parameters))
            told.close()


def test_an_interruption_between_ask_and_tell_loses_nothing(robot):
    asked = robot.ask(worker="arm")
    other = again(robot)
    assert other.ask(worker="arm") == type(asked)(asked.id, asked.parameters, asked.units, True)
    assert other.ask(worker="leg").id == 1
    assert other.ask().id == 2
    other.tell(asked.id, 0.5)
    assert robot.ask(worker="arm").id == 3


def test_telling_twice(robot):
    asked = robot.ask()
    robot.tell(asked.id, 0.25)
    other = again(robot)
    assert other.tell(asked.id, 0.25).already
    with pytest.raises(InputError, match=r"told before: value 0\.25; now: value 0\.5"):
        other.tell(asked.id, 0.5)
    with pytest.raises(InputError, match="now: failed"):
        other.tell(asked.id, failed=True)
    failing = robot.ask()
    assert robot.tell(failing.id, failed=True).state == "failed"
    assert other.tell(failing.id, failed=True).already
    with pytest.raises(InputError, match="told before: failed"):
        other.tell(failing.id, 1.0)
    assert [t.value for t in robot.trials()] == [0.25, None]


def test_what_a_dead_teller_left_behind_is_not_believed(robot):
    asked = robot.ask()
    stored = robot.trials()[asked.id]
    robot.storage.backend.set_trial_user_attr(stored._trial_id, REACHED, asked.parameters | {"dx": 0.05})
    robot.tell(asked.id, 0.5)
    assert robot.trials()[asked.id].user_attrs[REACHED] == asked.parameters


def test_an_answer_quicker_than_a_veto_counts(robot):
    asked = robot.ask()
    stored = robot.trials()[asked.id]
    robot.storage.backend.set_trial_user_attr(stored._trial_id, VETOED, "too late")
    robot.tell(asked.id, 0.5)
    assert robot.tell(asked.id, 0.5).already
    with pytest.raises(InputError, match=r"value 0\.5"):
        robot.veto(asked.id)


def test_what_was_reached_is_what_the_model_learns_from(robot):
    asked = robot.ask()
    robot.tell(asked.id, 0.5, reached={"dx": 0.02})
    assert robot.tell(asked.id, 0.5, reached={"dx": 0.02}).already
    with pytest.raises(InputError, match="reached elsewhere"):
        robot.tell(asked.id, 0.5, reached={"dx": 0.03})
    best = robot.recommend()
    assert best.parameters == {"dx": 0.02, "dy": asked.parameters["dy"]}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"value": math.nan}, "finite"),
        ({"value": math.inf}, "finite"),
        ({"value": "good"}, "finite"),
        ({"value": True}, "told values"),
        ({"value": [1.0, 2.0]}, "finite"),
        ({}, "has no value"),
        ({"value": 1.0, "failed": True}, "has no value, but"),
        ({"value": 1.0, "reached": {"dx": 1e300}}, "can be reached"),
        ({"value": 1.0, "reached": {"dx": math.nan}}, "finite"),
        ({"value": 1.0, "reached": {"dz": 0.0}}, "'dz' is unknown"),
        ({"value": np.complex128(1.0 + 2.0j)}, "one finite number"),
        ({"value": np.array(1.0 + 0.0j)}, "one finite number"),
        ({"value": 1.0, "id": 1}, "trial 1 is not in study 'mug'; the last one is 0"),
        ({"value": 1.0, "id": -1}, "0 or more"),
        ({"value": 1.0, "id": "0"}, "whole number"),
        ({"value": 1.0, "id": 2**70}, "not in study"),
    ],
)
def test_bad_answers_change_nothing(arguments, message, tmp_path):
    robot = RobotStudy.create("mug", SETTINGS, str(tmp_path / "j.log"))
    asked = robot.ask()
    with pytest.raises(InputError, match=message):
        robot.tell(**{"id": asked.id} | arguments)
    assert [t.state for t in robot.trials()] == [TrialState.RUNNING]
    assert robot.trials()[0].user_attrs.keys() == {"surehold:holder"}


# --- people -----------------------------------------------------------------------------------------------------------


def test_a_vetoed_trial_is_avoided(robot):
    asked = robot.ask()
    robot.veto(asked.id, "would hit the table")
    robot.veto(asked.id)
    with pytest.raises(InputError, match="vetoed"):
        robot.tell(asked.id, 1.0)
    assert np.isnan(robot.sampler.optimizer(robot.study).y).tolist() == [True]
    other = robot.ask()
    robot.tell(other.id, 1.0)
    with pytest.raises(InputError, match="only a pending one"):
        robot.veto(other.id)
    with pytest.raises(InputError, match="not in study"):
        robot.veto(7)


def test_a_trial_made_by_hand(robot):
    assert robot.add({"dx": "0.01", "dy": 0}, 0.9, note="teach-in") == 0
    assert robot.add({"dx": 0.02, "dy": 0.0}, failed=True) == 1
    assert robot.add({"dx": 0.02, "dy": 0.0}, 0.3, reached={"dy": 0.001}) == 2
    assert robot.ask().id == 3
    optimizer = robot.sampler.optimizer(robot.study)
    assert optimizer.X[0] == pytest.approx([0.01, 0.0])
    for bad in ({"dx": 0.01}, {"dx": 0.06, "dy": 0.0}, {"dx": 0.0, "dy": 0.0, "dz": 0.0}):
        with pytest.raises(InputError):
            robot.add(bad, 1.0)
    with pytest.raises(InputError, match="finite"):
        robot.add({"dx": 0.01, "dy": 0.0}, math.nan)
    assert len(robot.trials()) == 4


def test_pausing(robot):
    asked = robot.ask()
    robot.pause("lunch")
    other = again(robot)
    for look in (other.ask, other.next):
        with pytest.raises(NothingToAsk, match=r"paused \(lunch\)"):
            look()
    other.tell(asked.id, 0.5)
    robot.resume()
    assert other.ask().id == 1


def test_the_budget_ends_asking(robot):
    robot.set_stop_rule(StopRule(trials=2))
    first = robot.ask()
    robot.ask()
    with pytest.raises(NothingToAsk, match=r"budget of 2 trials .* surehold study stop mug, with"):
        robot.ask()
    assert "budget" in robot.stopped()
    robot.tell(first.id, 1.0)
    robot.set_stop_rule(StopRule())
    assert robot.stopped() == ""
    assert robot.ask().id == 2


def test_time_ends_asking(robot):
    robot.set_stop_rule(StopRule(until=time.time() + 3600.0))
    robot.ask()
    robot.set_stop_rule(StopRule(until=time.time() - 1.0))
    with pytest.raises(NothingToAsk, match="time ended"):
        robot.ask()


def test_nothing_left_to_gain_ends_asking(tmp_path):
    space = SearchSpace({"x": (0.0, 1.0)})
    robot = RobotStudy.create("flat", StudySettings(space, optimizer={"n_initial": 5}), str(tmp_path / "j.log"))
    robot.set_stop_rule(StopRule(improvement=1e-3, asks=3, trials=60))
    while not robot.stopped():
        asked = robot.ask()
        robot.tell(asked.id, 1.0 - (asked.parameters["x"] - 0.4) ** 2)
    with pytest.raises(NothingToAsk, match=r"promised an improvement of 0\.001"):
        robot.ask()
    assert len(robot.trials()) < 60
    promises = [t.user_attrs["surehold:promise"] for t in robot.trials()[5:]]
    assert max(promises[-2:]) < 1e-3
    assert promises[0] > 1e-3
    assert robot.promise() < 1e-3


@pytest.mark.parametrize("bad", [{"trials": 0}, {"improvement": math.nan}, {"asks": 0}, {"until": -1}, {"trials": 2.5}])
def test_stop_rules_that_make_no_sense(bad):
    with pytest.raises(InputError):
        StopRule(**bad)


# --- many at once -----------------------------------------------------------------------------------------------------


def test_threads_get_different_trials(robot):
    found = []

    def work():
        for _ in range(5):
            asked = robot.ask()
            found.append(asked)
            robot.tell(asked.id, quality(asked.parameters))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(a.id for a in found) == list(range(20))
    assert len({tuple(a.parameters.values()) for a in found}) == 20
    assert all(t.state == TrialState.COMPLETE for t in robot.trials())


PROCESS = """
import json, sys
from surehold.studies.robot import RobotStudy
robot = RobotStudy.open("mug", sys.argv[1])
ids = []
for _ in range(6):
    asked = robot.ask()
    ids.append(asked.id)
    robot.tell(asked.id, -asked.parameters["dx"] ** 2)
print(json.dumps(ids))
"""


def test_processes_get_different_trials(tmp_path):
    robot = RobotStudy.create("mug", SETTINGS, str(tmp_path / "journal.log"))
    runs = [
        subprocess.Popen([sys.executable, "-c", PROCESS, robot.storage.url], stdout=subprocess.PIPE) for _ in range(3)
    ]
    ids = [i for run in runs for i in json.loads(run.communicate(timeout=600)[0])]
    assert sorted(ids) == list(range(18))
    trials = again(robot).trials()
    assert len({tuple(t.params.values()) for t in trials}) == 18
    assert all(t.state == TrialState.COMPLETE for t in trials)


def test_a_dead_workers_trial_is_taken_up_again_and_its_late_answer_counts(robot):
    first = robot.ask("one", lifetime=0.05)
    time.sleep(0.1)
    second = robot.ask("two", lifetime=60.0)
    assert second.id == first.id
    assert second.parameters == first.parameters
    assert second.again
    robot.renew(first.id, "one", 60.0)  # no longer its own: nothing happens
    assert robot.tell(first.id, 0.7).already is False  # the first answer, of the worker believed dead
    assert robot.tell(second.id, 0.7).already
    with pytest.raises(InputError, match="first answer"):
        robot.tell(second.id, 0.71)


def test_a_worker_that_says_that_it_lives_keeps_its_trial(robot):
    asked = robot.ask("one", lifetime=0.05)
    robot.renew(asked.id, "one", 60.0)
    time.sleep(0.1)
    assert robot.ask("two").id != asked.id
    robot.renew(asked.id, "one", 0.0)
    time.sleep(0.01)
    assert robot.ask("three").id == asked.id


def test_a_lifetime_begins_when_the_trial_is_handed_out(robot, monkeypatch):
    suggest, seconds = robot.sampler.suggest, [time.time()]

    def slow(*arguments):
        seconds[0] += 100.0  # by the clock, which the model, or others that hold the lock, let run
        return suggest(*arguments)

    monkeypatch.setattr(robot.sampler, "suggest", slow)
    monkeypatch.setattr("surehold.studies.ledger.time.time", lambda: seconds[0])
    assert robot.ask("one", lifetime=60.0).id == 0
    assert robot.ask("two", lifetime=60.0).id == 1


def test_a_trial_that_kills_every_worker_fails(robot):
    for _ in range(5):
        assert robot.ask(lifetime=0.0).id == 0
        time.sleep(0.002)
    assert robot.ask().id == 1
    assert robot.trials()[0].state == TrialState.FAIL
    assert "workers died of it" in robot.trials()[0].user_attrs["surehold:note"]


def test_a_worker_that_asks_again_is_no_further_one(robot):
    for _ in range(6):
        assert robot.ask("arm", lifetime=60.0).id == 0
    assert status(robot)["pending"][0]["attempts"] == 1
    robot.ask("arm", lifetime=0.0)
    time.sleep(0.002)
    assert robot.ask("leg", lifetime=60.0).id == 0
    assert status(robot)["pending"][0]["attempts"] == 2


def test_enqueued_trials_come_first(robot):
    robot.study.enqueue_trial({"dx": 0.01, "dy": 0.02})
    robot.study.enqueue_trial({"dx": -0.01})
    assert robot.next() == {"dx": 0.01, "dy": 0.02}
    assert robot.ask().parameters == {"dx": 0.01, "dy": 0.02}
    assert robot.ask().parameters["dx"] == -0.01


# --- opening ----------------------------------------------------------------------------------------------------------


def test_other_settings_are_refused_by_name(robot):
    resumed = RobotStudy.create("mug", SETTINGS, robot.storage.url, resume=True)
    OPENED.append(resumed)
    assert resumed.name == "mug"
    with pytest.raises(InputError, match="exists in"):
        RobotStudy.create("mug", SETTINGS, robot.storage.url)
    wider = SearchSpace({"dx": (-0.05, 0.06), "dy": (-0.03, 0.03)})
    cases = {
        "parameter dx: -0.05:0.05 in the study, -0.05:0.06 now": StudySettings(
            wider, SETTINGS.input_noise, SETTINGS.units, SETTINGS.optimizer
        ),
        "input noise: .*0.003.* in the study, nothing now": StudySettings(
            SETTINGS.space, None, SETTINGS.units, SETTINGS.optimizer
        ),
        "seed: 4 in the study, 5 now": StudySettings(
            SETTINGS.space, SETTINGS.input_noise, SETTINGS.units, {"seed": 5, "n_initial": 6}
        ),
        "unit of dy: m in the study, nothing now": StudySettings(
            SETTINGS.space, SETTINGS.input_noise, {"dx": "m"}, SETTINGS.optimizer
        ),
    }
    for message, settings in cases.items():
        with pytest.raises(InputError, match=message):
            RobotStudy.create("mug", settings, robot.storage.url, resume=True)
    assert robot.ask().id == 0


def test_settings_survive_the_storage(tmp_path):
    space = SearchSpace(
        {
            "x": FloatDistribution(0.1, 10.0, log=True),
            "n": IntDistribution(1, 9, step=2),
            "c": CategoricalDistribution(["a", "b"]),
        }
    )
    settings = StudySettings(
        space,
        sh.InputNoise({"x": 0.1, "n": 0.0}),
        {"x": "N"},
        {"seed": 1, "risk": sh.Risk("cvar", alpha=0.2), "surrogate": "tgp"},
    )
    robot = RobotStudy.create("all", settings, f"sqlite:///{tmp_path}/a.db")
    stored = RobotStudy.open("all", robot.storage.url).settings
    assert stored.differences(settings) == []
    assert stored.optimizer["risk"] == sh.Risk("cvar", alpha=0.2)
    assert robot.ask().parameters == RobotStudy.open("all", robot.storage.url).trials()[0].params


def test_a_measure_by_its_name_is_the_one_with_its_usual_parameter():
    space, noise = SearchSpace({"x": FloatDistribution(0.0, 1.0)}), sh.InputNoise({"x": 0.1})
    named, written, plain = (
        StudySettings(space, noise, {}, optimizer)
        for optimizer in ({"risk": "cvar"}, {"risk": sh.Risk("cvar", alpha=0.1)}, {})
    )
    assert named.differences(written) == written.differences(named) == []
    assert plain.differences(named) == ["risk: mean in the study, cvar=0.1 now"]
    stored = named.to_json()
    assert StudySettings.from_json(stored | {"optimizer": {"risk": "cvar"}}).differences(named) == []


def test_a_correlated_noise_survives_the_storage(tmp_path):
    covariance = np.array([[9e-6, 2e-6], [2e-6, 4e-6]])
    settings = StudySettings(SearchSpace(BOX), sh.InputNoise(covariance=covariance))
    robot = RobotStudy.create("c", settings, str(tmp_path / "j.log"))
    found = RobotStudy.open("c", robot.storage.url).settings.input_noise.unit_covariance(BOX)
    assert np.allclose(found, covariance / np.outer(BOX.widths, BOX.widths), rtol=1e-12)


def test_a_bounded_noise_survives_the_storage_and_one_that_varies_is_refused(tmp_path):
    noise = sh.InputNoise.uniform({"dx": 0.003, "dy": 0.001})
    settings = StudySettings(SearchSpace(BOX), noise, optimizer={"n_initial": 3})
    robot = RobotStudy.create("b", settings, str(tmp_path / "j.log"))
    found = RobotStudy.open("b", robot.storage.url).settings
    assert found.differences(settings) == []
    assert found.input_noise.bounded
    assert np.allclose(found.input_noise.unit_covariance(BOX), noise.unit_covariance(BOX), rtol=1e-12)
    for _ in range(5):
        asked = robot.ask()
        robot.tell(asked.id, quality(asked.parameters))
    mixed = SearchSpace({"dx": (-0.05, 0.05), "c": CategoricalDistribution("ab")})
    spread = noise_of_coordinates(sh.InputNoise.uniform({"dx": 0.003}), mixed.box)
    assert spread.bounded
    assert np.diag(spread.unit_covariance(mixed.box)) == pytest.approx([0.0003, 0.0, 0.0])
    varying = sh.InputNoise.varying(lambda x: {"dx": 0.001, "dy": 0.001})
    with pytest.raises(InputError, match="cannot be stored"):
        StudySettings(SearchSpace(BOX), varying)
    sampler = sh.Sampler(BOX, input_noise=varying, n_initial=3)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    for _ in range(5):
        trial = study.ask(SearchSpace(BOX).distributions)
        study.tell(trial, quality(trial.params))


def test_a_study_of_a_newer_version_is_refused(robot):
    robot.study.set_user_attr("surehold:settings", SETTINGS.to_json() | {"version": 99})
    with pytest.raises(InputError, match="newer version of surehold"):
        again(robot)


def test_damaged_settings_are_named(robot):
    robot.study.set_user_attr("surehold:settings", SETTINGS.to_json() | {"parameters": {"dx": None}})
    with pytest.raises(InputError, match=r"settings of study .* are damaged"):
        again(robot)


def test_a_study_that_is_not_ours_is_refused(url):
    from surehold.studies.storage import open_storage

    storage = open_storage(url, "theirs", create=True)
    OPENED.append(storage)
    optuna.create_study(study_name="theirs", storage=storage.backend)
    with pytest.raises(InputError, match="not created by surehold"):
        RobotStudy.open("theirs", url)
    with pytest.raises(InputError, match="there are theirs"):
        RobotStudy.open("mug", url)


def test_names_and_settings_that_cannot_be(tmp_path):
    for name in ("", "../x", "a/b", "a..b", ".hidden", "a b", "x" * 101, "ä", "a\n"):
        with pytest.raises(InputError, match="study name"):
            RobotStudy.create(name, SETTINGS, str(tmp_path / "j.log"))
    with pytest.raises(InputError, match="no parameter"):
        StudySettings(SearchSpace(BOX), units={"dz": "m"})
    with pytest.raises(InputError, match="criterion"):
        StudySettings(SearchSpace(BOX), optimizer={"criterion": "best"})
    assert not (tmp_path / "j.log").exists()


def test_what_was_reached_outside_the_ranges_is_learnt_from_where_it_was(tmp_path):
    """A loop of a robot that strays leaves the box now and then; nothing is refused, and nothing moved inside."""
    from surehold.studies.status import to_csv
    from surehold.studies.warm_start import import_trials, trials_of_csv

    space = SearchSpace(
        {"dx": (-0.05, 0.05), "n": IntDistribution(2, 5), "force": FloatDistribution(1.0, 100.0, log=True)}
    )
    settings = StudySettings(space, optimizer={"n_initial": 3})
    robot = RobotStudy.create("mug", settings, str(tmp_path / "journal.log"))
    places = [{"dx": 0.0625, "force": 200.0}, {"dx": -0.0625, "n": 1.5}, {"dx": 0.01}]
    for place in places:
        robot.tell(robot.ask().id, -abs(place["dx"]), reached=place)
    history = history_of(robot.trials(), space)
    assert history.reached[:, 0].tolist() == [0.0625, -0.0625, 0.01]
    assert history.reached[1, 1] == 1.5
    assert history.reached[0, 2] == pytest.approx(np.log(200.0))
    assert (np.abs(history.X[:, 0]) <= 0.05).all()
    optimizer = robot.sampler.optimizer(robot.study)
    assert optimizer.posterior is not None
    assert robot.ask().id == 3
    assert robot.recommend().parameters["dx"] == 0.01, "an answer lies inside the ranges"
    (tmp_path / "mug.csv").write_text(to_csv(robot))
    again = RobotStudy.create("again", settings, str(tmp_path / "again.log"))
    import_trials(again, trials_of_csv(str(tmp_path / "mug.csv"), {name: name for name in space.distributions}))
    assert np.array_equal(history_of(again.trials(), space).reached, history.reached)


@pytest.mark.parametrize(
    "reached", [{"dx": float("nan")}, {"dx": "far"}, {"dx": 1e300}, {"dz": 0.0}, {"dx": True}, [0.0]]
)
def test_what_cannot_have_been_reached_is_refused(reached, tmp_path):
    robot = RobotStudy.create("mug", StudySettings(SearchSpace({"dx": (-0.05, 0.05)})), str(tmp_path / "journal.log"))
    with pytest.raises(InputError, match=r"reached|dz"):
        robot.tell(robot.ask().id, 0.5, reached=reached)


def test_a_study_that_minimizes_asks_what_its_mirror_image_asks(tmp_path):
    """Values of the other sign, the same search; every answer in the user's own sign."""
    noise = sh.InputNoise({"dx": 0.003, "dy": 0.003})
    found = {}
    for direction, sign in (("maximize", 1.0), ("minimize", -1.0)):
        settings = StudySettings(SearchSpace(BOX), noise, {}, {"seed": 4, "n_initial": 6}, direction=direction)
        study = RobotStudy.create("mug", settings, str(tmp_path / f"{direction}.log"))
        asked = []
        for _ in range(9):
            trial = study.ask()
            asked.append(trial.parameters)
            study.tell(trial.id, sign * (3.0 + quality(trial.parameters)))
        again = RobotStudy.open("mug", str(tmp_path / f"{direction}.log"))
        assert again.settings.direction == direction
        found[direction] = asked, again.recommend()
        result = result_of(again)
        assert result.y[result.best_index] == found[direction][1].best_value
        assert result.trials[-1].best == found[direction][1].best_value
    (up, best_up), (down, best_down) = found["maximize"], found["minimize"]
    assert up == down
    assert best_down.trial == best_up.trial
    assert best_down.mean == pytest.approx(-best_up.mean, abs=1e-9)
    assert best_down.quantile == pytest.approx(-best_up.quantile, abs=1e-9)


def test_parameters_in_another_order_are_another_study():
    here, there = (StudySettings(SearchSpace(sh.Box(dict.fromkeys(names, (0.0, 1.0))))) for names in ("xy", "yx"))
    assert here.differences(there) == ["order of the parameters: x, y in the study, y, x now"]


def test_a_direction_that_does_not_exist_and_one_that_differs(tmp_path):
    with pytest.raises(InputError, match="direction"):
        StudySettings(SearchSpace(BOX), direction="down")
    url = str(tmp_path / "journal.log")
    RobotStudy.create("mug", StudySettings(SearchSpace(BOX)), url)
    with pytest.raises(InputError, match="direction: maximize in the study, minimize now"):
        RobotStudy.create("mug", StudySettings(SearchSpace(BOX), direction="minimize"), url, resume=True)


def test_what_was_read_once_is_read_again_as_if_anew(robot):
    """Reading goes on from what is known: trials that finish late, stray, fail, and a study that takes its place."""
    space = robot.settings.space
    reader = Reader(space)

    def same():
        kept, anew = reader.read(robot.trials()), history_of(robot.trials(), space)
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(kept, anew, strict=True))
        return kept

    assert len(same().X) == 0
    asked = [robot.ask() for _ in range(5)]
    assert len(same().pending) == 5
    robot.tell(asked[3].id, 0.5)
    robot.tell(asked[1].id, failed=True)
    assert same().numbers.tolist() == [1, 3]
    name = next(iter(asked[0].parameters))
    robot.tell(asked[0].id, 0.1, reached={name: asked[0].parameters[name] + 1e-3})
    found = same()
    assert found.numbers.tolist() == [0, 1, 3]
    assert found.reached[0] != pytest.approx(found.X[0])
    assert np.array_equal(found.reached[1:], found.X[1:])
    robot.tell(asked[4].id, 0.7)
    assert same().numbers.tolist() == [0, 1, 3, 4]
    other = RobotStudy.create("other", SETTINGS, "memory")
    asked = other.ask()
    other.tell(asked.id, 0.3)
    assert reader.read(other.trials()).y.tolist() == [0.3], "the trials of another study were kept"


def test_a_fault_of_the_rig_teaches_nothing_and_the_trial_is_asked_for_again(robot):
    asked = robot.ask("arm")
    other = robot.ask("leg")
    assert robot.tell(asked.id, failed="rig").state == "waiting"
    shown = status(robot)
    assert (shown["waiting"], shown["running"]) == (1, 1)
    assert [pending["state"] for pending in shown["pending"]] == ["waiting", "running"]
    assert shown["pending"][0]["worker_alive"] is None
    assert [row["state"] for row in rows(robot)] == ["waiting", "running"]
    assert robot.next() == asked.parameters != other.parameters
    again = robot.ask("another arm")
    assert (again.id, again.parameters, again.again) == (asked.id, asked.parameters, True)
    assert status(robot)["running"] == 2
    robot.tell(other.id, 0.25)
    robot.tell(again.id, 0.5)
    for id, arguments in ((again.id, {}), (99, {}), (robot.ask().id, {"value": 1.0})):
        with pytest.raises(InputError):
            robot.tell(id, failed="rig", **arguments)
    with pytest.raises(InputError, match="'machine' is unknown"):
        robot.tell(robot.ask().id, failed="machine")
    assert [trial.state.name for trial in robot.trials()] == ["COMPLETE", "COMPLETE", "RUNNING", "RUNNING"]


def test_what_is_asked_next_is_first_what_a_dead_worker_left(robot):
    dead = robot.ask("one", lifetime=0.0)
    time.sleep(0.002)
    assert robot.next() == dead.parameters
    shown = status(robot)
    assert (shown["waiting"], shown["running"], shown["pending"][0]["worker_alive"]) == (1, 0, False)
    robot.set_stop_rule(StopRule(trials=1))
    assert robot.next() == dead.parameters  # as ask, which hands it out after the study has stopped
    assert robot.ask("two", lifetime=60.0).id == dead.id
    with pytest.raises(NothingToAsk, match="budget"):
        robot.next()


def test_a_trial_that_killed_every_worker_is_not_next(robot):
    for _ in range(5):
        dead = robot.ask(lifetime=0.0)
        time.sleep(0.002)
    assert robot.next() != dead.parameters
    assert [t.state for t in robot.trials()] == [TrialState.RUNNING], "a look changed something"


def test_what_is_recommended_can_be_commanded(robot):
    """Where every trial went astray over the border, the nearest place inside is the answer."""
    robot.tell(robot.ask().id, 0.6, reached={"dx": 0.07, "dy": 0.01})
    assert robot.recommend().parameters == pytest.approx({"dx": 0.05, "dy": 0.01})
    robot.tell(robot.ask().id, 0.5)
    assert abs(robot.recommend().parameters["dx"]) <= 0.05


def test_settings_that_no_optimizer_has_are_refused_when_the_study_is_described():
    with pytest.raises(InputError, match="setting of an optimizer 'sed' is unknown; did you mean 'seed'"):
        StudySettings(SearchSpace(BOX), None, {}, {"sed": 0})


@pytest.mark.parametrize("asked", [True, False])
def test_what_was_reached_in_another_unit_is_said(tmp_path, asked):
    settings = StudySettings(SearchSpace({"dx": (-0.05, 0.05), "grip": ["pinch", "power"]}), None, {"dx": "m"})
    study = RobotStudy.create("bench", settings, str(tmp_path / "bench.log"))
    tell, trial = (study.tell, study.ask().id) if asked else (study.add, {"dx": 0.01, "grip": "power"})
    with pytest.warns(UserWarning, match=r"The trial is told to have reached dx = 11, .* -0\.05 to 0\.05") as told:
        tell(trial, 0.4, reached={"dx": 11.0})
    assert told[0].filename == __file__
    study.add({"dx": 0.02, "grip": "power"}, 0.3, reached={"dx": 0.07})
    assert study.recommend().warning.startswith("1 of 2 trials is told to have reached dx = 11")
    study.close()

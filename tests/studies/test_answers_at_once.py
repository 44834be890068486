"""Two processes that answer one trial at once: the second begins while the first is between looking and writing."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from optuna.trial import TrialState

import surehold as sh
from surehold.errors import InputError
from surehold.studies.history import REACHED
from surehold.studies.ledger import VETOED, AnswerRefused, holder_of
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.status import rows

SETTINGS = StudySettings(SearchSpace(sh.Box({"x": (0.0, 1.0)})), optimizer={"n_initial": 4})
BLOCKED = 1.0  # seconds after which a second answer that does not get on counts as waiting for the first


@pytest.fixture
def two(url):
    """The same study, opened twice as two processes would."""
    one = RobotStudy.create("mug", SETTINGS, url)
    other = RobotStudy.open("mug", url)
    yield one, other
    one.close()
    other.close()


def at_once(monkeypatch, first, second, place, late, method="set_trial_state_values"):
    """Return what `second` raised: it begins when `first` calls `method` of `place`, and waits at its own in `late`."""
    arrived, done, running = threading.Event(), threading.Event(), []
    looks = method == "check_trial_is_updatable"  # is interrupted after it, what writes before it

    def interrupt(place, pause):
        original = getattr(place, method)

        def interrupted(*arguments, **named):
            found = original(*arguments, **named) if looks else None
            pause()
            return found if looks else original(*arguments, **named)

        monkeypatch.setattr(place, method, interrupted)

    with ThreadPoolExecutor(1) as pool:
        interrupt(place, lambda: (running.append(pool.submit(second)), arrived.wait(BLOCKED)))
        interrupt(late, lambda: (arrived.set(), done.wait()))
        try:
            first()
        finally:
            done.set()
        return running[0].exception()


def test_what_is_stored_is_of_one_answer(two, monkeypatch):
    one, other = two
    id = one.ask().id
    refused = at_once(
        monkeypatch,
        lambda: one.tell(id, 0.1, reached={"x": 0.1}),
        lambda: other.tell(id, 0.2, reached={"x": 0.2}),
        one.storage.backend,
        other.storage.backend,
    )
    assert isinstance(refused, AnswerRefused)
    trial = one.trials()[id]
    assert (trial.value, trial.user_attrs[REACHED]) == (0.1, {"x": 0.1})


def test_a_refused_veto_leaves_no_reason(two, monkeypatch):
    one, other = two
    id = one.ask().id
    refused = at_once(
        monkeypatch,
        lambda: one.tell(id, 0.1),
        lambda: other.veto(id, "too hot"),
        one.storage.backend,
        other.storage.backend,
    )
    assert isinstance(refused, AnswerRefused)
    assert VETOED not in one.trials()[id].user_attrs
    with pytest.raises(InputError, match=r"finished \(value 0\.1\)"):
        other.veto(id, "too hot")
    assert VETOED not in one.trials()[id].user_attrs
    assert rows(one)[id]["note"] is None


def test_a_database_takes_one_answer(tmp_path, monkeypatch):
    """Optuna looks whether a trial is finished, and writes afterwards."""
    url = f"sqlite:///{tmp_path}/study.db"
    one = RobotStudy.create("mug", SETTINGS, url)
    other = RobotStudy.open("mug", url)
    id = one.ask().id
    database = [study.storage.backend._backend for study in (one, other)]
    refused = at_once(
        monkeypatch,
        lambda: one.tell(id, 0.1),
        lambda: other.tell(id, 0.2),
        database[0],
        database[1],
        "check_trial_is_updatable",
    )
    assert isinstance(refused, AnswerRefused)
    assert [t.value for t in one.trials()] == [0.1]
    one.close()
    other.close()


def test_an_answer_does_not_wait_for_an_ask(two):
    one, other = two
    id = one.ask().id
    with one.storage.handing_out(), ThreadPoolExecutor(1) as pool:  # as while a model is asked
        assert pool.submit(other.tell, id, 0.5).result(60).state == "complete"


def test_a_sign_of_life_does_not_take_a_trial_back(two, monkeypatch):
    """It is handed out to another worker between the sender's look and its writing."""
    one, other = two
    id = one.ask("arm", lifetime=0.0).id
    taken = at_once(
        monkeypatch,
        lambda: one.renew(id, "arm", 60.0),
        lambda: other.ask("leg", lifetime=60.0),
        one.storage.backend,
        other.storage.backend,
        "set_trial_user_attr",
    )
    assert taken is None
    running = [t for t in one.trials() if t.state == TrialState.RUNNING]
    assert [holder_of(t).name for t in running] == ["arm", "leg"]

"""Proposals made ahead: the same points where nothing was told since, none twice, none further behind than said."""

import logging
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

import surehold as sh
from surehold.studies import prepared as module
from surehold.studies.ledger import BEHIND
from surehold.studies.prepared import Prepared
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings

SPACE = SearchSpace({"a": (0.0, 1.0), "b": (-1.0, 1.0)})
SETTINGS = StudySettings(SPACE, sh.InputNoise.unit(0.03), optimizer={"n_initial": 4, "seed": 3})


def value(parameters):
    return -((parameters["a"] - 0.3) ** 2) - abs(parameters["b"])


def told(trials):
    """A study in memory in which so many trials have been asked for and told."""
    study = RobotStudy.create("told", SETTINGS, "memory")
    for _ in range(trials):
        asked = study.ask()
        study.tell(asked.id, value(asked.parameters))
    return study


@pytest.fixture
def crowded():
    """Make the asks of a study take prepared proposals from the first one on, as where many overlap."""
    made = []

    def crowd(study):
        found = Prepared(study)
        found._crowded_until = float("inf")
        found._started()
        found._ready.result()
        made.append(found)
        return found

    yield crowd
    for found in made:
        found.close()


def test_a_single_client_gets_what_the_model_gives():
    study, alone = told(0), told(0)
    asks = Prepared(study)
    for _ in range(9):
        asked, expected = asks.ask("arm"), alone.ask("arm")
        assert asked == expected
        assert asks.ask("arm").again, "told twice after a lost answer"
        study.tell(asked.id, value(asked.parameters))
        alone.tell(asked.id, value(asked.parameters))
    assert asks._child is None, "a process was started that nobody needs"


@pytest.mark.parametrize("trials", [0, 7])
def test_nothing_told_nothing_changed(crowded, trials):
    """Design and model: prepared proposals are, bit for bit, what asks in this process give."""
    asks, alone = crowded(told(trials)), told(trials)
    for _ in range(6):
        assert asks.ask() == alone.ask()
    assert len(asks._queue) == module.AHEAD - 1


def test_the_bound_is_kept_and_written_into_the_trials(crowded, monkeypatch):
    monkeypatch.setattr(module, "AHEAD", 6)
    monkeypatch.setattr(module, "STALENESS", 2)
    study = told(6)
    asks, behind = crowded(study), []
    for _ in range(7):
        asked = asks.ask()
        behind.append(asked.behind)
        assert study.trials()[asked.id].user_attrs.get(BEHIND, 0) == asked.behind
        study.tell(asked.id, value(asked.parameters))
    assert behind == [0, 1, 2, 0, 1, 2, 0]


def test_the_model_is_renewed_while_proposals_wait(crowded, monkeypatch):
    monkeypatch.setattr(module, "AHEAD", 3)
    monkeypatch.setattr(module, "RENEWED", 2)
    study = told(6)
    asks, behind = crowded(study), []
    for _ in range(9):
        asked = asks.ask()
        behind.append(asked.behind)
        study.tell(asked.id, value(asked.parameters))
    # Ordered three asks ahead by a model that is renewed at every second answer.
    assert behind == [0, 1, 2, 3, 2, 3, 2, 3, 2]
    assert len({tuple(t.params.values()) for t in study.trials()}) == 15


def test_a_trial_of_somebody_else_empties_the_queue(crowded):
    study, alone = told(6), told(6)
    asks = crowded(study)
    asks.ask(), alone.ask()
    for each in (study, alone):
        each.add({"a": 0.31, "b": 0.01}, 0.2)
    asked = asks.ask()
    assert asked == alone.ask(), "made without knowing of the trial that was added"
    assert (asked.id, asked.behind) == (8, 0)


def test_many_at_once_get_trials_of_their_own(crowded):
    study = told(6)
    asks, lock, seen = crowded(study), threading.Lock(), []

    def robot(k):
        for _ in range(5):
            asked = asks.ask(f"robot {k}")
            with lock:
                seen.append(asked)
            study.tell(asked.id, value(asked.parameters))

    with ThreadPoolExecutor(12) as pool:
        list(pool.map(robot, range(12)))
    assert sorted(asked.id for asked in seen) == list(range(6, 66))
    assert len({tuple(asked.parameters.values()) for asked in seen}) == 60
    assert max(asked.behind for asked in seen) <= module.STALENESS
    assert all(study.trials()[asked.id].params == asked.parameters for asked in seen)


def test_asks_that_overlap_start_the_process():
    study = told(6)
    asks = Prepared(study)
    with ThreadPoolExecutor(2) as pool:
        with study.storage.handing_out():  # both wait for this thread
            waiting = [pool.submit(asks.ask) for _ in range(2)]
            while asks._asking < 2:
                time.sleep(0.01)
        assert sorted(future.result().id for future in waiting) == [6, 7]
    assert asks._child is not None
    asks.close()


def test_a_process_that_died_is_said_once_and_not_missed(crowded, caplog):
    study, alone = told(6), told(6)
    asks = crowded(study)
    for pid in asks._child._processes:
        os.kill(pid, signal.SIGKILL)
    with caplog.at_level(logging.WARNING, "surehold"):
        for _ in range(3):
            assert asks.ask() == alone.ask()
    assert [r.message.split(" (")[0] for r in caplog.records] == ["no proposals are prepared any more"]

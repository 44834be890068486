"""A worker: takes trials of a study, makes them, tells what came of them, until the study has had enough.

Any number of workers share a study, in as many processes and on as many machines as reach its storage (whose clocks
should agree within the lifetime). A worker says again and again that it is alive; when it has been silent for its
lifetime, the trial that it was making is taken up by another one. A worker's answer is never thrown away because the
storage is busy or away for some minutes.
"""

import os
import socket
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from optuna import logging
from optuna.trial import TrialState

from surehold.errors import InputError
from surehold.optimization.limits import returned_outputs
from surehold.studies.ledger import AnswerRefused, holder_of
from surehold.studies.robot import Asked, NothingToAsk, RobotStudy
from surehold.studies.storage import StorageFailure
from surehold.studies.trial_function import Outcome

__all__ = ["LIFETIME", "work", "worker_name"]

LIFETIME: Final = 120.0  # seconds of silence after which a worker counts as dead
_LONGEST: Final = 1e9  # seconds; for ten times as long no thread can wait
_BEATS: Final = 4  # signs of life in a lifetime
_POLL: Final = 1.0  # seconds between two looks at a study that has nothing to hand out
_PATIENCE: Final = (
    0.5,
    1.0,
    2.0,
    5.0,
    10.0,
    30.0,
    60.0,
    60.0,
    60.0,
    60.0,
)  # pauses before a failing storage is given up

_log = logging.get_logger(__name__)


def worker_name() -> str:
    """Return a name that no other worker has: the host, the process and some random letters."""
    return f"{socket.gethostname()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"


def work(
    study: RobotStudy,
    attempt: Callable[[Mapping[str, Any]], Outcome],
    *,
    name: str | None = None,
    lifetime: float = LIFETIME,
    most: int | None = None,
    before: Callable[[Asked], Any] = lambda asked: None,
    after: Callable[[Asked, Outcome], Any] = lambda asked, outcome: None,
) -> int:
    """Make trials until the study stops, and return how many.

    Where it stops while others are still at their last trials, the worker stays until these have been told, or takes
    them up. While the study is paused it waits.

    Parameters
    ----------
    attempt
        Makes one trial from its parameters, see `trial_function`.
    name
        Of the worker; by default one that no other has.
    lifetime
        Seconds of silence after which it counts as dead; a quarter of it passes between two signs of life.
    most
        Trials that this worker makes at most.
    before, after
        Called with each trial that was handed out, and with what came of it after it was stored.

    Raises
    ------
    StorageFailure
        If the storage was away for five minutes; the message names what could not be stored.
    KeyboardInterrupt
        On Ctrl-C; the trial under way is let go, so that another worker can take it up at once.
    """
    name = name or worker_name()
    if not 0.0 < lifetime <= _LONGEST:
        raise InputError(f"lifetime is {lifetime!r}; give a positive number of seconds, {_LONGEST:g} at most.")
    made, waiting = 0, False
    while most is None or made < most:
        try:
            asked = _patiently(lambda: study.ask(name, lifetime=lifetime), "no trial could be asked for")
        except NothingToAsk as nothing:
            seconds = _until_handed_out(study)
            if not nothing.paused and seconds is None:
                break
            if not waiting and not nothing.paused and seconds is not None and seconds > _POLL:
                _log.warning(
                    "Waiting for the last trials of other workers; those of one that is silent are handed out again "
                    f"in {seconds:.0f} s. Ctrl-C leaves them."
                )
            waiting = True
            time.sleep(_POLL)
            continue
        waiting = False
        before(asked)
        with _alive(study, asked.id, name, lifetime):
            outcome = _tell(study, asked.id, attempt(asked.parameters))
        made += 1
        after(asked, outcome)
    return made


def _tell(study: RobotStudy, id: int, outcome: Outcome) -> Outcome:
    """Store what came of a trial, and return it: a failure where the study cannot take what the function returned."""
    told, wrong = ({}, "") if outcome.failure else returned_outputs(study.limits, outcome.outputs)
    if wrong:
        outcome = Outcome(float("nan"), wrong)
    failed = bool(outcome.failure)
    value = None if failed else outcome.value
    said = "failed" if failed else f"value {value!r}"
    try:
        _patiently(
            lambda: study.tell(id, value, failed=failed, constraints=dict(told) or None),
            f"trial {id} ({said}) could not be stored",
        )
    except StorageFailure:
        raise
    except AnswerRefused as error:  # another worker had taken the trial up, and was quicker
        _log.warning(f"{error} (answer of this worker: {said})")
    except InputError as error:  # it would be handed out again and again
        if failed:
            raise
        return _tell(study, id, Outcome(float("nan"), str(error).rstrip(".")))
    if failed:
        _log.info(f"trial {id} failed: {outcome.failure}")
    return outcome


def _until_handed_out(study: RobotStudy) -> float | None:
    """Return the seconds until the first trial under way is handed out again, None where none will be."""
    holders = [holder_of(trial) for trial in study.trials() if trial.state == TrialState.RUNNING]
    ends = [holder.until for holder in holders if holder is not None and holder.until is not None]
    return max(min(ends) - time.time(), 0.0) if ends else None


def _patiently(call: Callable[[], Any], otherwise: str) -> Any:
    for pause in _PATIENCE:
        try:
            return call()
        except StorageFailure as failure:
            _log.warning(f"{otherwise} yet: {failure} Trying again in {pause:g} s.")
            time.sleep(pause)
    try:
        return call()
    except StorageFailure as failure:
        raise StorageFailure(f"{otherwise}: {failure}") from failure


@contextmanager
def _alive(study: RobotStudy, id: int, name: str, lifetime: float) -> Iterator[None]:
    """Give signs of life while the block runs; let go of the trial where it is interrupted."""
    over = threading.Event()

    def beat() -> None:
        while not over.wait(lifetime / _BEATS):
            try:
                study.renew(id, name, lifetime)
            except InputError as error:  # the storage is away: the next beat may reach it
                _log.warning(f"no sign of life could be stored: {error}")

    thread = threading.Thread(target=beat, name=f"surehold-alive-{id}", daemon=True)
    thread.start()
    try:
        yield
    except KeyboardInterrupt:
        over.set()
        thread.join()
        try:
            study.renew(id, name, 0.0)
        except InputError as error:
            _log.warning(f"trial {id} could not be let go; others take it up when this worker is dead: {error}")
        raise
    finally:
        over.set()
        thread.join()

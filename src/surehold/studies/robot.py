"""A study whose trials are made elsewhere: by a robot, a person, a worker. Ask for a trial, tell what came of it.

Whatever is answered has been stored before: a trial handed out, a value taken. The first answer to a trial counts,
whoever gives it; the same answer again is harmless, another one is refused. So an answer that comes late, from a worker
believed dead, is accepted as long as the one that took the trial up again has not answered.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from optuna import logging
from optuna.trial import FrozenTrial, TrialState

from surehold.errors import InputError, SureholdError, unknown_name
from surehold.optimization.limits import checked_outputs
from surehold.studies.history import EXECUTIONS, OUTPUTS, REACHED, parameters_of
from surehold.studies.ledger import BEHIND, HOLDER, NOTE, PROMISE, Holder, Told, attempts_of_next, checked_value, waits
from surehold.studies.opened import OpenedStudy
from surehold.studies.recommendation import StudyRecommendation, find_recommendation, written
from surehold.studies.storage import StorageFailure
from surehold.studies.success import answer

__all__ = ["Asked", "NothingToAsk", "RobotStudy"]

_log: Final = logging.get_logger(__name__)

Proposals = Callable[[list[FrozenTrial]], tuple[dict[str, Any], int] | None]


class NothingToAsk(SureholdError):
    """No trial is handed out: the study is `paused`, or its stop rule says that it has had enough."""

    def __init__(self, message: str, *, paused: bool):
        super().__init__(message)
        self.paused: Final = paused


@dataclass(frozen=True)
class Asked:
    """A trial to be made."""

    id: int
    """its number in the study, 0 for the first"""
    parameters: dict[str, Any]
    units: dict[str, str]
    """unit of each parameter that has one"""
    again: bool
    """whether it has been handed out before"""
    pose: dict[str, Any] | None = None
    """of the palm in the object's frame, where the study is about a shape that is touched"""
    behind: int = 0
    """told answers that the model of this trial did not know, see `surehold.studies.prepared`"""


class RobotStudy(OpenedStudy):
    """A stored study, opened; see `create` and `open`."""

    # --- asking ---------------------------------------------------------------------------------------------------

    def ask(
        self, worker: str | None = None, *, lifetime: float | None = None, prepared: Proposals | None = None
    ) -> Asked:
        """Hand out a trial.

        Parameters
        ----------
        worker
            Who will make it. Where that one holds a trial that it has not told yet, it gets the same one again: to ask
            a second time after a crash, or after an answer that never arrived, is harmless.
        lifetime
            Seconds for which the worker counts as alive, see `renew`; a trial whose worker is dead is handed out
            again before any new one. None: forever.
        prepared
            Gives, of all trials, the parameters of a new one and how many told answers they are behind, or None where
            the model is to be asked; see `surehold.studies.prepared`.

        Raises
        ------
        NothingToAsk
            If the study is paused or has stopped. Trials of dead workers are handed out even after it has stopped.
        """
        with self.storage.failures(), self.storage.handing_out():
            now = time.time()  # not before the lock, which others may have held for as long as a worker lives
            self._refuse_paused()
            with self.storage.answering():
                trials = self._ledger.trials()
                trial = self._ledger.held(trials, worker) or self._ledger.orphan(trials, now)
                if trial is not None:
                    self._ledger.hold(trial, Holder.from_now(worker, lifetime, attempts_of_next(trial, now)))
                    return self._asked(trial, True)
            promise = self._refuse_stopped(trials, now)
            if any(t.state == TrialState.WAITING for t in trials):  # enqueued by Optuna's means
                with self.storage.answering():  # or a veto of it may be lost
                    trial = self._ledger.trial(self.study.ask(self.settings.space.distributions).number)
                    self._ledger.hold(trial, Holder.from_now(worker, lifetime))
            else:
                found = None if prepared is None else prepared(trials)
                parameters, behind = found or (self._suggested(trials), 0)
                marks: dict[str, Any] = {HOLDER: Holder.from_now(worker, lifetime)} | (
                    {} if promise is None else {PROMISE: promise}
                )
                marks |= {BEHIND: behind} if behind else {}
                trial = self._ledger.store(TrialState.RUNNING, parameters, marks)
            return self._asked(trial, False)

    def renew(self, id: int, worker: str, lifetime: float) -> None:
        """Say that a worker is alive for `lifetime` more seconds; 0 lets its trial be taken up at once."""
        with self.storage.failures(), self.storage.answering():
            self._ledger.renew(id, worker, lifetime)

    def next(self) -> dict[str, Any]:
        """Return the parameters that `ask` would hand out now to somebody who holds no trial, and change nothing.

        Raises
        ------
        NothingToAsk
            As `ask` does.
        """
        now = time.time()
        with self.storage.failures():
            self._refuse_paused()
            trials = self._ledger.trials()
            again = next((t for t in trials if t.state == TrialState.RUNNING and waits(t, now)), None)
            if again is not None:
                return parameters_of(again)
            self._refuse_stopped(trials, now)
            for trial in trials:
                if trial.state == TrialState.WAITING and self.settings.space.contains(parameters_of(trial)):
                    return parameters_of(trial)
            return self._suggested(trials)

    # --- telling --------------------------------------------------------------------------------------------------

    def tell(
        self,
        id: int,
        value: Any = None,
        *,
        failed: bool | Literal["rig"] = False,
        reached: Mapping[str, Any] | None = None,
        constraints: Mapping[str, Any] | None = None,
        contacts: Mapping[str, Any] | None = None,
        successes: int | None = None,
        of: int | None = None,
    ) -> Told:
        """Take the answer to a trial: its value, or that it gave nothing.

        Parameters
        ----------
        id
            Of the trial, as `ask` gave it.
        value
            Finite, in the study's direction. Of a study about success: "success", "failure", True, False, or "7/10".
        failed
            True: the trial gave nothing, and has no value. "rig": the place is not at fault; nothing is learnt, and the
            trial is handed out again, to whoever asks first.
        reached
            The parameters that were truly reached, all of them or those that differ; they may lie outside the ranges.
        constraints
            Further outputs, as in `Optimizer.tell`.
        contacts
            What the hand touched, of a study about an unknown shape:
            `{"contacts": [{"point": [x, y, z], "normal": [x, y, z]}, ...], "free": [[x, y, z, radius], ...]}` in the
            object's frame [m], normals outward; `free` is space without the object, and may be left out.
        successes, of
            In place of the value, of a study about success: so many successes of so many executions.

        Raises
        ------
        InputError
            If there is no such trial, contacts are refused, the value or what was reached is not finite, successes are
            no count or come with a value, or the trial was told something else before. What was told before stays.
        """
        if failed not in (False, True, "rig"):
            raise unknown_name("kind of failure", failed, ("True", "rig"))
        with self.storage.failures():
            if failed == "rig":
                checked_value(value, failed=True)
                with self.storage.answering():
                    return self._ledger.let_go(id)
            if contacts is not None:
                if self._touched is None:
                    raise InputError(
                        f"study '{self.name}' is not about a shape that is touched; leave contacts out, or create one "
                        "with: surehold explore --box x,y,z --study NAME."
                    )
                contacts = self._touched.checked(contacts, self._ledger.trials())
            outputs = self._checked(constraints, bool(failed))
            share, executions = answer(self.settings.optimizer, value, successes, of)
            with self.storage.answering():
                return self._ledger.tell(id, share, bool(failed), reached, outputs, contacts, executions)

    def _checked(self, constraints: Mapping[str, Any] | None, failed: bool) -> dict[str, float]:
        values = checked_outputs(self.limits, constraints, failed)
        return {limit.name: value for limit, value in zip(self.limits, values, strict=True) if np.isfinite(value)}

    def add(
        self,
        parameters: Mapping[str, Any],
        value: Any = None,
        *,
        failed: bool = False,
        reached: Mapping[str, Any] | None = None,
        constraints: Mapping[str, Any] | None = None,
        note: str = "added by hand",
        successes: int | None = None,
        of: int | None = None,
    ) -> int:
        """Store a trial that was made without being asked for, and return its id; arguments as in `tell`."""
        share, executions = answer(self.settings.optimizer, value, successes, of)
        number = checked_value(share, failed)
        commanded = self.settings.space.check(parameters)
        marks: dict[str, Any] = {NOTE: note}
        if reached is not None:
            marks[REACHED] = self.settings.space.check_reached(commanded, reached)
            self.settings.space.warn_if_astray(marks[REACHED], 1)
        outputs = self._checked(constraints, failed)
        if outputs:
            marks[OUTPUTS] = outputs
        if executions != 1:
            marks[EXECUTIONS] = executions
        state = TrialState.FAIL if failed else TrialState.COMPLETE
        with self.storage.failures(), self.storage.handing_out():
            return self._ledger.store(state, commanded, marks, number).number

    def veto(self, id: int, reason: str = "") -> None:
        """Forbid a trial that has been handed out or waits; the model avoids it as it does a failed one.

        Raises
        ------
        InputError
            If there is no such trial, or it is finished.
        """
        with self.storage.failures(), self.storage.answering():
            self._ledger.veto(id, reason or "no reason given")

    @property
    def touches(self) -> bool:
        """Whether the study is about a shape that is not known, of which trials tell contacts."""
        return self._touched is not None

    # --- looking --------------------------------------------------------------------------------------------------

    def recommend(self, *, write: bool = True) -> StudyRecommendation:
        """Return the safe answer, and write it into the study; see `surehold.studies.recommend`.

        Where the storage cannot be written (a copy on a medium for reading, a full disk) that is said, no more.
        """
        with self.storage.failures():
            if self._touched is not None:
                found = self._touched.recommend(self._ledger.trials(), self.settings.space)
            else:
                found = find_recommendation(self.study, self.sampler)
        if write:
            try:
                with self.storage.failures():
                    written(self.study, found)
            except StorageFailure as failure:
                _log.warning(f"The answer is not noted in study '{self.name}': {failure}")
        return found

    def trials(self) -> list[FrozenTrial]:
        """Return all trials as Optuna stores them, by number; not to be changed."""
        with self.storage.failures():
            return self._ledger.trials()

    # --- inside ---------------------------------------------------------------------------------------------------

    def _refuse_paused(self) -> None:
        reason = self.paused
        if reason is not None:
            raise NothingToAsk(f"study '{self.name}' is paused ({reason}); resume it first.", paused=True)

    def _refuse_stopped(self, trials: list[FrozenTrial], now: float) -> float | None:
        """Return what the next trial promises, where the stop rule asks for that."""
        reason, promise = self._stop_reason(trials, now)
        if reason:
            message = (
                f"study '{self.name}' has stopped: {reason}. To go on change its stop rule: "
                f"surehold study stop {self.name}, with another --trials, or without options to ask without end."
            )
            raise NothingToAsk(message, paused=False)
        return promise

    def _suggested(self, trials: list[FrozenTrial]) -> dict[str, Any]:
        if self._touched is not None:
            return self._touched.suggest(trials, self.settings.space)
        return self.sampler.suggest(trials, len(trials), self.settings.direction)

    def _asked(self, trial: FrozenTrial, again: bool) -> Asked:
        parameters = {name: trial.params[name] for name in self.settings.space.distributions}
        pose = None if self._touched is None else self._touched.pose(parameters)
        return Asked(trial.number, parameters, dict(self.settings.units), again, pose, trial.user_attrs.get(BEHIND, 0))

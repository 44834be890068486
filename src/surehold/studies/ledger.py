"""The stored trials of one study: who makes each, and what came of it. Every operation is whole or did not happen.

Those that change a trial because of what it was need `Storage.answering`; `store` needs `Storage.handing_out`.
"""

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final, NamedTuple

import numpy as np
from optuna.exceptions import UpdateFinishedTrialError
from optuna.storages import BaseStorage
from optuna.trial import FrozenTrial, TrialState, create_trial

from surehold.errors import InputError
from surehold.studies.history import CONTACTS, EXECUTIONS, OUTPUTS, REACHED
from surehold.studies.search_space import SearchSpace

__all__ = [
    "BEHIND",
    "HOLDER",
    "NOTE",
    "PROMISE",
    "VETOED",
    "AnswerRefused",
    "Holder",
    "Ledger",
    "Told",
    "UnknownTrial",
    "abandoned",
    "answer_of",
    "attempts_of_next",
    "checked_value",
    "holder_of",
    "waits",
]

#: Trial attributes: who makes the trial (a `Holder`), what the model expected to gain, how the trial came about, why it
#: was forbidden, how many told answers its model did not know.
HOLDER: Final = "surehold:holder"
PROMISE: Final = "surehold:promise"
NOTE: Final = "surehold:note"
VETOED: Final = "surehold:vetoed"
BEHIND: Final = "surehold:behind"

_ATTEMPTS: Final = 5  # a trial that has taken so many workers with it counts as failed
_LARGEST: Final = 1e100  # magnitude of a value; squares and variances of larger ones overflow


class UnknownTrial(InputError):
    """There is no trial of that id."""


class AnswerRefused(InputError):
    """The trial was told something else before, or is not in a state in which it can be told or vetoed."""


class Holder(NamedTuple):
    """Who makes a trial."""

    name: str
    until: float | None
    """seconds since 1970 until which the holder counts as alive; None: forever"""
    attempts: int
    """holders that the trial was handed out to, one after the other's death; those that let it go do not count"""

    @classmethod
    def from_now(cls, name: str | None, lifetime: float | None, attempts: int = 1) -> "Holder":
        """Return a holder who counts as alive for so many seconds, None forever, from this moment on."""
        return cls(name or "", None if lifetime is None else time.time() + lifetime, attempts)


@dataclass(frozen=True)
class Told:
    """An answer that was taken."""

    id: int
    state: str
    """"complete", "failed", or "waiting" for a trial that is asked for again"""
    value: float | None
    already: bool
    """whether the same answer had been given before"""
    of: int = 1
    """executions of which the value is the share that succeeded"""


class Ledger:
    """The trials of the study `name` in a storage of Optuna, with the parameters `space`."""

    def __init__(self, backend: BaseStorage, name: str, space: SearchSpace):
        self._backend = backend
        self._name = name
        self._study_id = backend.get_study_id_from_name(name)
        self._space = space

    def trials(self) -> list[FrozenTrial]:
        """Return all trials by number; not to be changed."""
        return self._backend.get_all_trials(self._study_id, deepcopy=False)

    def trial(self, id: int) -> FrozenTrial:
        """Return one trial; raises InputError where it does not exist."""
        if isinstance(id, bool) or not isinstance(id, int) or id < 0:
            raise InputError(f"trial id is {id!r}; give the whole number that ask gave, 0 or more.")
        n = self._backend.get_n_trials(self._study_id)
        if id >= n:
            there = f"the last one is {n - 1}" if n else "none has been asked for"
            raise UnknownTrial(f"trial {id} is not in study '{self._name}'; {there}.")
        return self._backend.get_trial(self._backend.get_trial_id_from_study_id_trial_number(self._study_id, id))

    def store(
        self, state: TrialState, parameters: dict[str, Any], marks: dict[str, Any], value: float | None = None
    ) -> FrozenTrial:
        """Store a whole trial in one operation, and return it."""
        template = create_trial(
            state=state, params=parameters, distributions=self._space.distributions, user_attrs=marks, value=value
        )
        return self._backend.get_trial(self._backend.create_new_trial(self._study_id, template_trial=template))

    # --- who makes a trial ----------------------------------------------------------------------------------------

    def hold(self, trial: FrozenTrial, holder: Holder) -> None:
        """Store who makes a trial; nothing happens where it is finished by now."""
        with suppress(UpdateFinishedTrialError):
            self._backend.set_trial_user_attr(trial._trial_id, HOLDER, holder)

    def renew(self, id: int, name: str, lifetime: float) -> None:
        """Store that the holder of that name is alive for `lifetime` more seconds, where it still holds the trial.

        With 0 it has let the trial go, which was not what ended it: this attempt does not count.
        """
        trial = self.trial(id)
        holder = holder_of(trial)
        if trial.state == TrialState.RUNNING and holder is not None and holder.name == name:
            attempts = holder.attempts if lifetime else max(holder.attempts - 1, 0)
            self.hold(trial, Holder.from_now(name, lifetime, attempts))

    def held(self, trials: list[FrozenTrial], name: str | None) -> FrozenTrial | None:
        """Return the running trial that the holder of that name has, if any."""
        running = [t for t in trials if t.state == TrialState.RUNNING]
        return next((t for t in running if name and (h := holder_of(t)) is not None and h.name == name), None)

    def orphan(self, trials: list[FrozenTrial], now: float) -> FrozenTrial | None:
        """Return the first running trial whose holder is dead; one that has killed too many is failed instead."""
        for trial in trials:
            if not abandoned(trial, now):
                continue
            if _may_be_made(trial):
                return trial
            with suppress(UpdateFinishedTrialError):
                note = f"{_attempts(trial)} workers died of it; counted as failed"
                self._backend.set_trial_user_attr(trial._trial_id, NOTE, note)
                self._backend.set_trial_state_values(trial._trial_id, TrialState.FAIL)
        return None

    # --- what came of it ------------------------------------------------------------------------------------------

    def tell(
        self,
        id: int,
        value: Any,
        failed: bool,
        reached: Mapping[str, Any] | None,
        outputs: Mapping[str, float] | None = None,
        contacts: Mapping[str, Any] | None = None,
        executions: int = 1,
    ) -> Told:
        """Store an answer; see `RobotStudy.tell`."""
        number = checked_value(value, failed)
        trial = self.trial(id)
        actual = None if reached is None else self._space.check_reached(trial.params, reached)
        if trial.state == TrialState.WAITING:
            raise AnswerRefused(f"trial {id} has not been handed out yet; ask for it first.")
        state = "failed" if number is None else "complete"
        if not trial.state.is_finished():
            try:
                if actual is not None or REACHED in trial.user_attrs:  # left by a teller that died before its answer
                    self._backend.set_trial_user_attr(trial._trial_id, REACHED, actual or trial.params)
                if outputs or OUTPUTS in trial.user_attrs:
                    self._backend.set_trial_user_attr(trial._trial_id, OUTPUTS, dict(outputs or {}))
                if contacts is not None or CONTACTS in trial.user_attrs:
                    self._backend.set_trial_user_attr(trial._trial_id, CONTACTS, contacts)
                if executions != 1 or EXECUTIONS in trial.user_attrs:
                    self._backend.set_trial_user_attr(trial._trial_id, EXECUTIONS, executions)
                if number is None:
                    self._backend.set_trial_state_values(trial._trial_id, TrialState.FAIL)
                else:
                    self._backend.set_trial_state_values(trial._trial_id, TrialState.COMPLETE, [number])
                if actual is not None:
                    self._space.warn_if_astray(actual, 2)  # beyond `RobotStudy.tell`
                return Told(id, state, number, False, executions)
            except UpdateFinishedTrialError:  # somebody else was quicker
                trial = self.trial(id)
        before = answer_of(trial)
        now = "failed" if number is None else f"value {number!r}"
        elsewhere = actual is not None and actual != trial.user_attrs.get(REACHED, trial.params)
        otherwise = bool(outputs) and outputs != trial.user_attrs.get(OUTPUTS, {})
        touched = contacts is not None and contacts != trial.user_attrs.get(CONTACTS)
        of = trial.user_attrs.get(EXECUTIONS, 1)
        if before != now or elsewhere or otherwise or touched or of != executions:
            differing = ", reached elsewhere" * elsewhere + ", with other outputs" * otherwise
            differing += ", with other contacts" * touched + f", of {executions} executions, not {of}" * (
                of != executions
            )
            raise AnswerRefused(
                f"trial {id} was told before: {before}; now: {now}{differing}. The first "
                "answer counts; add the other one as a trial of its own if it was made."
            )
        return Told(id, state, number, True, executions)

    def let_go(self, id: int) -> Told:
        """Store that a trial is to be made again, whoever asks first, since it was not the place that failed."""
        trial = self.trial(id)
        if trial.state != TrialState.RUNNING:
            what = answer_of(trial) if trial.state.is_finished() else "has not been handed out"
            raise AnswerRefused(f"trial {id} is not under way ({what}); a fault of the rig is told of one that is.")
        self.hold(trial, Holder("", 0.0, 0))
        return Told(id, "waiting", None, False)

    def veto(self, id: int, reason: str) -> None:
        """Store that a trial must not be made; see `RobotStudy.veto`."""
        trial = self.trial(id)
        if trial.state.is_finished():  # before anything is written: SQLite would take the reason
            self._vetoed(trial)
            return
        try:
            self._backend.set_trial_user_attr(trial._trial_id, VETOED, reason)
            self._backend.set_trial_state_values(trial._trial_id, TrialState.FAIL)
        except UpdateFinishedTrialError:  # somebody else was quicker, by Optuna's means
            self._vetoed(self.trial(id))

    def _vetoed(self, trial: FrozenTrial) -> None:
        if VETOED not in trial.user_attrs or trial.state != TrialState.FAIL:
            raise AnswerRefused(
                f"trial {trial.number} is finished ({answer_of(trial)}); only a pending one can be vetoed."
            )


def holder_of(trial: FrozenTrial) -> Holder | None:
    """Return who makes a trial; None where nobody said."""
    stored = trial.user_attrs.get(HOLDER)
    return None if stored is None else Holder(*stored)


def abandoned(trial: FrozenTrial, now: float) -> bool:
    """Tell whether a trial that was handed out was let go, or its holder is dead."""
    holder = holder_of(trial) if trial.state == TrialState.RUNNING else None
    return holder is not None and holder.until is not None and now > holder.until


def waits(trial: FrozenTrial, now: float) -> bool:
    """Tell whether a trial waits to be handed out, for the first time or again."""
    return trial.state == TrialState.WAITING or (abandoned(trial, now) and _may_be_made(trial))


def attempts_of_next(trial: FrozenTrial, now: float) -> int:
    """Return the attempts of a trial that is handed out again: one that a living holder asks for again is the same."""
    return max(_attempts(trial) + abandoned(trial, now), 1)


def _attempts(trial: FrozenTrial) -> int:
    holder = holder_of(trial)
    return 0 if holder is None else holder.attempts


def _may_be_made(trial: FrozenTrial) -> bool:
    return _attempts(trial) < _ATTEMPTS


def answer_of(trial: FrozenTrial) -> str:
    """Return in words what a finished trial was told."""
    if VETOED in trial.user_attrs and trial.state == TrialState.FAIL:  # not where an answer was quicker than the veto
        return f"vetoed ({trial.user_attrs[VETOED]})"
    return f"value {trial.values[0]!r}" if trial.state == TrialState.COMPLETE and trial.values else "failed"


def checked_value(value: Any, failed: bool) -> float | None:
    """Return the value of a trial, None of a failed one; raises InputError where it is not one finite number."""
    if failed:
        if value is not None:
            raise InputError(f"a failed trial has no value, but {value!r} was told; leave one of the two out.")
        return None
    if value is None:
        raise InputError("the trial has no value; tell one, or that it failed.")
    try:
        number = float("nan") if isinstance(value, bool) or np.iscomplexobj(value) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if not isfinite(number):
        raise InputError(f"value is {str(value)[:60]!r}; tell one finite number, or that the trial failed.")
    if abs(number) > _LARGEST:
        raise InputError(f"value is {number:g}, of which no model can be made; tell it in another unit, or as failed.")
    return number

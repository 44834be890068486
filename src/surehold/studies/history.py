"""What the stored trials of a study say to the optimizer, whoever wrote them.

    state in Optuna                     for the optimizer
    COMPLETE, or PRUNED with a value    told; failed where the value is not finite
    FAIL, or PRUNED without a value     failed: it counts as the lowest value told, so that it is avoided
    FAIL, and later retried             nothing: its worker died, and the retried trial stands for it
    RUNNING                             pending, once its parameters are known
    WAITING                             pending, where all of its parameters are set

Trials outside of the search space (other parameters, other ranges) are left out.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from optuna.trial import FrozenTrial, TrialState

from surehold.errors import InputError
from surehold.optimization.success import MOST_EXECUTIONS
from surehold.optimization.values import LARGEST, LARGEST_SQUARED
from surehold.studies.search_space import SearchSpace

__all__ = ["CONTACTS", "EXECUTIONS", "OUTPUTS", "REACHED", "History", "Reader", "history_of", "parameters_of"]

_DAMAGE: Final = (AttributeError, LookupError, OverflowError, TypeError, ValueError)

#: Trial attribute that holds the parameters that were truly reached.
REACHED: Final = "surehold:reached"
#: Trial attribute that holds the further outputs; an attribute of an output's own name does, too.
OUTPUTS: Final = "surehold:outputs"
#: Trial attribute that holds of how many executions the value is the share that succeeded; 1 where it is missing.
EXECUTIONS: Final = "surehold:executions"
#: Trial attribute that holds what a hand touched, as problems/grasp/told_contacts.py describes it.
CONTACTS: Final = "surehold:contacts"


class History(NamedTuple):
    """The trials of a study, in the order of their numbers."""

    X: NDArray[np.float64]
    """commanded inputs (t, d), in the units of the search space's box"""
    y: NDArray[np.float64]
    """values (t,) as they were told; NaN for failed trials"""
    reached: NDArray[np.float64]
    """inputs truly reached (t, d), inside the box or not"""
    pending: NDArray[np.float64]
    """inputs under way (p, d)"""
    numbers: NDArray[np.intp]
    """numbers of the told trials (t,)"""
    outputs: NDArray[np.float64]
    """further outputs (t, o); NaN where one was not measured"""
    executions: NDArray[np.intp]
    """executions (t,) of which the value is the share that succeeded, 1 or more"""


def history_of(
    trials: Iterable[FrozenTrial],
    space: SearchSpace,
    number: int | None = None,
    outputs: Sequence[str] = (),
) -> History:
    """Return what the trials say, the one with that number (the one being asked for) left out.

    `outputs` are the names of further outputs.
    """
    return Reader(space, outputs).read(trials, number)


class Reader:
    """Reads what the trials of a study say; what a finished one says is kept, for it does not change any more."""

    def __init__(self, space: SearchSpace, outputs: Sequence[str] = ()):
        self._space: Final = space
        self._outputs: Final = tuple(outputs)
        self._forget()

    def _forget(self) -> None:
        self._known: dict[int, FrozenTrial] = {}
        self._retried: set[int] = set()
        d = self._space.encode_all([]).shape[1]
        none, whole = np.empty((0, d)), np.empty(0, dtype=np.intp)
        self._told = History(none, np.empty(0), none, none, whole, np.empty((0, len(self._outputs))), whole)

    def read(self, trials: Iterable[FrozenTrial], number: int | None = None) -> History:
        """Return what all trials of the study say, as `history_of` does.

        Raises
        ------
        InputError
            For a trial that holds what no trial of ours does: the storage was altered by hand, or is damaged.
        """
        trials = list(trials)
        try:
            return self._read(trials, number)
        except _DAMAGE as error:
            which = self._damaged(trials)
            raise InputError(f"{which} of the study is damaged ({error}); restore a copy of the storage.") from error

    def _damaged(self, trials: Sequence[FrozenTrial]) -> str:
        for trial in trials:
            self._forget()
            try:
                self._read([trial])
            except _DAMAGE:
                self._forget()
                return f"trial {trial.number}"
        self._forget()
        return "a trial"

    def _read(self, trials: list[FrozenTrial], number: int | None = None) -> History:
        fresh = [trial for trial in trials if self._known.get(trial.number) is not trial]
        if len(trials) - len(fresh) != len(self._known):  # of another study, or copies
            self._forget()
            fresh = trials
        fresh.sort(key=lambda trial: trial.number)
        finished = [trial for trial in fresh if trial.state.is_finished()]
        pending = [trial for trial in fresh if not trial.state.is_finished()]
        self._known |= {trial.number: trial for trial in finished}
        self._retried |= _retried(finished)
        self._add([trial for trial in finished if self._space.contains(trial.params)])
        told = self._told
        left_out = self._retried | _retried(pending) | ({number} if number is not None else set())
        rows = np.argsort(told.numbers, kind="stable")
        rows = rows[~np.isin(told.numbers[rows], list(left_out))]
        under_way = [parameters_of(trial) for trial in pending if trial.number not in left_out]
        return History._make(each[rows] for each in told)._replace(
            pending=self._space.encode_all([p for p in under_way if self._space.contains(p)])
        )

    def _add(self, trials: Sequence[FrozenTrial]) -> None:
        """Take in finished trials of this space."""
        if not trials:
            return
        space, told = self._space, self._told
        y = np.full(len(trials), np.nan)
        outputs = np.empty((len(trials), len(self._outputs)))
        executions = np.ones(len(trials), dtype=np.intp)
        strayed: dict[int, dict[str, Any]] = {}
        for i, trial in enumerate(trials):
            if trial.state != TrialState.FAIL and trial.values and abs(trial.values[0]) <= LARGEST:
                y[i] = trial.values[0]
                of = trial.user_attrs.get(EXECUTIONS, 1)
                executions[i] = of if type(of) is int and 0 < of <= MOST_EXECUTIONS else 1
            actual = trial.params | trial.user_attrs.get(REACHED, {})
            if actual != trial.params and space.encodes(actual):
                strayed[i] = actual
            if self._outputs:
                attributes = trial.user_attrs | trial.user_attrs.get(OUTPUTS, {})
                outputs[i] = [_finite(attributes.get(name)) for name in self._outputs]
        commanded = [trial.params for trial in trials]
        X = space.encode_all(commanded)
        reached = space.encode_all(commanded, anywhere=True)
        if strayed:
            reached[list(strayed)] = space.encode_all(list(strayed.values()), anywhere=True)
        numbers = np.array([trial.number for trial in trials], dtype=np.intp)
        new = History(X, y, reached, np.empty_like(X), numbers, outputs, executions)
        self._told = History._make(map(np.concatenate, zip(told, new, strict=True)))


def _retried(trials: Iterable[FrozenTrial]) -> set[int]:
    return {k for trial in trials for k in trial.system_attrs.get("retry_history", ())}


def _finite(value: Any) -> float:
    """Return a number; NaN of what is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= LARGEST_SQUARED:
        return np.nan
    return float(value)


def parameters_of(trial: FrozenTrial) -> dict[str, Any]:
    """Return the parameters of a trial; of one that waits, or has just been begun, those that it will have."""
    if trial.state.is_finished():
        return dict(trial.params)
    return trial.system_attrs.get("fixed_params", {}) | trial.params

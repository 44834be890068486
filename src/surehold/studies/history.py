"""What the stored trials of a study say to the optimizer, whoever wrote them.

    state in Optuna                     for the optimizer
    COMPLETE, or PRUNED with a value    told; failed where no model can be made of the value
    FAIL, or PRUNED without a value     failed: it counts as the lowest value told, so that it is avoided
    FAIL, and later retried             nothing: its worker died, and the retried trial stands for it
    RUNNING                             pending, once its parameters are known
    WAITING                             pending, where all of its parameters are set

Trials outside of the search space (other parameters, other ranges) are left out.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from optuna.trial import FrozenTrial, TrialState

from surehold.errors import InputError
from surehold.optimization.success import MOST_EXECUTIONS
from surehold.optimization.values import LARGEST, LARGEST_SQUARED
from surehold.studies.search_space import SearchSpace

__all__ = [
    "CONTACTS",
    "EXECUTIONS",
    "OUTPUTS",
    "REACHED",
    "History",
    "Reader",
    "history_of",
    "parameters_of",
    "value_of",
]

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
        self._history = self._of([])  # of the finished trials of this space, in the order in which they were read

    def read(self, trials: Iterable[FrozenTrial], number: int | None = None) -> History:
        """Return what all trials of the study say, as `history_of` does.

        Raises InputError, naming the trial, where what is stored of one cannot be read.
        """
        trials = list(trials)
        fresh = [trial for trial in trials if self._known.get(trial.number) is not trial]
        if len(trials) - len(fresh) != len(self._known):  # of another study, or copies
            self._forget()
            fresh = trials
        told: list[_Told] = []
        pending: dict[int, Mapping[str, Any]] = {}
        known: dict[int, FrozenTrial] = {}
        retried, of_pending = set[int](), set[int]()
        trial = None
        try:
            for trial in sorted(fresh, key=lambda trial: trial.number):
                finished = trial.state.is_finished()
                (retried if finished else of_pending).update(trial.system_attrs.get("retry_history", ()))
                parameters = parameters_of(trial)
                inside = self._space.contains(parameters)
                if finished:
                    known[trial.number] = trial
                    told += [_told(trial, parameters, self._space, self._outputs)] if inside else []
                elif inside:
                    pending[trial.number] = parameters
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
            which = "a trial" if trial is None else f"trial {trial.number}"
            raise InputError(f"{which} of the study is damaged ({error}); restore a copy of the storage.") from error
        if told:
            self._history = History._make(map(np.concatenate, zip(self._history, self._of(told), strict=True)))
        self._known |= known
        self._retried |= retried
        left_out = self._retried | of_pending | {number}
        numbers = self._history.numbers
        rows = np.argsort(numbers, kind="stable")
        rows = rows[~np.isin(numbers[rows], [k for k in left_out if isinstance(k, int)])]
        under_way = self._space.encode_all([row for k, row in pending.items() if k not in left_out])
        told_so_far = self._history._replace(pending=self._history.X)  # any rows
        return History._make(each[rows] for each in told_so_far)._replace(pending=under_way)

    def _of(self, rows: Sequence["_Told"]) -> History:
        """Return the history of finished trials."""
        X = self._space.encode_all([row.parameters for row in rows])
        return History(
            X,
            np.array([row.value for row in rows], dtype=np.float64),
            self._space.encode_all([row.reached for row in rows], anywhere=True),
            X[:0],
            np.array([row.number for row in rows], dtype=np.intp),
            np.array([row.measured for row in rows], dtype=np.float64).reshape(len(rows), len(self._outputs)),
            np.array([row.executions for row in rows], dtype=np.intp),
        )


class _Told(NamedTuple):
    """A trial that was told or failed."""

    number: int
    parameters: Mapping[str, Any]
    reached: Mapping[str, Any]
    value: float
    measured: list[float]
    executions: int


def _told(trial: FrozenTrial, parameters: Mapping[str, Any], space: SearchSpace, outputs: Sequence[str]) -> _Told:
    value = value_of(trial)
    actual = {**parameters, **trial.user_attrs.get(REACHED, {})}
    attributes = trial.user_attrs | trial.user_attrs.get(OUTPUTS, {}) if outputs else {}
    of = trial.user_attrs.get(EXECUTIONS, 1)
    return _Told(
        trial.number,
        parameters,
        actual if actual != parameters and space.encodes(actual) else parameters,
        np.nan if value is None else value,
        [_finite(attributes.get(name)) for name in outputs],
        of if type(of) is int and 0 < of <= MOST_EXECUTIONS and value is not None else 1,
    )


def value_of(trial: FrozenTrial) -> float | None:
    """Return the value of a trial; None where it has none, or Optuna took one that no model can be made of: inf."""
    value = trial.values[0] if trial.state != TrialState.FAIL and trial.values else None
    return value if value is not None and abs(value) <= LARGEST else None


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

"""What the stored trials of a study say to the optimizer, whoever wrote them.

    state in Optuna                     for the optimizer
    COMPLETE, or PRUNED with a value    told; failed where the value is not finite
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
from surehold.studies.search_space import SearchSpace

__all__ = ["CONTACTS", "EXECUTIONS", "OUTPUTS", "REACHED", "History", "history_of", "parameters_of"]

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
    ordered = sorted(trials, key=lambda trial: trial.number)
    told: list[_Told] = []
    pending: list[Mapping[str, Any]] = []
    trial = None
    try:
        retried = set[int]()
        for trial in ordered:
            retried.update(trial.system_attrs.get("retry_history", ()))
        for trial in ordered:
            if trial.number == number or trial.number in retried:
                continue
            parameters = parameters_of(trial)
            if not space.contains(parameters):
                continue
            if trial.state.is_finished():
                told.append(_told(trial, parameters, space, outputs))
            else:
                pending.append(parameters)
    except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
        which = "a trial" if trial is None else f"trial {trial.number}"
        raise InputError(f"{which} of the study is damaged ({error}); restore a copy of the storage.") from error
    return History(
        space.encode_all([row.parameters for row in told]),
        np.array([row.value for row in told], dtype=np.float64),
        space.encode_all([row.reached for row in told], anywhere=True),
        space.encode_all(pending),
        np.array([row.number for row in told], dtype=np.intp),
        np.array([row.measured for row in told], dtype=np.float64).reshape(len(told), len(outputs)),
        np.array([row.executions for row in told], dtype=np.intp),
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
    value = trial.values[0] if trial.state != TrialState.FAIL and trial.values else np.nan
    value = value if np.isfinite(value) else np.nan
    actual = {**parameters, **trial.user_attrs.get(REACHED, {})}
    attributes = trial.user_attrs | trial.user_attrs.get(OUTPUTS, {})
    of = trial.user_attrs.get(EXECUTIONS, 1)
    return _Told(
        trial.number,
        parameters,
        actual if space.encodes(actual) else parameters,
        value,
        [_finite(attributes.get(name)) for name in outputs],
        of if type(of) is int and 0 < of <= MOST_EXECUTIONS and np.isfinite(value) else 1,
    )


def _finite(value: Any) -> float:
    """Return a number; NaN of what is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        return np.nan
    return float(value)


def parameters_of(trial: FrozenTrial) -> dict[str, Any]:
    """Return the parameters of a trial; of one that waits, or has just been begun, those that it will have."""
    if trial.state.is_finished():
        return dict(trial.params)
    return trial.system_attrs.get("fixed_params", {}) | trial.params

"""A study at a glance, and its trials as rows."""

import csv
import io
import json
import time
from collections.abc import Callable
from typing import Any

from optuna.trial import FrozenTrial, TrialState

from surehold.store.csv_cells import written_cell
from surehold.studies.choice_cells import ChoiceCells
from surehold.studies.export_columns import columns_of
from surehold.studies.history import EXECUTIONS, OUTPUTS, REACHED, parameters_of, value_of
from surehold.studies.ledger import NOTE, VETOED, holder_of, waits
from surehold.studies.robot import RobotStudy

__all__ = ["rows", "status", "to_csv", "to_json"]

_STATES = {
    TrialState.COMPLETE: "complete",
    TrialState.FAIL: "failed",
    TrialState.PRUNED: "pruned",
    TrialState.RUNNING: "running",
    TrialState.WAITING: "waiting",
}


def status(study: RobotStudy) -> dict[str, Any]:
    """Return the state of a study as plain data."""
    trials = study.trials()
    now = time.time()
    paused, stopped = study.paused, study.stopped()
    values = [value for t in trials if (value := _value(t)) is not None]
    best = (max if study.settings.direction == "maximize" else min)(values, default=None)
    return {
        "name": study.name,
        "storage": study.storage.shown,
        "state": "paused" if paused is not None else "stopped" if stopped else "open",
        "reason": stopped if paused is None else paused,
        "trials": len(trials),
        **{name: sum(_state(t, now) == name for t in trials) for name in _STATES.values()},
        "direction": study.settings.direction,
        "best_value": best,
        "best_trial": next((t.number for t in trials if best is not None and _value(t) == best), None),
        "parameters": study.settings.to_json()["parameters"],
        "units": dict(study.settings.units),
        "input_noise": study.settings.to_json()["input_noise"],
        "stop_rule": {key: value for key, value in study.stop_rule.as_dict().items() if value is not None},
        "pending": [_pending(t, now) for t in trials if not t.state.is_finished()],
    }


def rows(study: RobotStudy) -> list[dict[str, Any]]:
    """Return one row a trial: id, state, value, further outputs, parameters, what was reached, times, note.

    Of a study about success also "of": of how many executions the value is the share that succeeded. The names are
    those of `export_columns`.
    """
    return _rows(study, lambda name, value: value)


def _rows(study: RobotStudy, written: Callable[[str, Any], Any]) -> list[dict[str, Any]]:
    """Return the rows, in which parameters that a trial has are as `written` returns them, by name and value."""
    found, now = [], time.time()
    columns = columns_of(study.settings)
    for trial in study.trials():
        parameters, reached = (
            {name: written(name, value) for name, value in there.items()}
            for there in (parameters_of(trial), trial.user_attrs.get(REACHED, {}))
        )
        outputs, holder = trial.user_attrs.get(OUTPUTS, {}), holder_of(trial)
        found.append(
            {
                "id": trial.number,
                "state": "vetoed" if _vetoed(trial) else _state(trial, now),
                "value": _value(trial),
                **({"of": trial.user_attrs.get(EXECUTIONS, 1)} if "of" in columns.outcome else {}),
                **{column: outputs.get(name) for name, column in columns.outputs.items()},
                **{column: parameters.get(name) for name, column in columns.parameters.items()},
                **{column: reached.get(name) for name, column in columns.reached.items()},
                "begun": trial.datetime_start.isoformat() if trial.datetime_start else None,
                "finished": trial.datetime_complete.isoformat() if trial.datetime_complete else None,
                "worker": holder.name if holder is not None else None,
                "note": trial.user_attrs.get(VETOED if _vetoed(trial) else NOTE),
            }
        )
    return found


def to_csv(study: RobotStudy) -> str:
    """Return the trials as CSV with a header; an empty field is nothing, texts as in `csv_cells.written_cell`.

    Choices are as in `choice_cells`.
    """
    text = io.StringIO()
    columns = columns_of(study.settings).all
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(written_cell, columns))
    found = _rows(study, ChoiceCells(study.settings.space).written)
    writer.writerows([written_cell(row[column]) for column in columns] for row in found)
    return text.getvalue()


def to_json(study: RobotStudy) -> str:
    """Return settings, trials and the recommendation last written as JSON."""
    data = {
        "name": study.name,
        "settings": study.settings.to_json(),
        "trials": rows(study),
        "recommendation": study.study.user_attrs.get("surehold:recommendation"),
    }
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def _value(trial: FrozenTrial) -> float | None:
    return value_of(trial) if trial.state == TrialState.COMPLETE else None


def _state(trial: FrozenTrial, now: float) -> str:
    """Return the state of a trial; of one that will be handed out again "waiting", as `tell` says."""
    if trial.state == TrialState.COMPLETE and _value(trial) is None:  # for the model, too
        return _STATES[TrialState.FAIL]
    return "waiting" if waits(trial, now) else _STATES[trial.state]


def _vetoed(trial: FrozenTrial) -> bool:
    return VETOED in trial.user_attrs and trial.state == TrialState.FAIL


def _pending(trial: FrozenTrial, now: float) -> dict[str, Any]:
    holder = holder_of(trial)
    let_go = holder is not None and not (holder.name or holder.attempts)  # nobody holds it who could be dead
    begun = trial.datetime_start
    return {
        "id": trial.number,
        "state": _state(trial, now),
        "parameters": parameters_of(trial),
        "seconds": None if begun is None else max(now - begun.timestamp(), 0.0),
        "worker": None if holder is None else holder.name or None,
        "worker_alive": None if holder is None or holder.until is None or let_go else now <= holder.until,
        "attempts": None if holder is None else holder.attempts,
    }

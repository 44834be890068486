"""Trials made before: from a CSV file or another study, with columns mapped and the checks of `tell`.

All rows are checked before the first is stored.
"""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import optuna
from optuna.study import Study
from optuna.trial import TrialState

from surehold.errors import InputError
from surehold.optimization.limits import checked_outputs
from surehold.studies.csv_cells import cell_text
from surehold.studies.history import EXECUTIONS, OUTPUTS, REACHED
from surehold.studies.ledger import checked_value
from surehold.studies.robot import RobotStudy
from surehold.studies.settings import SETTINGS
from surehold.studies.storage import open_storage
from surehold.studies.success import answer, count_told

__all__ = ["FormerTrial", "former_study", "import_trials", "trials_of_csv", "trials_of_study"]

_FAILED = {"fail", "failed", "vetoed", "pruned"}
_UNFINISHED = {"running", "waiting"}


class FormerTrial(NamedTuple):
    """A trial as it was found."""

    where: str
    """for messages and the trial's note, such as "rig.csv, line 3" """
    parameters: Mapping[str, Any]
    value: Any
    failed: bool
    reached: Mapping[str, Any]
    """the parameters that were truly reached, where they are known"""
    of: Any = None
    """executions of which the value is the share that succeeded, where that is known"""
    outputs: Mapping[str, Any] | None = None
    """further outputs; None for one that was not measured"""


def trials_of_csv(
    path: str, names: Mapping[str, str], value: str = "value", outputs: Iterable[str] = ()
) -> list[FormerTrial]:
    """Return the trials of a CSV file with a header.

    Parameters
    ----------
    names
        Column of each parameter, {parameter: column}.
    value
        Column of the value; where it is empty, or a column "state" says so, the trial failed. Rows whose state is
        running or waiting are left out. Columns reached_NAME hold what was truly reached; a column "of", into a study
        about success, of how many executions the value is the share that succeeded.
    outputs
        Names of further outputs, in the columns output_NAME or NAME; where they are empty, they were not measured.

    Raises
    ------
    InputError
        If the file cannot be read, or a column is missing or there twice.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"file {path!r} cannot be read: {getattr(error, 'strerror', None) or error}.") from None
    reader = csv.DictReader(text.splitlines())
    columns = list(reader.fieldnames or [])
    for column in (*names.values(), value):
        if column not in columns:
            raise InputError(f"file {path!r} has no column {column!r}; it has {', '.join(columns) or 'none'}.")
        if columns.count(column) > 1:
            raise InputError(f"file {path!r} has {columns.count(column)} columns {column!r}; leave one.")
    found = []
    measured = {name: column for name in outputs for column in (name, f"output_{name}") if column in columns}
    for row in reader:
        state = (row.get("state") or "").strip().lower()
        if state in _UNFINISHED:
            continue
        told = cell_text((row[value] or "").strip())
        reached = {
            name: cell_text(row[f"reached_{name}"].strip())
            for name in names
            if (row.get(f"reached_{name}") or "").strip()
        }
        parameters = {name: cell_text((row[column] or "").strip()) for name, column in names.items()}
        failed = state in _FAILED or not told
        where = f"{Path(path).name}, line {reader.line_num}"
        of = None if failed else (row.get("of") or "").strip() or None
        told_outputs = {name: cell_text((row[column] or "").strip()) or None for name, column in measured.items()}
        found.append(FormerTrial(where, parameters, None if failed else told, failed, reached, of, told_outputs))
    return found


def trials_of_study(
    study: Study, names: Mapping[str, str], direction: str, outputs: Iterable[str] = ()
) -> list[FormerTrial]:
    """Return the finished trials of a study of Optuna; `names` are {parameter: its name there}.

    Values of a study of the other direction change their sign. Trials that lack a parameter are refused by
    `import_trials`.
    """
    if len(study.directions) != 1:
        raise InputError(f"study '{study.study_name}' has {len(study.directions)} objectives; one is needed.")
    sign = 1.0 if study.direction.name == direction.upper() else -1.0
    watched = study.user_attrs.get(SETTINGS, {}).get("optimizer", {}).get("constraints") or {}
    found = []
    for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED, TrialState.FAIL)):
        failed = trial.state == TrialState.FAIL or not trial.values
        stored = trial.user_attrs.get(REACHED, {})
        parameters = {name: trial.params[there] for name, there in names.items() if there in trial.params}
        reached = {name: stored[there] for name, there in names.items() if there in stored}
        value = None if failed else sign * trial.values[0]
        where = f"{study.study_name}, trial {trial.number}"
        of = None if failed else trial.user_attrs.get(EXECUTIONS)
        told = trial.user_attrs | trial.user_attrs.get(OUTPUTS, {})
        kept = {name: told.get(name) for name in outputs if name in told or name in watched}
        found.append(FormerTrial(where, parameters, value, failed, reached, of, kept))
    return found


def import_trials(study: RobotStudy, trials: list[FormerTrial], *, skip_bad: bool = False) -> list[str]:
    """Store former trials in a study, and return why some were left out.

    Parameters
    ----------
    skip_bad
        Whether trials that do not fit are left out; otherwise nothing is stored where one does not fit.

    Raises
    ------
    InputError
        If a trial does not fit: a parameter is missing or outside its range, or the value is not finite.
    """
    good, left_out = [], []
    settings = study.settings.optimizer
    for trial in trials:
        try:
            if trial.of is not None and settings.get("outcome") == "success":
                trial = trial._replace(value=count_told(trial.value, trial.of))
            checked_value(answer(settings, trial.value)[0], trial.failed)
            checked_outputs(study.limits, trial.outputs, trial.failed)
            commanded = study.settings.space.check(trial.parameters)
            study.settings.space.check_reached(commanded, trial.reached)
            good.append(trial)
        except InputError as error:
            if not skip_bad:
                raise InputError(f"{trial.where}: {error} Nothing was imported.") from None
            left_out.append(f"{trial.where}: {error}")
    for trial in good:
        study.add(
            trial.parameters,
            trial.value,
            failed=trial.failed,
            reached=trial.reached or None,
            constraints=trial.outputs,
            note=f"from {trial.where}",
        )
    return left_out


def former_study(name: str, storage: str) -> Study:
    """Return any single study of Optuna, surehold's or not, to read from; raises InputError where it is not there."""
    opened = open_storage(storage, name, create=False)
    with opened.failures():
        names = optuna.get_all_study_names(opened.backend)
        if name not in names:
            raise InputError(f"study '{name}' is not in {opened.shown}; there are {', '.join(names) or 'none'}.")
        return optuna.load_study(study_name=name, storage=opened.backend)

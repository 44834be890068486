"""Trials made before: from a CSV file or another study, with columns mapped and the checks of `tell`.

All rows are checked before the first is stored. A trial that an earlier import stored is not stored again.
"""

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import optuna
from optuna.study import Study
from optuna.trial import TrialState

from surehold.amounts import amount
from surehold.errors import InputError
from surehold.optimization.limits import checked_outputs
from surehold.store.csv_cells import cell_text
from surehold.studies.history import EXECUTIONS, OUTPUTS, REACHED, value_of
from surehold.studies.ledger import NOTE, checked_value
from surehold.studies.robot import RobotStudy
from surehold.studies.settings import SETTINGS
from surehold.studies.storage import open_storage
from surehold.studies.success import answer, count_told

__all__ = ["FormerTrial", "Imported", "former_study", "import_trials", "trials_of_csv", "trials_of_study"]

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
    why: str = ""
    """of a failed trial, what says that it failed, such as "has no value" """
    wrong: str = ""
    """why what was found is not to be believed; empty where it is"""

    @property
    def place(self) -> str:
        """Where it was found, without the name of the file or study: "line 3"."""
        return self.where.rpartition(", ")[2]


class Imported(NamedTuple):
    """What became of former trials."""

    values: int
    """trials stored with a value"""
    failed: list[str]
    """trials stored as failed: which, and why, such as "line 4 has no value" """
    already: list[str]
    """trials that an earlier import stored, such as "line 3" """
    left_out: list[str]
    """trials that do not fit, and why"""


def trials_of_csv(
    path: str,
    names: Mapping[str, str],
    value: str = "value",
    outputs: Iterable[str] = (),
    read: Callable[[str, str], Any] = lambda name, cell: cell,
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
    read
        What a parameter's cell says, by name and cell; of choices as they are exported `ChoiceCells.read`.

    Raises
    ------
    InputError
        If the file cannot be read, its columns are not separated by commas, one is missing, there twice or meant for
        two things, or quotation marks do not fit.
    """
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"file {path!r} is no text in UTF-8 ({error.reason}); save it as CSV in UTF-8.") from None
    except OSError as error:
        raise InputError(f"file {path!r} cannot be read: {error.strerror or error}.") from None
    reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    rows: list[tuple[int, dict[str, Any]]] = []
    try:
        reader.fieldnames = columns = [cell_text(column) for column in reader.fieldnames or []]
        for row in reader:
            rows.append((reader.line_num, row))
    except csv.Error as error:
        last = rows[-1][0] if rows else 1
        raise InputError(
            f"file {path!r} is no CSV behind line {last} ({error}); is a quotation mark missing there?"
        ) from None
    _check_columns(path, columns, names, value)
    found = []
    measured = {name: column for name in outputs for column in (name, f"output_{name}") if column in columns}
    for line, row in rows:
        state = (row.get("state") or "").strip().lower()
        if state in _UNFINISHED:
            continue
        told = cell_text((row[value] or "").strip())
        reached = {
            name: read(name, cell_text(row[f"reached_{name}"].strip()))
            for name in names
            if (row.get(f"reached_{name}") or "").strip()
        }
        parameters = {name: read(name, cell_text((row[column] or "").strip())) for name, column in names.items()}
        failed = state in _FAILED or not told
        why = f"has state {state}" if state in _FAILED else "has no value"
        where = f"{Path(path).name}, line {line}"
        of = None if failed else (row.get("of") or "").strip() or None
        told_outputs = {name: cell_text((row[column] or "").strip()) or None for name, column in measured.items()}
        trial = FormerTrial(where, parameters, None if failed else told, failed, reached, of, told_outputs)
        more = [cell for cell in row.get(None, ()) if cell.strip()]  # type: ignore[call-overload]
        wrong = f"there are more cells than the {amount(len(columns), 'column')} of the header, first {more[:1]}"
        found.append(trial._replace(why=why if failed else "", wrong=wrong if more else ""))
    return found


def _check_columns(path: str, columns: list[str], names: Mapping[str, str], value: str) -> None:
    """Raise InputError where a column is missing or there twice; the message says what the file's may mean."""
    for separator, called in ((";", "semicolons"), ("\t", "tabs")):
        if len(columns) == 1 and separator in columns[0]:
            raise InputError(
                f"file {path!r} separates its columns by {called} ({columns[0][:60]!r}); save it as CSV with commas "
                "between the columns and points in the numbers."
            )
    for parameter, column in (dict(names) | {"": value}).items():
        if column not in columns:
            hint, like = "", next((there for there in columns if _bare(there) == _bare(column)), None)
            if like is not None:
                option, given = ("--columns", f"{parameter}={like}") if parameter else ("--value", like)
                quoted = given if re.fullmatch(r"[\w=.-]+", given) else f'"{given}"'
                hint = f" Is it {like!r}? Then give {option} {quoted}."
            raise InputError(f"file {path!r} has no column {column!r}; it has {', '.join(columns) or 'none'}.{hint}")
        if columns.count(column) > 1:
            raise InputError(f"file {path!r} has {columns.count(column)} columns {column!r}; leave one.")
    meant = [(column, f"parameter {parameter!r}") for parameter, column in names.items()] + [(value, "the value")]
    for column, what in meant:
        others = [other for there, other in meant if there == column and other != what]
        if others:
            raise InputError(f"column {column!r} of file {path!r} is to be {what} and {others[0]}; name two columns.")


def _bare(column: str) -> str:
    """Return the name of a column in small letters, without a unit in brackets behind it."""
    return re.sub(r"[\[(][^\[(]*[\])]\s*$", "", column).strip().casefold()


def trials_of_study(
    study: Study, names: Mapping[str, str], direction: str, outputs: Iterable[str] = ()
) -> list[FormerTrial]:
    """Return the finished trials of a study of Optuna; `names` are {parameter: its name there}.

    Values of a study of the other direction change their sign; those of which no model can be made, such as inf, are
    failures. Trials that lack a parameter are refused by `import_trials`.
    """
    if len(study.directions) != 1:
        raise InputError(f"study '{study.study_name}' has {len(study.directions)} objectives; one is needed.")
    sign = 1.0 if study.direction.name == direction.upper() else -1.0
    watched = study.user_attrs.get(SETTINGS, {}).get("optimizer", {}).get("constraints") or {}
    found = []
    for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED, TrialState.FAIL)):
        value = value_of(trial)
        failed = value is None
        stored = trial.user_attrs.get(REACHED, {})
        parameters = {name: trial.params[there] for name, there in names.items() if there in trial.params}
        reached = {name: stored[there] for name, there in names.items() if there in stored}
        where = f"{study.study_name}, trial {trial.number}"
        of = None if failed else trial.user_attrs.get(EXECUTIONS)
        told = trial.user_attrs | trial.user_attrs.get(OUTPUTS, {})
        kept = {name: told.get(name) for name in outputs if name in told or name in watched}
        why = "failed" if failed else ""
        found.append(FormerTrial(where, parameters, None if failed else sign * value, failed, reached, of, kept, why))
    return found


def import_trials(study: RobotStudy, trials: list[FormerTrial], *, skip_bad: bool = False) -> Imported:
    """Store former trials in a study; those that were imported before, with the same answer, stay as they are.

    Parameters
    ----------
    skip_bad
        Whether trials that do not fit are left out; otherwise nothing is stored where one does not fit.

    Raises
    ------
    InputError
        If a trial does not fit: a parameter is missing or outside its range, or the value is not finite.
    """
    good: list[FormerTrial] = []
    found = Imported(0, [], [], [])
    settings = study.settings.optimizer
    stored = {_identity(t.user_attrs.get(NOTE), t.params, t.values[0] if t.values else None) for t in study.trials()}
    for trial in trials:
        try:
            if trial.wrong:
                raise InputError(f"{trial.wrong}; write numbers with points, and texts that hold a comma in quotes.")
            if trial.of is not None and settings.get("outcome") == "success":
                trial = trial._replace(value=count_told(trial.value, trial.of))
            number = checked_value(answer(settings, trial.value)[0], trial.failed)
            checked_outputs(study.limits, trial.outputs, trial.failed)
            commanded = study.settings.space.check(trial.parameters)
            study.settings.space.check_reached(commanded, trial.reached)
            if _identity(_note(trial), commanded, number) in stored:
                found.already.append(trial.place)
            else:
                good.append(trial)
        except InputError as error:
            if not skip_bad:
                raise InputError(
                    f"{trial.where}: {error} Nothing was imported; mend it, or leave out all that does not fit "
                    "with --skip-bad."
                ) from None
            found.left_out.append(f"{trial.where}: {error}")
    for trial in good:
        study.add(
            trial.parameters,
            trial.value,
            failed=trial.failed,
            reached=trial.reached or None,
            constraints=trial.outputs,
            note=_note(trial),
        )
    failed = [f"{trial.place} {trial.why or 'failed'}" for trial in good if trial.failed]
    return found._replace(values=len(good) - len(failed), failed=failed)


def _note(trial: FormerTrial) -> str:
    return f"from {trial.where}"


def _identity(note: str | None, parameters: Mapping[str, Any], value: float | None) -> tuple[Any, ...]:
    """Return what two imports of one trial have in common."""
    return note, tuple(sorted(parameters.items())), value


def former_study(name: str, storage: str, into: RobotStudy) -> Study:
    """Return any single study of Optuna, surehold's or not, to read from.

    Raises
    ------
    InputError
        If it is not there, or is the one that its trials are for: each would count twice.
    """
    opened = open_storage(storage, name, create=False)
    if name == into.name and opened.is_that_of(into.storage):
        raise InputError(f"study '{name}' in {opened.shown} has its own trials already; name another one.")
    with opened.failures():
        names = optuna.get_all_study_names(opened.backend)
        if name not in names:
            raise InputError(f"study '{name}' is not in {opened.shown}; there are {', '.join(names) or 'none'}.")
        return optuna.load_study(study_name=name, storage=opened.backend)

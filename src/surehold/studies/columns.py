"""Many stored trials read at once from a database: by columns, not as one object for each row.

Optuna reads a study through SQLAlchemy's object mapper and parses the distribution of every parameter of every trial,
twice: seconds for 10,000 trials, which the first ask of a new process waits for. Here each table is one query of plain
rows, and every distribution is parsed once. The trials are equal to Optuna's own.
"""

import json
from collections import defaultdict
from collections.abc import Container, Iterator
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any, Final

from optuna.distributions import BaseDistribution, json_to_distribution
from optuna.storages import RDBStorage
from optuna.storages._rdb import models
from optuna.storages._rdb.storage import _create_scoped_session
from optuna.trial import FrozenTrial, TrialState
from sqlalchemy import select
from sqlalchemy.orm import Session

__all__ = ["ColumnStorage"]

_HEAD: Final = ("number", "state", "datetime_start", "datetime_complete")
_parsed: Final = lru_cache(maxsize=1024)(json_to_distribution)


class ColumnStorage(RDBStorage):
    """Optuna's storage in a database; a study that is read whole is read by columns."""

    def _get_trials(
        self,
        study_id: int,
        states: Container[TrialState] | None,
        included_trial_ids: set[int],
        trial_id_greater_than: int,
    ) -> list[FrozenTrial]:
        if states is not None or trial_id_greater_than > -1:  # the few that are new or unfinished
            return super()._get_trials(study_id, states, included_trial_ids, trial_id_greater_than)
        with _create_scoped_session(self.scoped_session) as session:
            models.StudyModel.find_or_raise_by_id(study_id, session)
            # Heads first: a trial that they call complete has its values by then.
            heads = list(_rows(session, study_id, models.TrialModel, *_HEAD))
            values: dict[int, dict[int, float]] = defaultdict(dict)
            kind = models.TrialValueModel
            for id, objective, value, form in _rows(session, study_id, kind, "objective", "value", "value_type"):
                values[id][objective] = kind.stored_repr_to_value(value, form)
            steps: dict[int, dict[int, float]] = defaultdict(dict)
            told = models.TrialIntermediateValueModel
            names = ("step", "intermediate_value", "intermediate_value_type")
            for id, step, value, form in _rows(session, study_id, told, *names):
                steps[id][step] = told.stored_repr_to_intermediate_value(value, form)
            params: dict[int, dict[str, Any]] = defaultdict(dict)
            forms: dict[int, dict[str, BaseDistribution]] = defaultdict(dict)
            columns = ("param_name", "param_value", "distribution_json")
            for id, name, value, text in _rows(session, study_id, models.TrialParamModel, *columns):
                forms[id][name] = form = _parsed(text)
                params[id][name] = form.to_external_repr(value)
            user = _attributes(session, study_id, models.TrialUserAttributeModel)
            system = _attributes(session, study_id, models.TrialSystemAttributeModel)
        return [
            FrozenTrial(
                number=number,
                state=state,
                value=None,
                values=[values[id][k] for k in sorted(values[id])] if id in values else None,
                datetime_start=_local(begun),
                datetime_complete=_local(ended),
                params=params[id],
                distributions=forms[id],
                user_attrs=user[id],
                system_attrs=system[id],
                intermediate_values=steps[id],
                trial_id=id,
            )
            for id, number, state, begun, ended in heads
        ]


def _select(model: Any, study_id: int, *columns: str) -> Any:
    """Return the query of some columns of a table for all trials of a study, in the order of writing."""
    table, trials = model.__table__, models.TrialModel.__table__
    query = select(table.c.trial_id, *(table.c[name] for name in columns)).where(trials.c.study_id == study_id)
    if table is not trials:
        query = query.join(trials, trials.c.trial_id == table.c.trial_id)
    return query.order_by(*table.primary_key.columns)


def _rows(session: Session, study_id: int, model: Any, *columns: str) -> Iterator[Any]:
    yield from session.execute(_select(model, study_id, *columns))


def _attributes(session: Session, study_id: int, model: Any) -> dict[int, dict[str, Any]]:
    """Return the attributes of each trial, {id of the trial: {name: value}}."""
    found: dict[int, dict[str, Any]] = defaultdict(dict)
    for id, key, text in _rows(session, study_id, model, "key", "value_json"):
        found[id][key] = json.loads(text)
    return found


def _local(moment: datetime | None) -> datetime | None:
    """Return the local time of a stored one, which is in UTC, neither with a zone."""
    return None if moment is None else moment.replace(tzinfo=UTC).astimezone().replace(tzinfo=None)

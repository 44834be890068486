import math

import optuna
from optuna.storages import RDBStorage
from optuna.trial import TrialState

from surehold.studies.columns import ColumnStorage


def test_trials_are_those_that_optuna_reads(tmp_path):
    url = f"sqlite:///{tmp_path}/study.db"
    study = optuna.create_study(storage=RDBStorage(url), study_name="one", directions=["maximize", "minimize"])
    other = optuna.create_study(storage=RDBStorage(url), study_name="other")
    for value in (0.5, math.inf, -math.inf):
        trial = study.ask()
        trial.suggest_float("a", -1.0, 1.0)
        trial.suggest_int("count", 1, 9)
        trial.suggest_categorical("grip", ["pinch", "power"])
        trial.set_user_attr("note", {"who": [1, 2]})
        study.tell(trial, [value, 1.0])
        other.ask().suggest_float("a", 0.0, 2.0)
    study.enqueue_trial({"a": 0.25})
    study.ask().suggest_float("a", -1.0, 1.0)
    study.tell(study.ask(), state=TrialState.FAIL)
    for step, value in enumerate((0.5, math.inf, -math.inf, math.nan)):
        trial = other.ask()
        trial.report(value, step)
    for name in ("one", "other"):
        key = study._storage.get_study_id_from_name(name)
        columns = ColumnStorage(url)._get_trials(key, None, set(), -1)
        objects = RDBStorage(url)._get_trials(key, None, set(), -1)
        assert len(objects) >= 5
        assert repr(columns) == repr(objects)  # nan is not equal to itself

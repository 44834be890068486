"""The export of a study: names of parameters that are its columns, values that are none."""

import csv
import io
import json
import math

import pytest

from surehold.errors import InputError
from surehold.studies import opened
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.status import rows, status, to_csv, to_json


def described(*names, **optimizer):
    return StudySettings(SearchSpace(dict.fromkeys(names, (0.0, 1.0))), None, {}, {"n_initial": 4, **optimizer})


@pytest.mark.parametrize("name", ["id", "state", "value", "begun", "finished", "worker", "note", "reached_x"])
def test_names_of_columns_are_refused(name, tmp_path):
    with pytest.raises(
        InputError, match=f"parameter '{name}' has the name of a column .*id, state, value, .*, note, and"
    ):
        RobotStudy.create("mug", described("x", name), str(tmp_path / "j.log"))
    assert not (tmp_path / "j.log").exists()


def test_names_of_columns_that_the_study_does_not_have_are_taken():
    RobotStudy.create("mug", described("of", "output_torque", "reached_x"), "memory")
    with pytest.raises(InputError, match="parameter 'of'"):
        RobotStudy.create("mug", described("of", outcome="success"), "memory")
    with pytest.raises(InputError, match="parameter 'output_torque'"):
        RobotStudy.create("mug", described("output_torque", constraints={"torque": [None, 3.0]}), "memory")


def test_an_older_study_with_such_names_opens_and_exports_its_results(tmp_path, monkeypatch):
    url = str(tmp_path / "j.log")
    monkeypatch.setattr(opened, "check_columns", lambda settings: None)
    study = RobotStudy.create("mug", described("x", "value", "reached_x", "parameter_value"), url)
    monkeypatch.undo()
    study = RobotStudy.open("mug", url)
    asked = study.ask()
    study.tell(asked.id, 7.0, reached={"x": 0.5})
    (row,) = rows(study)
    (line,) = csv.DictReader(io.StringIO(to_csv(study)))
    assert list(line) == list(row)
    assert (row["value"], row["reached_x"]) == (7.0, 0.5)
    assert row["parameter_parameter_value"] == asked.parameters["value"]
    assert row["parameter_reached_x"] == asked.parameters["reached_x"]
    assert row["parameter_value"] == asked.parameters["parameter_value"]


def test_values_that_optuna_takes_and_no_model_does_are_failures(tmp_path):
    study = RobotStudy.create("mug", described("x"), str(tmp_path / "j.log"))
    for value in (0.5, math.inf, -math.inf):
        study.study.tell(study.study.ask(study.settings.space.distributions), value)
    shown = status(study)
    assert (shown["complete"], shown["failed"], shown["best_value"], shown["best_trial"]) == (1, 2, 0.5, 0)
    assert shown == json.loads(json.dumps(shown, allow_nan=False))
    exported = [(row["state"], row["value"]) for row in json.loads(to_json(study))["trials"]]
    assert exported == [("complete", 0.5), ("failed", None), ("failed", None)]
    assert study.recommend(write=False).n == 1  # as the model has it

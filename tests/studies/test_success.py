"""A study whose trials succeed or fail."""

import pytest

from surehold.errors import InputError
from surehold.studies.parameter_text import parse_search_space
from surehold.studies.robot import RobotStudy
from surehold.studies.settings import StudySettings


def created(tmp_path, **optimizer):
    settings = StudySettings(parse_search_space("x=0:1"), None, {}, {"seed": 0, **optimizer})
    return RobotStudy.create("rig", settings, str(tmp_path / "journal.log"))


def test_asks_as_an_optimizer_that_was_told_the_same(tmp_path):
    study = created(tmp_path, outcome="success", n_initial=6)
    for k in range(7):
        asked = study.ask()
        study.tell(asked.id, "success" if 0.4 < asked.parameters["x"] < 0.8 else "failure", failed=False)
        assert k == asked.id
    assert 0.3 < study.recommend().parameters["x"] < 0.9


def test_what_is_told_must_be_success_or_failure(tmp_path):
    study = created(tmp_path, outcome="success")
    asked = study.ask()
    with pytest.raises(InputError, match="tell success or failure"):
        study.tell(asked.id, 0.7)
    assert study.tell(asked.id, "failure").value == 0.0


def test_a_study_of_values_takes_no_success(tmp_path):
    study = created(tmp_path)
    with pytest.raises(InputError, match="--outcome success"):
        study.tell(study.ask().id, "success")

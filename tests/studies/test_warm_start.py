"""Former trials: each is taken once, failed ones are named, and a header that does not fit says what may be meant."""

import json
import math
from pathlib import Path

import pytest
from optuna.distributions import CategoricalDistribution

from surehold.cli import run
from surehold.errors import InputError
from surehold.studies.history import REACHED
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.status import to_csv
from surehold.studies.warm_start import import_trials, trials_of_csv, trials_of_study

SPACE = SearchSpace({"dx": (-0.05, 0.05)})
NAMES = {"dx": "dx"}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SUREHOLD_STORAGE", raising=False)
    return tmp_path


def created(name):
    return RobotStudy.create(name, StudySettings(SPACE), f"{name}.log")


def test_a_trial_is_imported_once(here):
    study = created("warm")
    file = here / "rig.csv"
    file.write_text("dx,value\n0.01,0.7\n0.01,0.7\n0.03,\n")
    first = import_trials(study, trials_of_csv("rig.csv", NAMES))
    assert (first.values, first.failed, first.already) == (2, ["line 4 has no value"], [])
    again = import_trials(study, trials_of_csv("rig.csv", NAMES))
    assert (again.values, again.failed, again.already) == (0, [], ["line 2", "line 3", "line 4"])
    file.write_text("dx,value\n0.01,0.75\n0.01,0.7\n0.03,\n0.04,0.1\n")
    more = import_trials(study, trials_of_csv("rig.csv", NAMES))
    assert (more.values, more.already) == (2, ["line 3", "line 4"]), "a line that was changed, and one that was added"
    other = created("other")
    found = trials_of_study(study.study, NAMES, "maximize")
    assert import_trials(other, found).failed == ["trial 2 failed"]
    assert len(import_trials(other, found).already) == len(study.trials()) == len(other.trials()) == 5


def test_values_that_optuna_takes_and_no_model_does_are_imported_as_the_failures_that_they_are(here):
    """Functions of Optuna say inf where they failed."""
    before, study = created("before"), created("after")
    for value in (0.7, math.inf, -math.inf, 1e301):
        before.study.tell(before.study.ask(SPACE.distributions), value)
    made = import_trials(study, trials_of_study(before.study, NAMES, "maximize"))
    assert (made.values, made.failed) == (1, ["trial 1 failed", "trial 2 failed", "trial 3 failed"])
    (here / "before.csv").write_text(to_csv(before))
    assert len(import_trials(created("by-file"), trials_of_csv("before.csv", NAMES)).failed) == 3


def test_what_was_imported_is_said(here, capsys):
    created("warm").close()
    (here / "rig.csv").write_text("dx,value,state\n0.01,0.7,\n0.02,0.3,failed\n0.03,,\n")
    line = ["study", "import", "warm", "rig.csv", "--storage", "warm.log"]
    assert run(line) == 0
    said = "3 trials imported into warm: 1 with a value, 2 failed: line 3 has state failed, line 4 has no value\n"
    assert capsys.readouterr().out == said
    assert run(line) == 0
    said = "0 trials imported into warm\nimported before and not again: 3 (line 2, line 3, line 4)\n"
    assert capsys.readouterr().out == said
    assert run([*line, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["imported"], answer["already"]) == (0, ["line 2", "line 3", "line 4"])


def test_many_lines_are_cut_short(here, capsys):
    created("warm").close()
    (here / "rig.csv").write_text("dx,value\n" + "0.01,\n" * 12)
    assert run(["study", "import", "warm", "rig.csv", "--storage", "warm.log"]) == 0
    assert "line 11 has no value, and 2 more (--json names all)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("dx;value\n0,01;0,7\n", r"by semicolons \('dx;value'\); save it as CSV with commas"),
        ("dx\tvalue\n0.01\t0.7\n", "by tabs"),
        ("DX,value\n0.01,0.7\n", r"no column 'dx'; it has DX, value\. Is it 'DX'\? Then give --columns dx=DX\.$"),
        ("dx [m],value\n0.01,0.7\n", r'Then give --columns "dx=dx \[m\]"\.$'),
        ("dx,Value\n0.01,0.7\n", r"Then give --value Value\.$"),
        ("u,value\n0.01,0.7\n", r"no column 'dx'; it has u, value\.$"),
    ],
)
def test_a_header_that_does_not_fit(here, text, words):
    (here / "rig.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        trials_of_csv("rig.csv", NAMES)


def test_a_trial_that_does_not_fit_names_the_option_that_leaves_it_out(here):
    (here / "rig.csv").write_text("dx,value\n0.5,0.7\n")
    with pytest.raises(InputError, match=r"line 2: .*Nothing was imported; .* with --skip-bad\."):
        import_trials(created("warm"), trials_of_csv("rig.csv", NAMES))


def test_decimal_commas_are_no_further_cells(here):
    """Of 0,01 and 0,7 came a trial at 0 whose value was 1."""
    study = RobotStudy.create("warm", StudySettings(SearchSpace({"dx": (0.0, 1.0)})), "warm.log")
    (here / "rig.csv").write_text("dx,value\n0,5,0,7\n0.3,1\n0.2,4,,\n")
    found = trials_of_csv("rig.csv", NAMES)
    with pytest.raises(
        InputError, match=r"line 2: there are more cells than the 2 columns .* first \['0'\]; .* points"
    ):
        import_trials(study, found)
    made = import_trials(study, found, skip_bad=True)
    assert [trial.values for trial in study.trials()] == [[1.0], [4.0]]
    assert [why[:15] for why in made.left_out] == ["rig.csv, line 2"]


def test_a_cell_may_hold_what_ends_a_line_elsewhere(here):
    study = created("warm")
    (here / "rig.csv").write_text(
        'dx,value,note\n0.01,1,"two\nlines"\n0.02,2,a\x0cb\n0.03,3,a\u2028b\n', encoding="utf-8"
    )
    assert import_trials(study, trials_of_csv("rig.csv", NAMES)).values == 3
    assert [trial.user_attrs["surehold:note"][-6:] for trial in study.trials()] == ["line 3", "line 4", "line 5"]


@pytest.mark.parametrize(
    ("text", "columns", "value", "words"),
    [
        ('dx,value,note\n0.01,1,"ok\n0.02,2,\n0.03,3,\n', NAMES, "value", "no CSV behind line 1 .* quotation mark"),
        ("dx,value,note\n0.01,1," + "a" * 200_000, NAMES, "value", "no CSV behind line 1"),
        ("dx,value\n0.01,1\n", NAMES, "dx", "column 'dx' of file 'rig.csv' is to be parameter 'dx' and the value"),
        ("a,value\n0.01,1\n", {"dx": "a", "dy": "a"}, "value", "is to be parameter 'dx' and parameter 'dy'"),
    ],
)
def test_files_that_would_be_misread(here, text, columns, value, words):
    (here / "rig.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        trials_of_csv("rig.csv", columns, value)


def test_a_file_in_another_encoding_is_told_which(here):
    (here / "rig.csv").write_text("dx,value,qualität\n0.01,1,2\n", encoding="latin-1")
    with pytest.raises(InputError, match=r"no text in UTF-8 .*; save it as CSV in UTF-8"):
        trials_of_csv("rig.csv", NAMES)


@pytest.mark.parametrize("url", ["warm.log", "sqlite:///warm.db"])
@pytest.mark.parametrize("other", [lambda url: url, lambda url: url.replace("warm.", f"{Path.cwd()}/warm.")])
def test_a_study_is_not_imported_into_itself(here, capsys, url, other):
    study = RobotStudy.create("warm", StudySettings(SPACE), url)
    study.tell(study.ask().id, 0.5)
    line = ["study", "import", "warm", "--study", "warm", "--from", other(url), "--storage", url]
    assert run(line) == 2
    assert "has its own trials already" in capsys.readouterr().err
    assert len(study.trials()) == 1
    study.close()


def test_names_that_a_spreadsheet_would_compute_are_quoted_in_the_header_and_read_again(here):
    space = SearchSpace({"=dx": (-0.05, 0.05), "-dy": (0.0, 1.0)})
    study = RobotStudy.create("sums", StudySettings(space), "sums.log")
    study.add({"=dx": 0.01, "-dy": 0.5}, 0.7)
    text = to_csv(study)
    assert text.startswith("id,state,value,'=dx,'-dy,reached_=dx,")
    (here / "sums.csv").write_text(text)
    other = RobotStudy.create("other", StudySettings(space), "other.log")
    import_trials(other, trials_of_csv("sums.csv", {name: name for name in space.distributions}))
    assert [(trial.params, trial.value) for trial in other.trials()] == [({"=dx": 0.01, "-dy": 0.5}, 0.7)]


@pytest.mark.parametrize(
    "choices",
    [
        (None, "null", '"null"', "", "  ", "a", "a ", "b\nc", "d\n", "=e", "'=e"),
        (1, "1", 0.5, "0.50", "None"),
        (True, "True", "true", False),
    ],
)
def test_every_choice_comes_back_from_an_export(here, choices):
    space = SearchSpace({"grip": CategoricalDistribution(choices), "dx": (0.0, 1.0)})
    study = RobotStudy.create("grips", StudySettings(space), "grips.log")
    for k, choice in enumerate(choices):
        study.add({"grip": choice, "dx": 0.5}, k, reached={"grip": choices[k - 1]})
    RobotStudy.create("again", StudySettings(space), "again.log").close()
    assert run(["study", "export", "grips", "--storage", "grips.log", "--out", "grips.csv"]) == 0
    assert run(["study", "import", "again", "grips.csv", "--storage", "again.log"]) == 0
    back = RobotStudy.open("again", "again.log").trials()
    assert [repr(trial.params["grip"]) for trial in back] == [repr(choice) for choice in choices]
    reached = [trial.user_attrs[REACHED]["grip"] for trial in back]
    assert [repr(choice) for choice in reached] == [repr(choices[k - 1]) for k in range(len(choices))]

"""Whoever takes options of a grasp takes all of them: Python, the command line, studies and plans."""

import numpy as np
import pytest

from surehold.campaigns.plan import ProblemSetup
from surehold.campaigns.problem_setup import build_problem, checked_problem
from surehold.cli import run
from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.problems import GraspProblem
from surehold.problems.grasp.options import OPTIONS, THESIS_SIMULATOR, GraspOptions
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.trial_function import problem_of

SPACE = SearchSpace(Box({"dx": (0.0, 1.0), "dy": (0.0, 1.0)}))
CHOSEN = [
    (name, choice)
    for name, option in OPTIONS.items()
    for choice in option.choices
    if name != "preset" and (name, choice) != ("plan", "mean")  # which is of a cloud
]


def test_the_command_line_names_every_option_that_text_can_say(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert run(["grasp", "--help"]) == 0
    shown = capsys.readouterr().out
    for name, option in OPTIONS.items():
        words = "OBJECT" if name == "object" else f"--{name.replace('_', '-')} "
        assert (words in shown) == (option.text is not None), name


@pytest.mark.parametrize("name", OPTIONS)
def test_a_plan_takes_every_option_and_its_default_changes_nothing(name):
    plan = ProblemSetup(
        "grasp", 8, 5, {"object": "bottle", **({} if name == "object" else {name: OPTIONS[name].default})}
    )
    checked_problem("mine", plan)
    plain = build_problem(ProblemSetup("grasp", 8, 5, {"object": "bottle"}))
    assert repr(build_problem(plan)) == repr(plain)


@pytest.mark.parametrize(("name", "choice"), CHOSEN)
def test_studies_and_plans_mean_what_python_means(name, choice):
    expected = GraspProblem("bottle", **{name: choice})
    words = {"object": "bottle", name: choice}
    study = problem_of(StudySettings(SPACE, problem={"grasp": words}))
    plan = build_problem(ProblemSetup("grasp", 8, 5, {"collision": "penalty", **words}))
    x = expected.box.from_unit([0.3, 0.5])
    assert study(x) == plan(x) == expected(x)
    assert study._settings == plan._settings == expected._settings | {"hand": study._settings["hand"]}


def test_a_plan_for_clouds_is_refused_as_the_other_options_of_clouds():
    for name, value in {"plan": "mean", "shapes": 3, "prior": "box"}.items():
        with pytest.raises(InputError, match=f"{name} is for point clouds"):
            problem_of(StudySettings(SPACE, problem={"grasp": {"object": "bottle", name: value}}))


@pytest.mark.parametrize(("name", "value"), [("friction", 0.3), ("torsion", 0.002)])
def test_cones_that_simox_does_not_have_are_refused_everywhere(name, value):
    for given in ({"quality": "simox"}, {"preset": "thesis"}):
        with pytest.raises(InputError, match=f"{name} is {value}, but the quality 'simox'"):
            GraspProblem("bottle", **given, **{name: value})
        with pytest.raises(InputError, match=f"{name} is {value}, but the quality 'simox'"):
            build_problem(ProblemSetup("grasp", 8, 5, {"object": "bottle", **given, name: value}))
    own = {"friction": 1.0, "torsion": 0.0, "cones": "polyhedral"}
    assert GraspProblem("bottle", quality="simox", **own).simulator.friction == 1.0


def test_unknown_options_are_explained():
    with pytest.raises(InputError, match="option of a grasp 'contcat' is unknown; did you mean 'contact'"):
        GraspProblem("bottle", contcat="single")
    with pytest.raises(InputError, match="did you mean 'contact'"):
        checked_problem("mine", ProblemSetup("grasp", 8, 5, {"contcat": "single"}))


def test_studies_that_are_older_than_the_record_are_read_as_before():
    words = {"object": "bottle", "hand config": "", "unit": "", "variables": ["dx", "dy"]}
    plain = problem_of(StudySettings(SPACE, problem={"grasp": words}))
    thesis = problem_of(StudySettings(SPACE, optimizer={"preset": "thesis"}, problem={"grasp": words}))
    assert plain.simulator.contact == "graded"
    assert {name: thesis._settings[name] for name in THESIS_SIMULATOR} == THESIS_SIMULATOR


@pytest.mark.parametrize(("name", "choice"), [c for c in CHOSEN if c[0] in THESIS_SIMULATOR])
def test_what_contradicts_the_preset_is_refused(name, choice):
    if choice == THESIS_SIMULATOR[name]:
        same = GraspProblem("bottle", preset="thesis", **{name: choice})
        assert same._settings == GraspProblem("bottle", preset="thesis")._settings
    else:
        with pytest.raises(InputError, match=f"preset 'thesis' sets {name} to"):
            GraspProblem("bottle", preset="thesis", **{name: choice})


def test_the_record_has_a_valid_default_and_a_help_for_each():
    for name, option in OPTIONS.items():
        assert option.help.endswith("."), name
        assert not option.choices or option.default in option.choices, name
    assert set(GraspOptions.__annotations__) < set(OPTIONS)
    assert np.array_equal(GraspProblem("bottle").box.names, OPTIONS["variables"].default)

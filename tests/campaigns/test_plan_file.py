import os
import re
from pathlib import Path

import pytest

from surehold.campaigns.plan_file import load_plan, parse_plan, shipped_plans
from surehold.campaigns.problem_setup import build_problem
from surehold.campaigns.published import published
from surehold.campaigns.thesis import CLAIMS, EXHIBITS
from surehold.errors import InputError
from surehold.optimization.optimizer import Optimizer


def test_a_yaml_plan_is_the_plan_built_in_python(cheap, cheap_text):
    assert parse_plan(cheap_text, "cheap") == cheap


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("function: rkhs", "function: rkh", "did you mean 'rkhs'"),
        ("trials: 8", "trails: 8", "did you mean 'trials'"),
        ("trials: 8", "trials: many", "trials is 'many'"),
        ("trials: 8", "trials: 8.5", "trials is '8.5'"),
        ("title: A cheap plan", "", "'title' is missing"),
        ("runs: 4", "runs: 0", "runs of plan 'cheap' is 0"),
        ("runs: 4", "ruins: 4", "did you mean 'runs'"),
        ("surrogate: gp}", "surogate: gp}", "did you mean 'surrogate'"),
        ("surrogate: gp}", "surrogate: gpp}", "did you mean 'gp'"),
        ("surrogate: gp}", "preset: thesi}", "did you mean 'thesis'"),
        ("surrogate: gp}", "optimizer: optuna-tpee}", "did you mean 'optuna-tpe'"),
        ("surrogate: gp}", "optimizer: random, surrogate: gp}", "leave it out"),
        ("surrogate: gp, robust: true", "optimizer: random, robust: true", "cannot be told of input noise"),
        ("robust: true", "robust: perhaps", "robust is 'perhaps'"),
        ("input_noise: 0.01", "arguments: {x: 1}, input_noise: 0.01", "takes no arguments"),
        ("function: rkhs", "function: grasp, arguments: {objekt: mug}", "did you mean 'object'"),
        ("function: rkhs", "function: 'own.py:f'", "has no bounds"),
        ("title: A cheap plan", "title: A cheap plan\nextends: table-4.5", "did you mean 'table-4."),
        ("title: A cheap plan", "title: [", "is no YAML"),
        ("  flat: {", "  hill: {", "has 'hill' in lines 5 and 6; give it once"),
        ("trials: 8, initial: 5", "trials: 8, initial: 5, trials: 9", "has 'trials' in lines 5 and 5"),
        ("  UBO: {", "  no: {", "methods: the label False is no text"),
        (
            "  hill: {function: rkhs, trials: 8, initial: 5, input_noise: 0.01, requeries: 20}",
            "  hill:",
            "hill is 'None'",
        ),
    ],
)
def test_bad_plans_name_what_is_wrong(cheap_text, old, new, message):
    assert old in cheap_text
    with pytest.raises(InputError, match=message):
        parse_plan(cheap_text.replace(old, new, 1), "cheap")


def test_a_plan_that_is_no_mapping_is_refused():
    with pytest.raises(InputError, match="is empty"):
        parse_plan("# later", "cheap")
    with pytest.raises(InputError, match="give title"):
        parse_plan("- 1\n", "list")


def test_unknown_names_and_missing_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"did you mean 'table-4\.1'"):
        load_plan("table4.1")
    with pytest.raises(InputError, match="cannot be read"):
        load_plan(str(tmp_path / "gone.yaml"))


def test_a_plan_may_extend_a_shipped_one():
    plan = parse_plan("extends: table-4.1\ntitle: mine\nproblems: {GM: null, GF: {trials: 30}}", "mine")
    base = load_plan("table-4.1")
    assert list(plan.problems) == ["RKHS", "GF"]
    assert plan.problems["GF"].trials == 30
    assert plan.problems["RKHS"] == base.problems["RKHS"]
    assert plan.methods == base.methods


def test_a_plan_from_python(tmp_path, cheap):
    (tmp_path / "mine.py").write_text(
        "from surehold.campaigns.plan import *\n"
        "def plan():\n"
        "    return Plan('mine', 't', {'a': ProblemSetup('rkhs', 8, 5)}, {'m': MethodSetup('random')})\n"
        "def other():\n"
        "    return 3\n"
        "def broken():\n"
        "    return 1 / 0\n"
    )
    assert load_plan(f"{tmp_path}/mine.py:plan").name == "mine"
    with pytest.raises(InputError, match="returned a int"):
        load_plan(f"{tmp_path}/mine.py:other")
    with pytest.raises(InputError, match="raised ZeroDivisionError"):
        load_plan(f"{tmp_path}/mine.py:broken")
    with pytest.raises(InputError, match="did you mean 'plan'"):
        load_plan(f"{tmp_path}/mine.py:plant")


def test_the_plan_of_the_readme_is_one():
    text = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert len(parse_plan(block, "readme").cells()) == 3


@pytest.mark.parametrize("name", shipped_plans())
def test_shipped_plans_are_sound(name):
    plan = load_plan(name)
    assert plan.tasks(1)
    for on in plan.problems.values():
        if name.startswith("high-dimension"):
            assert on.initial == Optimizer.default_n_initial(build_problem(on).box), "what users get by default"
        elif on.function != "grasp":
            assert build_problem(on).box.dimension in (1, 2, 3)


def test_every_published_number_has_a_cell_in_a_plan():
    for name, exhibit in EXHIBITS.items():
        for plan in (load_plan(name), load_plan(f"{name}-defaults")):
            for cell in plan.cells():
                if cell.problem == "glass 7-D":  # only drawn, Figure 4.17
                    continue
                for measure in exhibit.measures:
                    assert published(exhibit.table, cell.problem, cell.method, measure) is not None, (name, cell)
            for places in exhibit.figures.values():
                assert {problem for problem, _ in places} <= set(plan.problems)


def test_budgets_are_the_thesis_ones():
    budgets = {
        (name, label): (on.initial, on.trials, on.input_noise)
        for name in EXHIBITS
        for label, on in load_plan(name).problems.items()
    }
    assert budgets["table-4.1", "RKHS"] == (5, 50, None)
    assert budgets["table-4.1", "GF"] == (20, 60, None)
    assert budgets["table-4.1", "GM"] == (30, 140, None)
    assert budgets["table-4.2", "bottle top"] == (30, 150, None)
    assert budgets["table-4.4", "RKHS"] == (5, 50, 0.01)
    assert budgets["table-4.4", "GM"] == (30, 120, 0.1)
    assert budgets["table-4.4-grasps", "mug"] == (40, 100, 0.03)


def test_claims_name_cells_that_exist():
    for claim in CLAIMS:
        plan = load_plan(claim.plan)
        assert claim.problem in plan.problems, claim
        assert {claim.better, claim.than} <= set(plan.methods), claim


def bomb():
    """Nine lists of nine times the one before: 3e9 values in 800 characters."""
    lists = ["k0: &a0 [y,y,y,y,y,y,y,y,y]"]
    lists += [f"k{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 10)]
    return "title: t\nproblems:\n  r:\n    arguments:\n      " + "\n      ".join(lists) + "\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (bomb(), "more than 100,000 values"),
        ("a: &a [*a]", "more than 100,000 values"),
        ("a: " + "[" * 50_000, "too deeply"),
        ("a: " + "[" * 50_000 + "]" * 50_000, "longer than|too deeply"),
        ("# " + "x" * 200_000, "longer than"),
        ('title: "\\ud800"', "no Unicode"),
        ("title: 2001-99-99", "no YAML"),
        ("runs: 1" + "0" * 400, "bits"),
        ("runs: 1" + "0" * 5000, "no YAML"),
    ],
    ids=["aliases", "an endless alias", "open", "deep", "long", "surrogate", "date", "large", "larger"],
)
def test_plans_without_limits_are_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_plan(text, "bad")


@pytest.mark.parametrize("runs", ["1000000000", "10001"])
def test_runs_have_a_limit(cheap_text, runs):
    with pytest.raises(InputError, match="from 1 to 10,000"):
        parse_plan(
            f"{cheap_text}\nruns: {runs}\n"
            if "runs:" not in cheap_text
            else re.sub(r"runs: \d+", f"runs: {runs}", cheap_text),
            "cheap",
        )


def test_a_pipe_is_no_plan_file(tmp_path):
    os.mkfifo(tmp_path / "plan.yaml")
    with pytest.raises(InputError, match="is no file"):
        load_plan(str(tmp_path / "plan.yaml"))

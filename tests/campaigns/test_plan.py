from dataclasses import replace

import pytest

from surehold.campaigns.plan import MethodSetup, Plan, ProblemSetup, share_of
from surehold.errors import InputError
from surehold.optimization.surrogates.named import DEFAULT_SURROGATE


def test_runs_go_seed_by_seed_through_all_cells(cheap):
    tasks = cheap.tasks()
    assert len(tasks) == 4 * 2 * 2
    assert [(t.cell.problem, t.cell.method, t.seed) for t in tasks[:5]] == [
        ("hill", "BO", 0),
        ("hill", "UBO", 0),
        ("flat", "BO", 0),
        ("flat", "UBO", 0),
        ("hill", "BO", 1),
    ]


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_shares_are_disjoint_and_complete(cheap, n):
    shares = [{(t.cell.problem, t.cell.method, t.seed) for t in cheap.tasks(shard=(i, n))} for i in range(1, n + 1)]
    assert sum(map(len, shares)) == len(set().union(*shares)) == len(cheap.tasks())


def test_only_takes_problems_and_methods(cheap):
    assert {(c.problem, c.method) for c in cheap.cells(["hill"])} == {("hill", "BO"), ("hill", "UBO")}
    assert {(c.problem, c.method) for c in cheap.cells(["UBO", "flat"])} == {("flat", "UBO")}
    with pytest.raises(InputError, match="did you mean 'hill'"):
        cheap.cells(["hil"])


def test_the_digest_follows_every_setting(cheap):
    cell = cheap.cells()[0]
    digests = {cell.digest}
    for change in ({"trials": 9}, {"initial": 4}, {"input_noise": 0.02}, {"requeries": 3}, {"observation_noise": 0.1}):
        digests.add(replace(cell, on=replace(cell.on, **change)).digest)
    digests.add(replace(cell, by=replace(cell.by, settings={"surrogate": "tgp"})).digest)
    digests.add(replace(cell, by=replace(cell.by, robust=True)).digest)
    assert len(digests) == 8
    assert replace(cell, problem="renamed").digest == cell.digest


def test_settings_of_the_method_come_before_those_of_the_problem():
    problem = ProblemSetup("rkhs", 8, 5, settings={"preset": "thesis-rkhs", "k": 2.0})
    plan = Plan("p", "t", {"a": problem}, {"m": MethodSetup(settings={"preset": None})})
    assert plan.cells()[0].as_data()["settings"] == {"k": 2.0, "surrogate": DEFAULT_SURROGATE}
    thesis = Plan("p", "t", {"a": problem}, {"m": MethodSetup()})
    assert thesis.cells()[0].as_data()["settings"] == {"preset": "thesis-rkhs", "k": 2.0}
    other = Plan("p", "t", {"a": problem}, {"m": MethodSetup("random")})
    assert other.cells()[0].as_data()["settings"] == {}


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        ({"trials": 0}, "trials of problem 'hill' in plan 'cheap' is 0"),
        ({"initial": 9}, "initial of problem 'hill' in plan 'cheap' is 9, but trials is 8"),
        ({"requeries": 0}, "requeries"),
        ({"input_noise": -0.1}, "input_noise"),
        ({"input_noise": None}, "'UBO' is robust"),
        ({"observation_noise": float("nan")}, "observation_noise"),
    ],
)
def test_bad_budgets_are_refused(cheap, problem, message):
    with pytest.raises(InputError, match=message):
        replace(cheap, problems={"hill": replace(cheap.problems["hill"], **problem)})


def test_no_runs_problems_or_methods_are_refused(cheap):
    for changes in ({"runs": 0}, {"problems": {}}, {"methods": {}}):
        with pytest.raises(InputError):
            replace(cheap, **changes)
    with pytest.raises(InputError, match="runs is 0"):
        cheap.tasks(runs=0)


def test_a_label_that_a_list_of_labels_would_cut_is_refused(cheap):
    with pytest.raises(InputError, match="label 'hill, steep' in plan 'cheap' has a comma"):
        replace(cheap, problems={"hill, steep": cheap.problems["hill"]})


def test_a_problem_without_a_name_is_refused(cheap):
    with pytest.raises(InputError, match="in plan 'cheap' is named ''; give it a label"):
        replace(cheap, problems={"": cheap.problems["hill"]})


@pytest.mark.parametrize("text", ["0/2", "3/2", "2", "a/b", "1/0", "1/2/3"])
def test_bad_shares_are_refused(text):
    with pytest.raises(InputError, match="shard"):
        share_of(text)

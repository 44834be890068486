import numpy as np
import pytest
from scipy.stats import qmc

from surehold.campaigns.embedded import EMBEDDED
from surehold.campaigns.methods import METHODS, build_method
from surehold.campaigns.peers import PEERS, REQUIRES, installed_peers
from surehold.campaigns.plan import MethodSetup, Plan, ProblemSetup
from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk


def hill(u):
    return 1.0 - float(np.sum((u - 0.3) ** 2))


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("name", METHODS)
def test_every_method_asks_first_for_the_design_and_answers_with_a_good_point(name, robust):
    if name in PEERS and name not in installed_peers():
        pytest.skip(f"{', '.join(REQUIRES[name])} is not installed")
    if robust and name not in ("surehold", "botorch"):
        pytest.skip(f"{name} cannot be told of input noise")
    plan = Plan("p", "t", {"a": ProblemSetup("gf", 9, 6, input_noise=0.05)}, {"m": MethodSetup(name, robust)})
    initial = qmc.LatinHypercube(2, rng=1).random(6)
    method = build_method(plan.cells()[0], 2, initial, 0)
    asked = []
    for _ in range(9):
        u = np.asarray(method.ask())
        asked.append(u)
        method.tell(u, hill(u))
    if name not in EMBEDDED:  # whose design lies in a subspace
        assert np.array(asked[:6]) == pytest.approx(initial)
    assert np.all((np.array(asked) >= 0.0) & (np.array(asked) <= 1.0))
    answer = np.asarray(method.answer())
    assert answer.shape == (2,)
    assert hill(answer) >= np.median([hill(u) for u in asked])
    if not robust:
        assert hill(answer) == pytest.approx(max(hill(u) for u in asked))


@pytest.mark.parametrize(("function", "border"), [("nes-polynomial", "clip"), ("nes-gmm", "extend")])
def test_robust_methods_are_told_where_the_problem_clips_its_inputs(function, border):
    plan = Plan("p", "t", {"a": ProblemSetup(function, 9, 6, input_noise="own")}, {"m": MethodSetup("surehold", True)})
    method = build_method(plan.cells()[0], 2, np.full((1, 2), 0.5), 0)
    assert method._optimizer._ranking.accurate.border == border
    told = {"border": "keep"}
    plan = Plan(
        "p", "t", {"a": ProblemSetup(function, 9, 6, input_noise="own")}, {"m": MethodSetup("surehold", True, told)}
    )
    assert build_method(plan.cells()[0], 2, np.full((1, 2), 0.5), 0)._optimizer._ranking.accurate.border == "keep"


@pytest.mark.parametrize(
    ("told", "risk"),
    [({}, Risk("mean-variance", beta=0.5)), ({"risk": "mean"}, Risk()), ({"risk": "cvar"}, Risk("cvar"))],
)
def test_parameters_of_a_problems_measure_are_not_of_a_methods_own(told, risk):
    problems = {"a": ProblemSetup("qing-branin", 9, 6, input_noise="own")}
    plan = Plan("p", "t", problems, {"m": MethodSetup("surehold", True, told)})
    assert build_method(plan.cells()[0], 2, np.full((1, 2), 0.5), 0)._optimizer.risk == risk


def test_a_trust_region_that_became_too_small_begins_anew():
    if "botorch-turbo" not in installed_peers():
        pytest.skip("botorch is not installed")
    initial = qmc.LatinHypercube(2, rng=1).random(6)
    method = PEERS["botorch-turbo"](2, initial, 0)
    for u in initial:
        method.tell(method.ask(), hill(u))
    for _ in range(4 * 7):  # four failures halve a side of 0.8, seven halvings are one too many
        method.tell(np.zeros(2), -1.0)
    again = [method.ask() for _ in range(6)]
    assert np.all(np.ptp(again, axis=0) > 0.3)
    assert len(np.unique(again, axis=0)) == 6
    assert hill(method.answer()) == max(hill(u) for u in initial), "what was found before is not forgotten"


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(REQUIRES, "optuna-tpe", ("no_such_library",))
    plan = Plan("p", "t", {"a": ProblemSetup("gf", 9, 6)}, {"m": MethodSetup("optuna-tpe")})
    with pytest.raises(InputError, match="no_such_library"):
        build_method(plan.cells()[0], 2, np.zeros((6, 2)), 0)

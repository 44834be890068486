from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surehold.campaigns.plan import MethodSetup, Plan, ProblemSetup
from surehold.campaigns.plan_file import load_plan
from surehold.campaigns.single_run import TIMES, changes, expanded, run_once
from surehold.optimization.box import Box
from surehold.optimization.maximization import maximize
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.named import robust_problem
from surehold.problems.perturbation import perturbed_points, robust_score
from surehold.problems.synthetic import RKHS, synthetic_function

OWN = """
def slips(x):
    if x[0] > 0.6:
        raise RuntimeError("slipped")
    return float(x[0])

def raises(x):
    raise ValueError("the rig is off")

def nothing(x):
    return float("nan")
"""


def cell_of(problem, method=None):
    return Plan("p", "t", {"a": problem}, {"m": method or MethodSetup()}).cells()[0]


def without_times(row):
    return {name: value for name, value in row.items() if name not in TIMES}


@given(st.lists(st.sampled_from([1.0, 2.5, np.nan, -3.25]), min_size=1, max_size=30))
def test_changes_and_back(trace):
    assert np.array_equal(expanded(changes(trace), len(trace)), trace, equal_nan=True)


def test_a_run_is_the_optimizers_own():
    """The campaign's loop is `maximize`: same design, same trials, same best values."""
    row = run_once(cell_of(ProblemSetup("rkhs", 16, 5)), 3)
    p = RKHS()
    result = maximize(p, p.box, 16, n_initial=5, seed=3)
    assert row["status"] == "done", row.get("error")
    assert expanded(row["best"], 16) == pytest.approx(np.maximum.accumulate(result.y), rel=1e-8)
    assert row["x"] == pytest.approx(result.X[result.best_index], rel=1e-8)


def test_the_answer_is_scored_as_robust_score_does():
    problem = ProblemSetup("rkhs", 14, 6, input_noise=0.01, requeries=30)
    noise, p = InputNoise.unit(0.01), RKHS()
    for robust in (False, True):
        row = run_once(cell_of(problem, MethodSetup(robust=robust)), 2)
        told = maximize(p, p.box, 14, n_initial=6, seed=2, input_noise=noise if robust else None)
        x = told.recommendation.x if robust else told.X[told.best_index]
        score = robust_score(p, x, noise, 30, 2)
        assert row["mean"][-1][1] == pytest.approx(score.mean, rel=1e-7)
        assert row["worst"][-1][1] == pytest.approx(score.worst, rel=1e-7)
        assert row["std"][-1][1] == pytest.approx(score.std, rel=1e-6)
        assert row["expectation"] == pytest.approx(p.expectation(x, noise), rel=1e-7)


def test_traces_of_the_initial_design_show_the_highest_observed():
    row = run_once(cell_of(ProblemSetup("gf", 8, 6, input_noise=0.05, requeries=10), MethodSetup(robust=True)), 0)
    best = expanded(row["best"], 8)[:5]
    values = expanded(row["value"], 8)[:5] if "value" in row else best
    assert values == pytest.approx(best)


def test_all_methods_share_design_and_noise():
    problem = ProblemSetup("rkhs", 7, 6, observation_noise=0.3)
    methods = (MethodSetup(), MethodSetup(settings={"surrogate": "tgp"}), MethodSetup("random"))
    rows = [run_once(cell_of(problem, method), 5) for method in methods]
    first = [expanded(row["best"], 7)[:6] for row in rows]
    assert first[0] == pytest.approx(first[1])
    assert first[0] == pytest.approx(first[2])


def test_observation_noise_only_lowers_what_is_told():
    row = run_once(cell_of(ProblemSetup("rkhs", 6, 6, observation_noise=0.5), MethodSetup("random")), 1)
    told, true = row["best"][-1][1], row["value"][-1][1]
    assert told < true <= RKHS().optimum.value


def test_a_run_repeats_bit_for_bit_but_for_times():
    cell = cell_of(ProblemSetup("gf", 10, 6, input_noise=0.05), MethodSetup(robust=True))
    assert without_times(run_once(cell, 4)) == without_times(run_once(cell, 4))
    assert without_times(run_once(cell, 4)) != without_times(run_once(cell, 5))


def test_the_tree_is_traced():
    method = MethodSetup(settings={"surrogate": "tgp", "min_leaf": 4})
    row = run_once(cell_of(ProblemSetup("rkhs", 16, 10), method), 0)
    leaves = expanded(row["leaves"], 16)
    split = row["first_split"]
    assert leaves[-1] > 1
    assert leaves[split - 1] > 1
    assert np.all(leaves[: split - 1] == 1)
    assert "leaves" not in run_once(cell_of(ProblemSetup("rkhs", 6, 5)), 0)


def test_settings_reach_the_optimizer():
    problem = ProblemSetup("rkhs", 12, 8)
    base = run_once(cell_of(problem), 0)
    for settings in ({"preset": "thesis-rkhs"}, {"criterion": "ucb", "kappa": 9.0}):
        assert run_once(cell_of(problem, MethodSetup(settings=settings)), 0)["best"] != base["best"], settings


def test_failed_trials_are_counted_and_failed_runs_are_recorded(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    problem = ProblemSetup(f"{tmp_path}/own.py:slips", 10, 6, {"bounds": "x=0:1"})
    for optimizer in ("surehold", "random"):
        row = run_once(cell_of(problem, MethodSetup(optimizer)), 0)
        assert row["status"] == "done", row
        assert row["failed_trials"] > 0
        assert row["best"][-1][1] <= 0.6
    row = run_once(cell_of(replace(problem, function=f"{tmp_path}/own.py:nothing")), 0)
    assert row["status"] == "failed"
    assert "all 10 trials failed; the first: " in row["error"]
    row = run_once(cell_of(replace(problem, function=f"{tmp_path}/own.py:raises")), 0)
    assert row["error"] == "ValueError: all 10 trials failed; the first: ValueError: the rig is off"
    row = run_once(cell_of(replace(problem, function=f"{tmp_path}/own.py:gone")), 0)
    assert row["status"] == "failed"
    assert "InputError" in row["error"]
    assert row["settings"]["trials"] == 10


def test_a_grasp_is_run():
    grasp = ProblemSetup("grasp", 6, 5, {"object": "bottle"}, input_noise=0.03, requeries=4)
    row = run_once(cell_of(grasp), 0)
    assert row["status"] == "done", row.get("error")
    assert len(row["x"]) == 2
    assert row["worst"][-1][1] <= row["mean"][-1][1]
    assert row["expectation"] is None


def test_rows_carry_settings_and_versions():
    row = run_once(cell_of(ProblemSetup("gf", 6, 6)), 0)
    assert row["settings"]["function"] == "gf"
    assert {"surehold", "source", "numpy", "scipy", "numba", "python"} == set(row["versions"])
    assert len(row["ask_seconds"]) == 6


def test_scores_stay_below_the_optimum():
    row = run_once(cell_of(ProblemSetup("gm", 12, 10, input_noise=0.1), MethodSetup(robust=True)), 0)
    assert row["best"][-1][1] <= synthetic_function("gm").optimum.value


def test_regret_under_a_problems_own_noise():
    plan = load_plan("robust-published")
    (cell,) = [c for c in plan.cells() if (c.problem, c.method) == ("Qing sin + linear", "random")]
    row = run_once(cell, 0)
    problem = robust_problem("qing-sin-linear")
    assert row["status"] == "done"
    best = problem.function.box.from_unit(np.array(row["x"]))
    assert row["regret"][-1][1] == pytest.approx(problem.optimum.value - problem.value(best[None])[0], abs=1e-6)
    assert min(regret for _, regret in row["regret"]) > -1e-5


def test_re_queries_without_a_value_count_as_the_lowest_of_the_run(tmp_path, monkeypatch):
    """An answer beside a crash must not be praised for losing its bad cases."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(OWN)
    on = ProblemSetup("own.py:slips", 10, 6, {"bounds": "x=0:1"}, input_noise=0.05)
    row = run_once(cell_of(on, MethodSetup(settings={"surrogate": "gp"})), 1)
    (x,) = row["x"]
    reached = perturbed_points([x], Box({"x": (0.0, 1.0)}), InputNoise.unit(0.05), 100, 1)[:, 0]
    lost = reached > 0.6
    assert row["failed_requeries"] == np.count_nonzero(lost) > 10
    lowest = min(value for value in maximize_told(row, on) if np.isfinite(value))
    values = np.where(lost, lowest, reached)
    ended = [row[name][-1][1] for name in ("mean", "worst", "std")]
    assert ended == pytest.approx([values.mean(), values.min(), values.std(ddof=1)], rel=1e-8)


def maximize_told(row, on):
    """Return the values of the trials of a run without noise: those of `maximize` with the same seed."""

    def slips(x):
        if x[0] > 0.6:
            raise RuntimeError("slipped")
        return float(x[0])

    box = Box({"x": (0.0, 1.0)})
    return maximize(slips, box, on.trials, n_initial=on.initial, seed=row["seed"], surrogate="gp").y

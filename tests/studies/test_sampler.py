import copy
import pickle
import warnings

import numpy as np
import optuna
import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import TrialState, create_trial

import surehold as sh
from surehold.defaults import MANY
from surehold.errors import InputError
from surehold.studies.search_space import SearchSpace

SPACE = {"x": FloatDistribution(0.0, 1.0), "k": IntDistribution(1, 6), "c": CategoricalDistribution(["a", "b"])}


@pytest.fixture(autouse=True, scope="module")
def quiet():
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    yield
    optuna.logging.set_verbosity(before)


def value(p):
    return -((p["x"] - 0.3) ** 2) - 0.1 * abs(p["k"] - 4) - (0.5 if p["c"] == "a" else 0.0)


def run(study, n, space=SPACE, f=value):
    asked = []
    for _ in range(n):
        trial = study.ask(space)
        asked.append(trial.params)
        study.tell(trial, f(trial.params))
    return asked


def new(sampler, direction="maximize"):
    return optuna.create_study(direction=direction, sampler=sampler)


@pytest.mark.parametrize("surrogate", ["gp", "tgp"])
def test_mixed_parameters_are_optimized(surrogate):
    study = new(sh.Sampler(SPACE, seed=0, surrogate=surrogate, n_initial=10))
    asked = run(study, 40)
    assert study.best_params["k"] == 4
    assert study.best_params["c"] == "b"
    assert abs(study.best_params["x"] - 0.3) < 0.02
    assert len({tuple(p.values()) for p in asked}) == len(asked)


def test_minimizing_is_maximizing_the_negative():
    up = run(new(sh.Sampler(SPACE, seed=1)), 20)
    down = run(new(sh.Sampler(SPACE, seed=1), "minimize"), 20, f=lambda p: -value(p))
    assert up == down


def test_input_noise_moves_the_answer_off_the_spike():
    def spiked(p):
        return 1.5 * np.exp(-0.5 * ((p["x"] - 0.2) / 0.01) ** 2) + np.exp(-0.5 * ((p["x"] - 0.7) / 0.1) ** 2)

    sampler = sh.Sampler({"x": (0.0, 1.0)}, input_noise=sh.InputNoise.unit(0.03), seed=0)
    study = new(sampler)
    run(study, 40, {"x": FloatDistribution(0.0, 1.0)}, spiked)
    assert abs(sampler.optimizer(study).recommend().x[0] - 0.7) < 0.03


def test_the_next_trial_depends_on_history_number_and_seed_alone():
    study = new(sh.Sampler(SPACE, seed=5))
    asked = run(study, 16)
    for k in range(16):
        other = optuna.create_study(direction="maximize", sampler=sh.Sampler(SPACE, seed=5))
        other.add_trials(study.trials[:k])
        assert other.ask(SPACE).params == asked[k]
    assert new(sh.Sampler(SPACE, seed=6)).ask(SPACE).params != asked[0]


def test_the_first_trial_is_ours_where_the_space_is_known():
    sampler = sh.Sampler({"x": (0.0, 1.0), "y": (0.0, 1.0)}, seed=0, n_initial=8)
    study = new(sampler)
    box = sh.Box({"x": (0.0, 1.0), "y": (0.0, 1.0)})
    expected = sh.Optimizer(box, seed=0, n_initial=8).ask(8)
    asked = run(study, 8, {n: FloatDistribution(0.0, 1.0) for n in "xy"}, lambda p: p["x"])
    assert np.allclose([[p["x"], p["y"]] for p in asked], expected, atol=1e-15)


def add(study, state, params, **more):
    study.add_trial(create_trial(state=state, params=params, distributions=SPACE, **more))


HISTORY = [
    {"x": 0.1, "k": 1, "c": "a"},
    {"x": 0.9, "k": 6, "c": "b"},
    {"x": 0.5, "k": 3, "c": "a"},
    {"x": 0.33, "k": 4, "c": "b"},
]


def complete(study, rows=HISTORY):
    for p in rows:
        add(study, TrialState.COMPLETE, p, value=value(p))


def test_running_and_enqueued_trials_are_pending():
    sampler = sh.Sampler(SPACE, seed=0, n_initial=2)
    study = new(sampler)
    complete(study)
    add(study, TrialState.RUNNING, {"x": 0.25, "k": 4, "c": "b"})
    study.enqueue_trial({"x": 0.35, "k": 4, "c": "b"})
    study.enqueue_trial({"x": 0.6})  # incomplete: nothing is known of it yet
    optimizer = sampler.optimizer(study)
    assert optimizer.pending[:, 0].tolist() == [0.25, 0.35]
    assert len(optimizer.y) == 4
    trial = study.ask(SPACE)  # the enqueued one comes first
    assert trial.params == {"x": 0.35, "k": 4, "c": "b"}
    assert study.ask(SPACE).params["x"] == 0.6


def test_failed_trials_are_avoided_and_retried_ones_forgotten():
    sampler = sh.Sampler(SPACE, seed=0)
    study = new(sampler)
    complete(study)
    add(study, TrialState.FAIL, {"x": 0.4, "k": 4, "c": "b"})
    add(study, TrialState.FAIL, {"x": 0.7, "k": 4, "c": "b"})
    add(study, TrialState.PRUNED, {"x": 0.8, "k": 4, "c": "b"})
    add(study, TrialState.WAITING, {"x": 0.7, "k": 4, "c": "b"}, system_attrs={"retry_history": [5]})
    optimizer = sampler.optimizer(study)
    assert np.isnan(optimizer.y[4:]).all()
    assert optimizer.X[4:, 0].tolist() == [0.4, 0.8]
    assert optimizer.pending[:, 0].tolist() == [0.7]


def test_infinite_values_count_as_failed_and_foreign_trials_are_left_out():
    sampler = sh.Sampler(SPACE, seed=0, n_initial=2)
    study = new(sampler)
    complete(study)
    add(study, TrialState.COMPLETE, HISTORY[0], value=float("inf"))
    study.add_trial(create_trial(params={"z": 1.0}, distributions={"z": FloatDistribution(0, 2)}, value=1.0))
    optimizer = sampler.optimizer(study)
    assert np.isnan(optimizer.y[4])
    assert len(optimizer.y) == 5
    assert study.ask(SPACE).params["c"] in "ab"


def test_conditional_spaces_fall_back_with_a_warning(caplog):
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    optuna.logging.enable_propagation()
    optuna.logging.set_verbosity(optuna.logging.INFO)
    try:
        study = new(sh.Sampler({"x": (0.0, 1.0)}, seed=0))
        one = study.ask()
        one.suggest_float("x", 0.0, 1.0)
        drawn = one.suggest_float("extra", 0.0, 1.0)
        assert "Parameter 'extra' of trial 0 is drawn at random" in caplog.text
    finally:
        optuna.logging.disable_propagation()
        optuna.logging.set_verbosity(optuna.logging.ERROR)
    again = new(sh.Sampler({"x": (0.0, 1.0)}, seed=0, warn_independent_sampling=False)).ask()
    assert again.suggest_float("extra", 0.0, 1.0) == drawn  # from (seed, number, name) alone
    assert again.suggest_float("other", 0.0, 1.0) != drawn


def test_parallel_threads_and_copies():
    study = new(sh.Sampler(SPACE, seed=0, n_initial=4))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study.optimize(lambda t: value({n: t._suggest(n, d) for n, d in SPACE.items()}), n_trials=16, n_jobs=4)
    assert len(study.trials) == 16
    assert all(t.state == TrialState.COMPLETE for t in study.trials)
    expected = study.sampler.suggest(study.trials, 16, "maximize")
    for other in (pickle.loads(pickle.dumps(study.sampler)), copy.deepcopy(study.sampler)):
        assert other.suggest(study.trials, 16, "maximize") == expected


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"search_space": {"x": (1.0, 0.0)}}, "smaller"),
        ({"search_space": SPACE, "criterion": "eii"}, "did you mean"),
        ({"surrogate": "gpp"}, "gpp"),
        ({"seed": -1}, "seed"),
        ({"search_space": SPACE, "input_noise": sh.InputNoise({"x": 0.1})}, "says nothing about k"),
        ({"criterion": "robust_ei"}, "needs input noise"),
        ({"criteron": "ei"}, "did you mean 'criterion'"),
        ({"constraints_func": len}, "has no constraints_func; limits are constraints="),
    ],
)
def test_bad_settings_are_refused_at_once(arguments, message):
    with pytest.raises(InputError, match=message):
        sh.Sampler(**arguments)


def test_several_objectives_are_refused():
    study = optuna.create_study(directions=["minimize", "maximize"], sampler=sh.Sampler(SPACE))
    with pytest.raises(ValueError, match="multi-objective"):
        study.ask(SPACE)


def test_only_one_value_is_no_optimization_but_a_trial():
    study = new(sh.Sampler({"a": IntDistribution(1, 1)}))
    assert study.ask({"a": IntDistribution(1, 1)}).params == {"a": 1}
    with pytest.raises(InputError, match="one value only"):
        study.sampler.optimizer(study)


def test_many_trials_keep_the_surrogate_and_its_convergence(caplog):
    space = {f"x{i}": FloatDistribution(0.0, 1.0) for i in range(6)}
    top = np.linspace(0.2, 0.8, 6)
    study = new(sh.Sampler(space, seed=0))
    tried = np.random.default_rng(0).random((MANY + 1, 6))
    values = -np.square(tried - top).sum(axis=1)
    for x, value in zip(tried.tolist(), values.tolist(), strict=True):
        study.add_trial(create_trial(params=dict(zip(space, x, strict=True)), distributions=space, value=value))
    with caplog.at_level("WARNING", logger="surehold"):
        run(study, 6, space, lambda p: -float(np.square(np.array(list(p.values())) - top).sum()))
    assert caplog.text.count(f"more than {MANY} trials") == 1
    assert study.best_value > 0.02 * values.max(), "a tree's leaves take back what all trials together have taught"


def test_a_choice_counts_as_one_variable_in_the_size_of_the_design():
    choices = {name: CategoricalDistribution(list("abcdefgh"[:k])) for name, k in (("s", 4), ("b", 4), ("l", 8))}
    space = choices | {
        "T": FloatDistribution(90, 120),
        "conc": FloatDistribution(0.05, 0.16),
        "only": IntDistribution(3, 3),
    }
    sampler = sh.Sampler(space, seed=0)
    assert sampler.n_initial(SearchSpace(space)) == 21
    study = new(sampler)
    asked = run(study, 26, space, lambda p: -abs(p["T"] - 108.0) - (p["s"] != "a"))
    assert len(asked) == 26
    assert sampler.optimizer(study).n_initial == 21


def test_input_noise_that_is_a_number_names_the_right_call():
    with pytest.raises(InputError, match=r"InputNoise.unit\(0.03\)"):
        sh.Sampler({"x": (0.0, 1.0), "grip": CategoricalDistribution(["a", "b"])}, input_noise=0.03)


def test_settings_about_variables_wait_for_them():
    """Without a search space nothing is known of the variables that they name, until trials have said them."""
    first = [{"a": 0.25, "b": 0.5}]
    sampler = sh.Sampler(allowed="a + b <= 1.2", initial_points=first, seed=0)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    study.optimize(lambda trial: trial.suggest_float("a", 0.0, 1.0) - trial.suggest_float("b", 0.0, 1.0), n_trials=8)
    assert all(trial.params["a"] + trial.params["b"] <= 1.2 for trial in study.trials[1:])


def test_the_size_of_the_design_is_the_optimizers():
    space = {f"x{i}": (0.0, 1.0) for i in range(6)}
    fixed = {"x0": 0.1, "x1": 0.1, "x2": 0.1, "x3": 0.1}
    sampler = sh.Sampler(space, fixed=fixed)
    assert sampler.n_initial(SearchSpace(space)) == sh.Optimizer(sh.Box(space), fixed=fixed).n_initial
    points = np.full((25, 6), 0.5) + 0.01 * np.arange(25)[:, None]
    assert sh.Sampler(space, initial_points=points).n_initial(SearchSpace(space)) == 25


def test_trials_of_a_study_tell_no_noise():
    with pytest.raises(InputError, match="do not tell their noise"):
        sh.Sampler(SPACE, noise="told")

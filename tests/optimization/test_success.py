"""Success and failure from the optimizer's door."""

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.special import ndtr

import surehold as sh
from surehold.defaults import CONTENDERS
from surehold.errors import InputError
from surehold.optimization.acquisition.probability_improvement import ProbabilityImprovement, improvement
from surehold.optimization.surrogates.success.beta_process import BetaPosterior
from surehold.optimization.surrogates.success.model import SuccessProcess

BOX = sh.Box({"x": (0.0, 1.0)})


def probability(x):
    return ndtr(2.0 - 60.0 * (x[0] - 0.7) ** 2)


def run(trials, seed=0, **settings):
    optimizer = sh.Optimizer(BOX, outcome="success", seed=seed, **settings)
    rng = np.random.default_rng(seed)
    for _ in range(trials):
        x = optimizer.ask()
        optimizer.tell(x, success=bool(rng.random() < probability(x)))
    return optimizer


@pytest.mark.parametrize("best", [0.0, 0.4, 0.95])
@pytest.mark.parametrize(("mu", "sd"), [(0.5, 1.0), (-1.0, 0.4), (2.0, 2.0), (1.0, 0.15)])
def test_expected_improvement_of_the_probability_by_quadrature(mu, sd, best):
    exact = integrate.quad(
        lambda f: max(ndtr(f) - best, 0.0) * stats.norm.pdf(f, mu, sd), mu - 12 * sd, mu + 12 * sd, limit=400
    )[0]
    value, by_mu, by_sd = improvement(np.array(mu), np.array(sd), best)
    assert value == pytest.approx(exact, abs=2e-4)
    h = 1e-6
    assert by_mu == pytest.approx((improvement(np.array(mu + h), np.array(sd), best)[0] - value) / h, abs=1e-4)
    assert by_sd == pytest.approx((improvement(np.array(mu), np.array(sd + h), best)[0] - value) / h, abs=1e-4)


def test_gradient_of_the_criterion_by_differences():
    X = np.random.default_rng(0).random((15, 2))
    posterior = SuccessProcess().condition(X, (X[:, 0] > 0.5).astype(float), np.random.default_rng(0))
    criterion, U = ProbabilityImprovement(posterior, 0.8), np.array([[0.3, 0.4], [0.9, 0.2]])
    gradient = criterion.with_gradient(U)[1]
    for k in range(2):
        h = 1e-6 * np.eye(2)[k]
        np.testing.assert_allclose(gradient[:, k], (criterion(U + h) - criterion(U - h)) / 2e-6, atol=1e-4)


def test_finds_where_trials_succeed():
    found = [run(30, seed).recommend("box").x for seed in range(3)]
    assert np.mean([probability(x) for x in found]) > 0.9


def test_does_not_repeat_one_place_endlessly():
    optimizer = sh.Optimizer(BOX, outcome="success", seed=0)
    for _ in range(40):
        optimizer.tell(optimizer.ask(), success=True)
    assert len(np.unique(optimizer.X.round(3))) > 20


def test_under_noise_a_narrow_place_is_refused():
    noise = sh.InputNoise.unit(0.06)
    optimizer = sh.Optimizer(BOX, outcome="success", input_noise=noise, seed=1)
    rng = np.random.default_rng(0)
    for _ in range(30):
        x = optimizer.ask()
        p = 0.98 if abs(x[0] - 0.2) < 0.03 else 0.9 * np.exp(-0.5 * ((x[0] - 0.7) / 0.15) ** 2)
        optimizer.tell(x, successes=int(rng.binomial(10, p)), of=10)
    best = optimizer.recommend()
    assert abs(best.x[0] - 0.7) < 0.12
    assert 0.0 <= best.probability_of_share(0.9) <= best.probability_of_share(0.5) <= 1.0
    assert best.probability_of_share(0.5) > 0.8
    assert best.quantile <= best.mean <= 1.0
    with pytest.raises(InputError, match=r"level is 1\.5"):
        best.probability_of_share(1.5)


def test_predicts_probabilities():
    optimizer = run(25)
    for under_noise in (False, True):
        mean, std = optimizer.predict([[0.1], [0.7]], under_noise=under_noise)
        assert np.all((mean > 0.0) & (mean < 1.0) & (std > 0.0) & (std < 0.5))
        assert mean[1] > mean[0] + 0.3


def test_saved_and_restored_it_asks_the_same(tmp_path):
    optimizer = run(12)
    optimizer.tell([0.65], successes=7, of=10)
    optimizer.save(tmp_path / "run.json")
    again = sh.Optimizer.load(tmp_path / "run.json")
    other = sh.Optimizer(BOX, outcome="success", seed=0)
    other.restore(optimizer.X, optimizer.y, of=[1] * 12 + [10])
    asked = optimizer.ask()
    assert again.ask() == pytest.approx(asked, abs=1e-9)
    assert other.ask() == pytest.approx(asked, abs=1e-6)


def test_parallel_trials_differ():
    optimizer = run(10)
    assert len(np.unique(optimizer.ask(4).round(6))) == 4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"y": 0.5}, "is told successes"),
        ({"success": 1}, "success is 1; give True or False"),
        ({"success": "yes"}, "give True or False"),
        ({"successes": 11, "of": 10}, "successes are 11 of 10"),
        ({"successes": 3}, "successes are 3 of None; tell both"),
        ({"of": 3}, "successes are None of 3; tell both"),
        ({}, "nothing was told"),
        ({"successes": -1, "of": 4}, "successes is -1"),
        ({"successes": 0, "of": 0}, "of is 0"),
        ({"success": True, "of": 3}, "not both"),
        ({"success": True, "failed": True}, "failed trial has no successes"),
    ],
)
def test_bad_outcomes_are_refused_and_nothing_is_lost(arguments, message):
    optimizer = run(3)
    with pytest.raises(InputError, match=message):
        optimizer.tell([0.5], **arguments)
    assert len(optimizer.X) == 3


def test_values_and_successes_are_not_mixed():
    optimizer = sh.Optimizer(BOX)
    with pytest.raises(InputError, match="is told values"):
        optimizer.tell([0.5], success=True)


def test_surrogates_of_successes_by_name():
    def third(**settings):
        optimizer = sh.Optimizer(BOX, outcome="success", n_initial=2, seed=0, **settings)
        for success in (True, False):
            optimizer.tell(optimizer.ask(), success=success)
        return optimizer.ask()

    assert np.array_equal(third(), third(surrogate="probit"))
    assert not np.array_equal(third(), third(surrogate="beta_process"))
    with pytest.raises(InputError, match=r"'bta_process'.*did you mean 'beta_process'.*hoose one of: probit, beta_pro"):
        third(surrogate="bta_process")
    with pytest.raises(InputError, match="'probit' is of successes; say outcome='success'"):
        sh.Optimizer(BOX, surrogate="probit")


@pytest.mark.parametrize(
    "settings",
    [{"direction": "minimize"}, {"noise": 0.1}, {"risk": "cvar"}, {"surrogate": "tgp"}, {"failures": "lowest"}],
)
def test_settings_without_meaning_are_refused(settings):
    with pytest.raises(InputError, match="cannot be combined with outcome='success'"):
        sh.Optimizer(BOX, outcome="success", **settings)


def test_unknown_outcome():
    with pytest.raises(InputError, match=r"'succes'.*success"):
        sh.Optimizer(BOX, outcome="succes")


def test_a_failed_trial_did_not_succeed_and_the_rig_leaves_no_trace():
    optimizer = sh.Optimizer(BOX, outcome="success")
    optimizer.tell(optimizer.ask(), failed=True)
    optimizer.tell(optimizer.ask(), failed="rig")
    assert optimizer.y.tolist() == [0.0]


def test_restored_shares_must_be_counts():
    optimizer = sh.Optimizer(BOX, outcome="success")
    with pytest.raises(InputError, match="no share of successes"):
        optimizer.restore([[0.5]], [0.55], of=[10])
    with pytest.raises(InputError, match="of is"):
        optimizer.restore([[0.5]], [0.5], of=[0])


def test_maximize_takes_functions_that_return_bool():
    result = sh.maximize(lambda x: abs(x[0] - 0.7) < 0.15, BOX, 20, outcome="success", seed=0)
    assert abs(result.recommendation.x[0] - 0.7) < 0.15
    assert set(result.y) <= {0.0, 1.0}


def test_maximize_refuses_values_and_gives_up_where_all_trials_raise():
    with pytest.raises(InputError, match=r"returned 0\.5, but outcome='success'"):
        sh.maximize(lambda x: 0.5, BOX, 10, outcome="success")

    def broken(x):
        raise RuntimeError("no rig")

    with pytest.raises(sh.SureholdError, match="no rig"):
        sh.maximize(broken, BOX, 10, outcome="success")


# --- by counts near by ------------------------------------------------------------------------------------------------


def test_the_beta_process_finds_where_trials_succeed():
    for seed in range(3):
        optimizer = run(60, seed, surrogate="beta_process")
        assert isinstance(optimizer.posterior, BetaPosterior)
        assert probability(optimizer.recommend().x) > 0.9
        mean, std = optimizer.predict([[0.1], [0.7]])
        assert mean[1] > mean[0] + 0.3
        assert np.all((std > 0.0) & (std < 0.3))


def test_the_beta_process_refuses_a_narrow_place_under_noise():
    optimizer = sh.Optimizer(
        BOX, outcome="success", surrogate="beta_process", input_noise=sh.InputNoise.unit(0.06), seed=1
    )
    rng = np.random.default_rng(0)
    for _ in range(40):
        x = optimizer.ask()
        p = 0.98 if abs(x[0] - 0.2) < 0.03 else 0.9 * np.exp(-0.5 * ((x[0] - 0.7) / 0.15) ** 2)
        optimizer.tell(x, successes=int(rng.binomial(10, p)), of=10)
    best = optimizer.recommend()
    assert abs(best.x[0] - 0.7) < 0.12
    assert 0.0 <= best.probability_of_share(0.9) <= best.probability_of_share(0.5) <= 1.0
    assert best.quantile <= best.mean <= 1.0


def test_the_beta_process_saved_and_restored_asks_the_same(tmp_path):
    optimizer = run(12, surrogate="beta_process")
    optimizer.tell([0.65], successes=7, of=10)
    optimizer.save(tmp_path / "run.json")
    again = sh.Optimizer.load(tmp_path / "run.json")
    assert again.ask() == pytest.approx(optimizer.ask(), abs=1e-9)
    assert len(np.unique(optimizer.ask(3).round(6))) == 3


def test_the_beta_process_takes_whole_numbers():
    box = sh.Box({"x": (0.0, 1.0), "n": (1, 5, "int")})
    optimizer = sh.Optimizer(box, outcome="success", surrogate="beta_process", seed=0)
    rng = np.random.default_rng(0)
    X = np.column_stack([rng.random(301), rng.integers(1, 6, 301)])  # after the 300th a hole would be filled
    p = 0.9 * np.exp(-0.5 * ((X[:, 0] - 0.6) / 0.1) ** 2) * (X[:, 1] == 3)
    optimizer.restore(X, (rng.random(301) < p).astype(float))
    asked, best = optimizer.ask_trial().parameters, optimizer.recommend()
    assert asked["n"] == 3
    assert best.x[1] == 3
    assert abs(best.x[0] - 0.6) < 0.1


def test_of_many_successes_the_early_ones_are_not_all_that_is_looked_at():
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.uniform(0.0, 0.5, 900), rng.uniform(0.5, 1.0, 500)])  # more early successes than contenders
    optimizer = sh.Optimizer(BOX, outcome="success", surrogate="beta_process", seed=0)
    optimizer.restore(x[:, None], (rng.random(1400) < np.where(x < 0.5, 0.5, 0.95)).astype(float))
    assert optimizer.y[:900].sum() > CONTENDERS
    assert optimizer.recommend().x[0] > 0.55
    assert optimizer.ask()[0] > 0.5


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"surrogate": "beta_process"}, "is of successes; say outcome='success'"),
        ({"surrogate": "beta", "outcome": "success"}, "'beta' is unknown; choose one of: probit, beta_process"),
        ({"surrogate": sh.GaussianProcess(), "outcome": "success"}, "cannot be combined with outcome='success'"),
    ],
)
def test_surrogates_that_do_not_fit_the_outcome_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        sh.Optimizer(BOX, **settings)


@pytest.mark.parametrize("surrogate", ["probit", "beta_process"])
def test_limits_of_further_outputs_are_kept_under_the_noise(surrogate):
    """Success is likeliest at (.8, .5), where the torque is beyond its limit."""
    box, noise = sh.Box.unit(2), sh.InputNoise.unit(0.03)
    settings = {"constraints": {"torque": (None, 0.6)}, "surrogate": surrogate, "input_noise": noise}
    optimizer, rng = sh.Optimizer(box, outcome="success", seed=1, **settings), np.random.default_rng(1)
    for _ in range(30):
        x = optimizer.ask()
        held = rng.random() < np.exp(-8.0 * ((x - (0.8, 0.5)) ** 2).sum())
        optimizer.tell(x, success=bool(held), constraints={"torque": x[0]})
    best = optimizer.recommend()
    executions = best.x + rng.normal(0.0, 0.03, (4000, 2))
    assert np.mean(executions[:, 0] <= 0.6) > 0.9
    assert best.x[0] > 0.45, "no farther from the limit than the noise asks for"
    assert best.feasible >= 0.95
    assert best.outputs["torque"].mean == pytest.approx(best.x[0], abs=0.02)
    optimizer.tell([0.1, 0.1], failed=True)
    assert (optimizer.y[-1], np.isnan(optimizer.outputs["torque"][-1])) == (0.0, True)
    with pytest.raises(InputError, match="says nothing about 'torque'"):
        optimizer.tell([0.2, 0.1], success=False)


def test_a_function_gives_success_and_outputs():
    result = sh.maximize(
        lambda x: (bool(x[0] > 0.2), {"torque": float(x[0])}), BOX, 12, outcome="success", seed=0,
        constraints={"torque": (None, 0.5)},
    )  # fmt: skip
    assert 0.2 < result.recommendation.x[0] <= 0.5
    assert result.to_dataframe()["torque"].to_numpy() == pytest.approx(result.X[:, 0])

import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.constraints.admission import Admission
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact, sigma_points
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.thompson import Thompson
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

GM = sh.problems.GM()
NOISE = sh.InputNoise.unit(0.1)


def found(n_trials, batch=4, **settings):
    optimizer = sh.Optimizer(GM.box, n_initial=20, seed=1, **settings)
    while len(optimizer.y) < n_trials:
        batches = optimizer.ask(batch)
        assert len(np.unique(np.round(batches, 6), axis=0)) == batch, "one batch holds a point twice"
        for x in batches:
            optimizer.tell(x, float(GM(x)))
    return optimizer


@pytest.mark.parametrize("surrogate", ["gp", "tgp"])
def test_outcomes_drawn_under_noise_lead_to_the_safe_hill(surrogate):
    optimizer = found(72, criterion="robust_thompson", input_noise=NOISE, surrogate=surrogate)
    assert GM.expectation(optimizer.recommend().x, NOISE) > 0.094


def test_functions_drawn_without_noise_lead_to_the_peak():
    assert found(80, criterion="thompson", surrogate="gp").y.max() > 0.1355


def test_repeats_itself_and_needs_noise_where_it_says_so():
    first, second = (found(28, criterion="thompson") for _ in range(2))
    np.testing.assert_array_equal(first.X, second.X)
    with pytest.raises(InputError, match="input noise"):
        sh.Optimizer(GM.box, criterion="robust_thompson")
    with pytest.raises(InputError, match="knows no trust region"):
        sh.Optimizer(GM.box, criterion="thompson", trust_region=True)


def test_a_point_is_taken_as_often_as_it_is_the_maximum():
    """One particle, one input: the share of draws whose maximum is left of 0.5 is that of draws by NumPy."""
    X = np.array([[0.0], [0.2], [0.5], [0.8], [1.0]])
    y = np.array([0.0, 1.0, 0.0, 0.9, 0.0])
    fixed = {"length_scales": [0.15], "signal_variance": 1.0, "standardize": False}
    posterior = GaussianProcess(**fixed).fit(X, y).posterior
    perturbations = Perturbations(exact(1))
    strategy = Thompson(Ranking(perturbations, perturbations, Risk(), noisy=True), exactly=True)
    history = History(X, y, np.empty((0, 1)), np.empty((0, 1)))
    taken = [strategy.candidates(posterior, history, np.random.default_rng(seed))[0, 0] for seed in range(300)]
    grid = np.linspace(0.0, 1.0, 201)[:, None]
    mean = posterior.moments(grid).mean[0]
    joint = posterior.sample(grid[None], np.eye(201))[0, 0] - mean  # rows: columns of a root of the covariance
    draws = mean + np.random.default_rng(0).standard_normal((20_000, 201)) @ joint
    share = np.mean(grid[draws.argmax(axis=1), 0] < 0.5)
    assert np.mean(np.array(taken) < 0.5) == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / 300))


def test_outcomes_are_averages_of_the_draw_over_the_perturbations():
    """Of a spike and a hill that are well known a draw is highest on the spike, its outcome on the hill."""
    X = np.linspace(0.0, 1.0, 41)[:, None]
    y = np.exp(-0.5 * ((X[:, 0] - 0.25) / 0.04) ** 2) + 0.75 * np.exp(-0.5 * ((X[:, 0] - 0.7) / 0.2) ** 2)
    posterior, around = GaussianProcess().fit(X, y).posterior, Perturbations(sigma_points(np.array([[0.1**2]])))
    history = History(X, y, np.empty((0, 1)), np.empty((0, 1)))
    for exactly, top in ((True, 0.25), (False, 0.7)):
        strategy = Thompson(Ranking(around, around, Risk(), noisy=False), exactly=exactly)
        found = [strategy.candidates(posterior, history, np.random.default_rng(seed))[0, 0] for seed in range(5)]
        np.testing.assert_allclose(found, top, atol=0.1)


def test_a_point_is_admitted_as_often_as_what_is_required_holds_there():
    class Mostly:
        def log_probability(self, U, gradient=False):
            return np.log(np.where(U[:, 0] < 0.5, 0.3, 0.8)), np.zeros((0, 1))

    points, admission = np.array([[0.2], [0.7]]), Admission(requirements=(Mostly(),))
    rng = np.random.default_rng(0)
    admitted = [len(Thompson._admitted(admission, points, rng)) for _ in range(500)]
    assert min(admitted) == 1, "the likeliest point stays whatever is drawn"
    assert np.mean(np.array(admitted) == 2) == pytest.approx(0.3, abs=4.0 * np.sqrt(0.3 * 0.7 / 500))

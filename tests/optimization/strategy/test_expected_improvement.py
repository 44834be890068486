"""The strategy's candidate against the acquisition function on a fine grid."""

import numpy as np
import pytest
from scipy.stats import norm

from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.acquisition.scales import criterion_name
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact, quasi_monte_carlo, sigma_points
from surehold.optimization.strategy.expected_improvement import ExpectedImprovement
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.trust_region import TrustRegion, side_after
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

GRID = np.linspace(0.0, 1.0, 4001)[:, None]
NONE = np.empty((0, 1))
TRIED = np.array([[0.0], [0.12], [0.3], [0.55], [0.8], [0.9], [1.0]])
VALUES = np.sin(9.0 * TRIED[:, 0])
HISTORY = History(TRIED, VALUES, NONE, NONE)


@pytest.fixture(scope="module")
def posterior():
    fixed = {"length_scales": [0.12], "signal_variance": 1.0, "standardize": False}
    return GaussianProcess(**fixed).fit(TRIED, VALUES).posterior


def strategy_of(criterion, *, noisy=False, trust_region=None):
    name = criterion_name(criterion)
    if name.scale == "exact":
        accurate = coarse = Perturbations(exact(1))
    else:
        accurate, coarse = (Perturbations(rule(np.array([[0.03**2]]))) for rule in (quasi_monte_carlo, sigma_points))
    return ExpectedImprovement(Ranking(accurate, coarse, Risk(), noisy), name, 1.5, trust_region)


def moments(posterior, points):
    found = posterior.moments(points)
    return found.mean[0], np.sqrt(found.variance[0])


def improvement(posterior, best):
    mean, std = moments(posterior, GRID)
    z = (mean - best) / np.maximum(std, 1e-12)
    return (mean - best) * norm.cdf(z) + std * norm.pdf(z)


def test_the_candidate_maximizes_the_criterion(posterior):
    mean, std = moments(posterior, GRID)
    margin = 1e-3 * HISTORY.spread  # 7 trials are told: none that polishes
    expected = {
        "ei": improvement(posterior, VALUES.max() + margin),
        "log_ei": improvement(posterior, VALUES.max() + margin),
        "ucb": mean + 1.5 * std,
    }
    for criterion, values in expected.items():
        u = strategy_of(criterion).candidates(posterior, HISTORY, np.random.default_rng(0))[0]
        np.testing.assert_allclose(u, GRID[np.argmax(values)], atol=1e-3, err_msg=criterion)


def test_every_third_trial_counts_any_improvement():
    """A model that is nearly sure of a hill: whether a small improvement counts decides on which side to look."""
    dense = np.linspace(0.0, 1.0, 15)[:, None]
    hill = -((dense[:, 0] - 0.22) ** 2)
    fixed = {"length_scales": [0.5], "signal_variance": 0.01, "standardize": False}
    sure = GaussianProcess(**fixed).fit(dense, hill).posterior
    margin = 1e-3 * np.mean(np.abs(hill - hill.mean()))
    tops = [GRID[np.argmax(improvement(sure, hill.max() + m)), 0] for m in (0.0, margin)]
    assert abs(tops[0] - tops[1]) > 2e-3
    for failed, top in ((0, tops[0]), (1, tops[1]), (2, tops[1]), (3, tops[0])):
        history = History(dense, hill, np.full((failed, 1), 0.99), NONE)
        u = strategy_of("log_ei").candidates(sure, history, np.random.default_rng(0))[0, 0]
        assert u == pytest.approx(top, abs=5e-4), f"{15 + failed} trials"


def test_a_robust_candidate_may_be_tried_beside_itself(posterior):
    found = strategy_of("robust_ei").candidates(posterior, HISTORY, np.random.default_rng(0))
    unscented = strategy_of("uei").candidates(posterior, HISTORY, np.random.default_rng(0))
    assert len(found) == len(unscented) + 5, "the candidate, two sigma points and the points halfway to them come first"
    assert np.any(np.all(found[5] == found[:5], axis=1))
    assert np.abs(found[:5] - found[5]).max() == pytest.approx(0.03 * 2.0**0.5, rel=1e-6)


def test_no_second_trial_is_sent_where_one_is_under_way(posterior):
    strategy = strategy_of("log_ei")
    first = strategy.candidates(posterior, HISTORY, np.random.default_rng(0))[0]
    waiting = HISTORY._replace(pending=first[None, :])
    second = strategy.candidates(posterior, waiting, np.random.default_rng(0))[0]
    assert abs(first[0] - second[0]) > 0.03


def test_an_improvement_is_one_over_what_a_trial_under_way_is_believed_to_give():
    """On the top between two high trials; over these alone a second trial beside it would improve most."""
    tried, values = np.array([[0.3], [0.4], [0.5], [0.6]]), np.array([0.2, 0.9, 0.9, 0.2])
    fixed = {"length_scales": [0.12], "signal_variance": 1.0, "standardize": False}
    posterior = GaussianProcess(**fixed).fit(tried, values).posterior
    waiting = History(tried, values, NONE, np.array([[0.45]]))
    known = posterior.with_pending(waiting.pending)
    told, believed = (improvement(known, best) for best in (0.9, moments(known, waiting.pending)[0][0]))
    assert abs(GRID[np.argmax(told), 0] - 0.45) < 0.1 < 0.2 < abs(GRID[np.argmax(believed), 0] - 0.45)
    u = strategy_of("ei", noisy=True).candidates(posterior, waiting, np.random.default_rng(0))[0, 0]
    assert abs(u - 0.45) > 0.2


def test_the_trust_region_holds_the_candidates(posterior):
    region = TrustRegion(n_initial=2)
    found = strategy_of("ei", trust_region=region).candidates(posterior, HISTORY, np.random.default_rng(0))
    side, best = side_after(VALUES, 2, 1), TRIED[np.argmax(VALUES), 0]
    assert side < 1.0
    assert np.all(np.abs(found - best) <= 0.5 * side + 1e-12)

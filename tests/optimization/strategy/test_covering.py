import numpy as np
import pytest

from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.acquisition.scales import criterion_name
from surehold.optimization.maximizer.holes import largest_holes
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact, quasi_monte_carlo, sigma_points
from surehold.optimization.strategy.covering import Covering
from surehold.optimization.strategy.expected_improvement import ExpectedImprovement
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

NONE = np.empty((0, 1))
TRIED = np.array([[0.1], [0.3], [0.5], [0.7], [0.25], [0.35]])


def strategies(criterion):
    name = criterion_name(criterion)
    if name.scale == "exact":
        accurate = coarse = Perturbations(exact(1))
    else:
        accurate, coarse = (Perturbations(rule(np.array([[0.02**2]]))) for rule in (quasi_monte_carlo, sigma_points))
    strategy = ExpectedImprovement(Ranking(accurate, coarse, Risk(), False), name, 2.0)
    return strategy, Covering(strategy, name.scale == "exact")


@pytest.mark.parametrize("criterion", ["log_ei", "robust_log_ei"])
@pytest.mark.parametrize("best", range(6))
@pytest.mark.parametrize("failed", [0, 1, 3])
def test_covers_every_third_trial_while_the_last_three_are_not_the_best(criterion, best, failed):
    values = 1.0 - np.abs(TRIED[:, 0] - TRIED[best, 0])
    posterior = GaussianProcess().fit(TRIED, values).posterior
    history = History(TRIED, values, np.full((failed, 1), 0.99), np.full((1, 1), 0.9))
    strategy, covering = strategies(criterion)
    found = covering.candidates(posterior, history, np.random.default_rng(3))
    if best < 3 and failed % 3 == 0:
        everything = np.concatenate([TRIED, history.failed, history.pending])
        expected = largest_holes(everything, np.random.default_rng(3))
    else:
        expected = strategy.candidates(posterior, history, np.random.default_rng(3))
    np.testing.assert_array_equal(found, expected)


def test_three_trials_are_too_few_to_be_stalled():
    values = np.array([1.0, 0.0, 0.0])
    posterior = GaussianProcess().fit(TRIED[:3], values).posterior
    strategy, covering = strategies("log_ei")
    history = History(TRIED[:3], values, NONE, NONE)
    both = [s.candidates(posterior, history, np.random.default_rng(0)) for s in (strategy, covering)]
    np.testing.assert_array_equal(*both)

"""Where trials only succeed or fail: places that are settled, and trials under way."""

import numpy as np
import pytest

from surehold.defaults import SETTLED
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact, quasi_monte_carlo, sigma_points
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.success import SuccessImprovement
from surehold.optimization.surrogates.protocol import mixture
from surehold.optimization.surrogates.success.model import SuccessProcess

NONE = np.empty((0, 1))
POINTS = Perturbations(exact(1))
RANKING = Ranking(POINTS, POINTS, Risk(), True)


def known(X, y, trials):
    process = SuccessProcess(length_scales=np.array([0.15]), signal_variance=2.0)
    return process.condition(X, y, np.random.default_rng(0), trials=np.full(len(y), float(trials)))


def deviations(posterior, U):
    return np.sqrt(mixture(posterior.moments(U))[1])


@pytest.mark.parametrize(("end", "all_settled"), [(0.5, False), (1.0, True)])
def test_places_that_are_settled_wait_for_all_others(end, all_settled, monkeypatch):
    X = np.linspace(0.0, end, 25)[:, None]
    posterior = known(X, 0.5 + 0.2 * np.sin(6.0 * X[:, 0]), 4000)
    history = History(X, 0.5 + 0.2 * np.sin(6.0 * X[:, 0]), NONE, NONE)
    found = SuccessImprovement(RANKING).candidates(posterior, history, np.random.default_rng(0))
    left = deviations(posterior, found)
    if all_settled:
        assert left.max() < SETTLED
        assert np.all(np.diff(left) <= 0.0), "the least settled one is first"
        return
    assert left.min() >= SETTLED
    monkeypatch.setattr("surehold.optimization.strategy.success.SETTLED", 0.0)
    every = SuccessImprovement(RANKING).candidates(posterior, history, np.random.default_rng(0))
    np.testing.assert_array_equal(every[deviations(posterior, every) >= SETTLED], found)
    assert len(every) > len(found)


@pytest.mark.parametrize("noise", [None, 0.02])
def test_of_two_places_that_are_about_as_good_the_one_is_left_where_a_trial_is_under_way(noise):
    X = np.linspace(0.0, 1.0, 9)[:, None]
    y = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    posterior, ranking = known(X, y, 1), RANKING
    if noise is not None:
        S = np.array([[noise**2]])
        ranking = Ranking(Perturbations(quasi_monte_carlo(S)), Perturbations(sigma_points(S)), Risk(), True)
    strategy, history = SuccessImprovement(ranking), History(X, y, NONE, NONE)
    first = strategy.candidates(posterior, history, np.random.default_rng(0))[:1]
    waiting = history._replace(pending=first)
    second = strategy.candidates(posterior, waiting, np.random.default_rng(0))[0]
    assert abs(second[0] - first[0, 0]) > 0.5

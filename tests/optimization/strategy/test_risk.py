import numpy as np
import pytest

from surehold.defaults import SCREENING_DIVISOR
from surehold.optimization.acquisition.risk_measures import Risk, RiskImprovement, WorstCaseBound
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import quasi_monte_carlo, sigma_points
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.risk import RiskAverse
from surehold.optimization.strategy.trust_region import TrustRegion, side_after
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

GRID = np.linspace(0.0, 1.0, 401)[:, None]
NONE = np.empty((0, 1))
TRIED = np.array([[0.0], [0.12], [0.3], [0.55], [0.8], [0.9], [1.0]])
VALUES = np.sin(9.0 * TRIED[:, 0])
S = np.array([[0.03**2]])
ACCURATE, COARSE = Perturbations(quasi_monte_carlo(S)), Perturbations(sigma_points(S))


@pytest.fixture(scope="module")
def posterior():
    return GaussianProcess().fit(TRIED, VALUES).posterior


@pytest.mark.parametrize("name", ["mean-std", "var", "cvar"])
def test_the_candidate_improves_the_measure_most(name, posterior):
    ranking = Ranking(ACCURATE, COARSE, Risk(name), False)
    history = History(TRIED, VALUES, NONE, NONE)
    found = RiskAverse(ranking, 2.0).candidates(posterior, history, np.random.default_rng(5))
    best, _ = ranking.incumbent(posterior, history, "robust")
    some = posterior.thinned(SCREENING_DIVISOR)
    gain = RiskImprovement(some, ACCURATE, Risk(name), best, np.random.default_rng(5))
    top = found[5]  # behind the places at and beside it where a trial may tell most
    assert gain(top[None, :])[0] >= gain(GRID).max() - 1e-3
    assert np.any(np.all(found[:5] == top, axis=1))


def test_the_worst_case_is_tried_where_it_is_worst(posterior):
    ranking = Ranking(ACCURATE, COARSE, Risk("worst"), False)
    found = RiskAverse(ranking, 2.0).candidates(posterior, History(TRIED, VALUES, NONE, NONE), np.random.default_rng(5))
    bound = WorstCaseBound(posterior, ACCURATE, 2.0)
    top = next(u for u in found if bound(u[None, :])[0] >= bound(GRID).max() - 1e-2)
    first = bound.to_try(top)
    np.testing.assert_array_equal(found[: len(first)], first)


@pytest.mark.parametrize("name", ["cvar", "worst"])
def test_trials_under_way_and_the_trust_region(name, posterior):
    ranking = Ranking(ACCURATE, COARSE, Risk(name), False)
    strategy = RiskAverse(ranking, 2.0, TrustRegion(2))
    history = History(TRIED, VALUES, NONE, NONE)
    first = strategy.candidates(posterior, history, np.random.default_rng(0))
    center = TRIED[ranking.order(posterior, TRIED)[0], 0]
    ascents = first[-100:]
    assert np.all(np.abs(ascents - center) <= 0.5 * side_after(VALUES, 2, 1) + 1e-12)
    waiting = history._replace(pending=first[:1])
    second = strategy.candidates(posterior, waiting, np.random.default_rng(0))
    assert abs(first[0, 0] - second[0, 0]) > 1e-3

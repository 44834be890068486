import numpy as np
import pytest

from surehold.defaults import SCREENING_DIVISOR
from surehold.optimization.acquisition.risk_measures import Risk, RiskImprovement, WorstCaseBound
from surehold.optimization.constraints.admission import Admission
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import Quadrature, quasi_monte_carlo, sigma_points
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.risk import RiskAverse, most_improving
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
    some = posterior.thinned(SCREENING_DIVISOR)
    gain = RiskImprovement(some, ACCURATE, Risk(name), None, np.random.default_rng(5)).over(TRIED)
    top = found[5]  # behind the places at and beside it where a trial may tell most
    assert gain(top[None, :])[0] >= gain(GRID).max() - 1e-3
    assert np.any(np.all(found[:5] == top, axis=1))


@pytest.mark.parametrize("finer", [None, Perturbations(quasi_monte_carlo(S, 9))])
def test_what_many_perturbations_promise_is_compared_with_what_few_do(finer):
    """Perturbations to one side only put the best place at 0.102, which has been tried; it is at 0.162."""
    tried = np.append(np.linspace(0.0, 1.0, 21), 0.102)[:, None]
    values = np.sin(9.0 * tried[:, 0]) - tried[:, 0]
    posterior = GaussianProcess().fit(tried, values).posterior
    one_sided = Perturbations(Quadrature(np.array([[0.0], [0.12]]), np.full(2, 0.5)))
    ranking = Ranking(one_sided, COARSE, Risk("mean-std", beta=0.5), False, finer=finer)
    history = History(tried, values, NONE, NONE)
    best = ranking.shortlist(posterior, history)
    found, gain = most_improving(ranking, posterior, best, finer, history, np.random.default_rng(0), posterior.regions)
    assert (abs(found[0, 0] - 0.162) < 5e-3) == (finer is not None)
    assert 0.0 < gain < 1e-2
    left = history._replace(admission=Admission(safe=lambda U: U[:, 0] < 0.155))
    found, _ = most_improving(ranking, posterior, best, finer, left, np.random.default_rng(0), posterior.regions)
    assert found.max() < 0.155


def test_an_improvement_is_one_over_trials_under_way_too(posterior):
    ranking, history = Ranking(ACCURATE, COARSE, Risk("cvar"), False), History(TRIED, VALUES, NONE, NONE)
    best = ranking.shortlist(posterior, history)
    gains = []
    for pending in (NONE, np.array([[0.2], [0.88]])):
        rng = np.random.default_rng(4)
        some = history._replace(pending=pending)
        gains.append(most_improving(ranking, posterior, best, None, some, rng, posterior.regions)[1])
        measure = RiskImprovement(posterior, ACCURATE, Risk("cvar"), None, np.random.default_rng(4))
        expected = measure.over(np.concatenate([best, pending]))(GRID).max()
        assert 0.999 * expected <= gains[-1] < 1.1 * expected
    assert gains[1] < 0.8 * gains[0]


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

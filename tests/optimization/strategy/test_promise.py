"""The promise against closed forms and draws on a fine grid."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

import surehold as sh
from surehold.optimization.acquisition.risk_measures import Risk, RiskImprovement
from surehold.optimization.constraints.admission import Admission
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact, quasi_monte_carlo, sigma_points
from surehold.optimization.strategy.promise import promise
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.problems.named import robust_problem

GRID = np.linspace(0.0, 1.0, 1001)[:, None]
NONE = np.empty((0, 1))
TRIED = np.array([[0.0], [0.12], [0.3], [0.55], [0.8], [0.9], [1.0]])
VALUES = np.sin(9.0 * TRIED[:, 0])
HISTORY = History(TRIED, VALUES, NONE, NONE)
S = np.array([[0.03**2]])


@pytest.fixture(scope="module")
def posterior():
    return GaussianProcess().fit(TRIED, VALUES).posterior


def improvement(mean, std, best):
    z = (mean - best) / np.maximum(std, 1e-12)
    return ((mean - best) * norm.cdf(z) + std * norm.pdf(z)).mean(axis=0)


def test_without_input_noise(posterior):
    points = Perturbations(exact(1))
    moments = posterior.moments(GRID)
    expected = improvement(moments.mean, np.sqrt(moments.variance), VALUES.max()).max()
    found = promise(Ranking(points, points, Risk(), False), posterior, HISTORY, np.random.default_rng(0))
    assert found == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("risk", ["mean", "worst"])
def test_of_the_outcome_under_input_noise(risk, posterior):
    rule = quasi_monte_carlo(S)
    ranking = Ranking(Perturbations(rule), Perturbations(sigma_points(S)), Risk(risk), False)
    outcome, tried = (posterior.average(points, *rule) for points in (GRID, TRIED))
    best = tried.mean[:, [int(np.argmax(tried.mean.mean(axis=0)))]]
    expected = improvement(outcome.mean, np.sqrt(outcome.variance), best).max()
    assert promise(ranking, posterior, HISTORY, np.random.default_rng(0)) == pytest.approx(expected, rel=1e-2)


@pytest.mark.parametrize("finer", [None, Perturbations(quasi_monte_carlo(S, 8))])
def test_of_a_risk_measure(finer, posterior):
    accurate, risk = Perturbations(quasi_monte_carlo(S)), Risk("cvar")
    ranking = Ranking(accurate, Perturbations(sigma_points(S)), risk, False, finer=finer)
    measure = RiskImprovement(posterior, accurate, risk, None, np.random.default_rng(0))
    expected = measure.corrected(finer).over(TRIED)(GRID).max()
    found = promise(ranking, posterior, HISTORY, np.random.default_rng(0))
    assert 0.999 * expected <= found < 1.1 * expected, "between two points of the grid there is little more"


def test_of_a_risk_measure_it_is_the_corrected_one(posterior):
    """Four perturbations promise half as much again as there is."""
    few, many = (Perturbations(quasi_monte_carlo(4.0 * S, exponent)) for exponent in (2, 9))
    ranking = Ranking(few, Perturbations(sigma_points(4.0 * S)), Risk("cvar"), False, finer=many)
    measure = RiskImprovement(posterior, few, Risk("cvar"), None, np.random.default_rng(0))
    corrected, plain = (measure.corrected(finer).over(TRIED)(GRID).max() for finer in (many, None))
    assert plain > 1.4 * corrected
    assert promise(ranking, posterior, HISTORY, np.random.default_rng(0)) == pytest.approx(corrected, rel=1e-2)


class Often:
    """Something that holds with the probability 0.3, wherever."""

    def log_probability(self, U, gradient=False):
        return np.full(len(U), np.log(0.3)), np.zeros((len(U) if gradient else 0, U.shape[1]))


@pytest.mark.parametrize("risk", ["mean", "cvar"])
def test_where_nothing_feasible_is_known_everything_promises_and_what_may_fail_promises_less(risk, posterior):
    ranking = Ranking(Perturbations(quasi_monte_carlo(S)), Perturbations(sigma_points(S)), Risk(risk), False)

    def of(history):
        return promise(ranking, posterior, history, np.random.default_rng(0))

    assert of(HISTORY._replace(tried=NONE, observed=np.empty(0))) == np.inf
    assert of(HISTORY._replace(admission=Admission(requirements=(Often(),)))) == pytest.approx(
        0.3 * of(HISTORY), rel=1e-3
    )
    assert of(HISTORY._replace(admission=Admission(safe=lambda U: np.zeros(len(U), dtype=bool)))) == 0.0
    under_way = GRID[[np.argmax(posterior.average(GRID, *quasi_monte_carlo(S)).mean.mean(axis=0))]]
    assert of(HISTORY._replace(pending=under_way)) == of(HISTORY) > 0.0, "trials under way promise nothing yet"


def test_of_the_worst_case_it_is_what_the_best_mean_may_gain():
    """The input that is best by its mean is another one than that whose worst case is."""
    tried = np.linspace(0.0, 1.0, 26)[:, None]
    values = np.exp(-0.5 * ((tried[:, 0] - 0.25) / 0.06) ** 2) + 0.6 * np.exp(-0.5 * ((tried[:, 0] - 0.7) / 0.2) ** 2)
    posterior, rule = GaussianProcess().fit(tried, values).posterior, quasi_monte_carlo(S)
    worst, mean = (Ranking(Perturbations(rule), Perturbations(rule), Risk(name), False) for name in ("worst", "mean"))
    history = History(tried, values, NONE, NONE)
    assert worst.order(posterior, tried)[0] != mean.order(posterior, tried)[0]
    found = [promise(ranking, posterior, history, np.random.default_rng(0)) for ranking in (worst, mean)]
    assert found[0] == found[1]


def test_of_noisy_values_it_is_over_the_best_one_by_the_model():
    """One number for all particles, where the robust scale has one each."""
    values = VALUES + 0.3 * np.random.default_rng(2).standard_normal(len(VALUES))
    points, history = Perturbations(exact(1)), History(TRIED, values, NONE, NONE)
    posterior = GaussianProcess(noise="inferred").fit(TRIED, values).posterior
    moments, tried = posterior.moments(GRID), posterior.moments(TRIED).mean
    std = np.sqrt(moments.variance)
    expected = improvement(moments.mean, std, tried.mean(axis=0).max()).max()
    each = improvement(moments.mean, std, tried[:, [int(np.argmax(tried.mean(axis=0)))]]).max()
    assert abs(each - expected) > 0.1 * expected
    found = promise(Ranking(points, points, Risk(), True), posterior, history, np.random.default_rng(0))
    assert found == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("risk", ["mean", "cvar"])
@pytest.mark.parametrize("noise", [None, 0.05])
def test_it_is_in_the_unit_of_the_values(noise, risk):
    if noise is None and risk != "mean":
        pytest.skip("a risk is of an input noise")
    rng = np.random.default_rng(3)
    U = rng.random((20, 2))
    values = np.exp(-8.0 * np.sum((U - 0.4) ** 2, axis=1)) + 0.3 * np.sin(9.0 * U[:, 0])
    promised = []
    for scale in (1.0, 2.0**-30):
        optimizer = sh.Optimizer(
            sh.Box.unit(2), seed=0, risk=risk, input_noise=None if noise is None else sh.InputNoise.unit(noise)
        )
        for u, value in zip(U, values, strict=True):
            optimizer.tell(u, scale * value)
        promised.append((optimizer.promise() / scale, optimizer.recommend("box").mean / scale))
    assert promised[1] == pytest.approx(promised[0], rel=1e-5)


def test_what_sigma_points_misjudge_is_found_by_more_points():
    """A steep polynomial, tried as if candidates were screened by sigma points: what is left to gain is not found."""
    problem = robust_problem("nes-polynomial")
    f = problem.function
    optimizer = sh.Optimizer(f.box, n_initial=5, seed=2, input_noise=problem.noise, border="clip")
    seeing, covering = optimizer._ranking, optimizer._strategy
    blind = replace(seeing, screening=None)
    optimizer._strategy = replace(covering, strategy=replace(covering.strategy, ranking=blind))
    for _ in range(50):
        x = optimizer.ask()
        optimizer.tell(x, float(f(x)))
    posterior, history = optimizer.posterior, optimizer._history
    side = np.linspace(0.0, 1.0, 61)
    outcome = seeing.accurate.outcome(posterior, np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2))
    best, _ = seeing.incumbent(posterior, history, "robust")
    most = improvement(outcome.mean, np.sqrt(outcome.variance), best).max()
    missed, found = (promise(ranking, posterior, history, np.random.default_rng(0)) for ranking in (blind, seeing))
    assert 0.5 * most < found < 1.05 * most
    assert missed < 0.1 * most

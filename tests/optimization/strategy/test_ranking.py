"""Ranking against the model's outcomes at every point of a fine grid."""

from dataclasses import replace

import numpy as np
import pytest

from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.constraints.admission import Admission
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import Quadrature, exact, quasi_monte_carlo, sigma_points
from surehold.optimization.strategy.ranking import History, Ranking, _latest_of_equals
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

S = np.array([[0.05**2]])
GRID = np.linspace(0.0, 1.0, 1001)[:, None]
NONE = np.empty((0, 1))


def f(X):
    """A steep hill at 0.25 and a broad, lower one at 0.7."""
    x = X[:, 0]
    return np.exp(-0.5 * ((x - 0.25) / 0.05) ** 2) + 0.65 * np.exp(-0.5 * ((x - 0.7) / 0.2) ** 2)


TRIED = np.random.default_rng(0).permutation(np.linspace(0.02, 0.98, 25))[:, None]
FINER = Perturbations(quasi_monte_carlo(S, 7))
HISTORY = History(TRIED, f(TRIED), NONE, NONE)


@pytest.fixture(scope="module")
def posterior():
    return GaussianProcess().fit(TRIED, f(TRIED)).posterior


def ranking_of(risk="mean", noisy=False, screened=True, finer=None):
    accurate, coarse = Perturbations(quasi_monte_carlo(S)), Perturbations(sigma_points(S))
    return Ranking(accurate, coarse, Risk(risk), noisy, screened, finer)


def outcome(posterior, U, risk="mean"):
    """The measure of the model's mean at 256 perturbed points of each input."""
    offsets = quasi_monte_carlo(S, 8).offsets
    means = posterior.moments((U[:, None, :] + offsets).reshape(-1, 1)).mean.mean(axis=0).reshape(len(U), -1)
    return Risk(risk).measure(means, np.full(len(offsets), 1.0 / len(offsets)))


@pytest.mark.parametrize("screened", [True, False])
@pytest.mark.parametrize("risk", ["mean", "cvar", "worst"])
def test_the_best_tried_input_comes_first(risk, screened, posterior):
    order = ranking_of(risk, screened=screened).order(posterior, TRIED)
    assert sorted(order) == list(range(len(TRIED)))
    assert order[0] == np.argmax(outcome(posterior, TRIED, risk))


def test_an_input_that_is_best_by_the_risk_only_is_found_among_many_that_are_better_in_the_mean():
    """The first choice is by the measure, too: by the mean 24 inputs on the steep hill are better."""
    tried = np.concatenate([np.linspace(0.238, 0.262, 24), [0.02, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]])[:, None]
    posterior = GaussianProcess().fit(tried, f(tried)).posterior
    assert np.argsort(-outcome(posterior, tried))[24] == np.argmax(outcome(posterior, tried, "cvar")) == 28
    assert ranking_of("cvar").order(posterior, tried)[0] == 28


@pytest.mark.parametrize(("risk", "decided"), [("mean", False), ("mean-std", True), ("cvar", True)])
def test_the_answer_by_a_risk_measure_is_that_of_the_finer_perturbations(risk, decided):
    """Perturbations to one side only put it to the other one, and of the mean they decide."""
    tried = np.linspace(0.0, 1.0, 26)[:, None]
    posterior = GaussianProcess().fit(tried, f(tried)).posterior
    one_sided = Perturbations(Quadrature(np.array([[0.0], [0.12]]), np.full(2, 0.5)))
    alone, answer = (
        Ranking(one_sided, one_sided, Risk(risk), False, finer=finer).order(posterior, tried)[0]
        for finer in (None, FINER)
    )
    if not decided:
        assert answer == alone
        return
    lost = outcome(posterior, tried, risk).max() - outcome(posterior, tried, risk)
    assert lost[answer] < 0.02 < lost[alone]


@pytest.mark.parametrize("most", [25, 24])
def test_after_many_trials_a_risk_measure_is_not_corrected(most, posterior, monkeypatch):
    monkeypatch.setattr("surehold.optimization.strategy.ranking.CONTENDERS", most)
    ranking = ranking_of("cvar", finer=FINER)
    assert ranking.correction(posterior) is (FINER if most == len(TRIED) else None)
    assert ranking.order(posterior, TRIED)[0] == np.argmax(outcome(posterior, TRIED, "cvar"))


def test_observed_values_decide_where_nothing_is_uncertain(posterior):
    points = Perturbations(exact(1))
    values = np.random.default_rng(1).random(len(TRIED))  # other values than the model's
    certain, noisy = (Ranking(points, points, Risk(), noisy) for noisy in (False, True))
    np.testing.assert_array_equal(certain.order(posterior, TRIED, values), np.argsort(-values))
    assert noisy.order(posterior, TRIED, values)[0] == np.argmax(f(TRIED))
    assert ranking_of().order(posterior, TRIED, values)[0] != np.argmax(values)


@pytest.mark.parametrize("risk", ["mean", "mean-std", "cvar", "worst"])
def test_the_best_input_of_the_box(risk, posterior):
    """With a risk measure the best tried input came back: everything counted as an infinite improvement."""
    best = ranking_of(risk, finer=FINER).best(posterior, HISTORY, np.random.default_rng(0))
    values = outcome(posterior, GRID, risk)
    found = outcome(posterior, best[None, :], risk)[0]
    assert found > values.max() - 0.02 * np.ptp(values)
    assert not np.any(np.all(best == TRIED, axis=1))


def test_the_best_input_of_the_box_is_that_of_the_finer_perturbations(posterior):
    """Four perturbations alone put it elsewhere: their average is highest beside the best place."""
    few = Perturbations(quasi_monte_carlo(S, 2))
    best, alone = (
        Ranking(few, few, Risk(), False, finer=finer).best(posterior, HISTORY, np.random.default_rng(0))
        for finer in (FINER, None)
    )
    values = outcome(posterior, GRID)
    assert outcome(posterior, best[None, :])[0] > values.max() - 1e-3 * np.ptp(values)
    assert abs(alone - best) > 3.0 * abs(GRID[np.argmax(values)] - best)


def test_incumbents(posterior):
    ranking = ranking_of()
    value, anchors = ranking.incumbent(posterior, HISTORY, "exact")
    assert value == f(TRIED).max()
    np.testing.assert_array_equal(anchors, TRIED[np.argsort(-f(TRIED))[:3]])
    robust, anchors = ranking.incumbent(posterior, HISTORY, "robust")
    best = TRIED[np.argmax(outcome(posterior, TRIED))]
    np.testing.assert_array_equal(anchors[0], best)
    np.testing.assert_allclose(robust.mean(), outcome(posterior, best[None, :])[0], atol=0.02)
    assert robust.shape == (10, 1), "each particle improves upon its own value"
    assert ranking.incumbent(posterior, HISTORY, "unscented")[0] == pytest.approx(robust.mean())
    noisy = History(TRIED, f(TRIED) + np.eye(25)[int(np.argmin(f(TRIED)))] * 5.0, NONE, NONE)
    modelled, _ = ranking_of(noisy=True).incumbent(posterior, noisy, "exact")
    assert modelled == pytest.approx(f(TRIED).max(), abs=0.01), "one high value is no incumbent where values are noisy"


@pytest.mark.parametrize("exactly", [True, False])
def test_trials_in_their_order(exactly, posterior):
    first = ranking_of().trials(posterior, HISTORY, exactly)[0]
    assert first == np.argmax(f(TRIED) if exactly else outcome(posterior, TRIED))


def test_trials_under_way_are_believed_to_give_the_models_mean(posterior):
    pending = np.array([[0.26], [0.9]])
    mean = posterior.moments(pending).mean  # (m, p)
    ranking = ranking_of()
    np.testing.assert_allclose(ranking.believed(posterior, pending, "exact")[:, 0], mean.max(axis=1))
    averaged = outcome(posterior, pending).max()
    assert ranking.believed(posterior, pending, "unscented") == pytest.approx(averaged, abs=0.02)
    assert ranking.believed(posterior, pending, "robust").mean() == pytest.approx(averaged, abs=0.02)


def test_history():
    history = History(TRIED, f(TRIED), np.zeros((3, 1)), np.zeros((2, 1)))
    assert history.told == 28
    assert history.spread == pytest.approx(np.mean(np.abs(f(TRIED) - np.mean(f(TRIED)))))


def test_what_was_ranked_is_ranked_again_only_for_other_trials_or_another_model(posterior):
    ranking = ranking_of()
    first = ranking.incumbent(posterior, HISTORY, "robust")[1]
    assert np.array_equal(ranking.incumbent(posterior, HISTORY, "robust")[1], first)
    fewer = HISTORY._replace(tried=TRIED[:5], observed=f(TRIED[:5]))
    assert set(ranking.incumbent(posterior, fewer, "robust")[1].ravel()) <= set(TRIED[:5].ravel())
    upside_down = GaussianProcess().fit(TRIED, -f(TRIED)).posterior
    other = ranking.trials(upside_down, HISTORY, False)
    assert np.array_equal(other, ranking_of().trials(upside_down, HISTORY, False))
    assert other[0] != ranking.trials(posterior, HISTORY, False)[0]
    averse = replace(ranking, risk=Risk("worst"))
    assert np.array_equal(averse.trials(posterior, HISTORY, False), averse.order(posterior, TRIED))
    assert not np.array_equal(averse.order(posterior, TRIED), ranking.order(posterior, TRIED))


def test_of_the_tops_that_are_found_the_finer_perturbations_choose(posterior, monkeypatch):
    """By small perturbations the steep hill is the highest, by larger ones the broad hill is."""
    tops = np.array([[0.25], [0.7]])
    monkeypatch.setattr("surehold.optimization.strategy.ranking.multistart", lambda *_: tops)
    near = Perturbations(Quadrature(np.array([[-1e-3], [1e-3]]), np.full(2, 0.5)))
    wide = Perturbations(quasi_monte_carlo(np.array([[0.1**2]]), 7))
    for finer, hill in ((near, 0.25), (wide, 0.7)):
        best = Ranking(near, near, Risk(), False, finer=finer).best(posterior, HISTORY, np.random.default_rng(0))
        assert best[0] == pytest.approx(hill, abs=0.1)


def test_where_nothing_else_may_be_tried_the_best_tried_input_is_the_best_one(posterior):
    nowhere = Admission(safe=lambda U: np.zeros(len(U), dtype=bool))
    best = ranking_of().best(posterior, HISTORY, np.random.default_rng(0), nowhere)
    np.testing.assert_array_equal(best, TRIED[np.argmax(outcome(posterior, TRIED))])


def test_what_particles_believe_of_trials_under_way(posterior):
    """Of the unscented criterion it is the highest mean of all particles, not the highest of one of them."""
    pending, ranking = np.array([[0.26], [0.9], [0.14]]), ranking_of()
    mean = posterior.average(pending, *ranking.accurate.quadrature).mean  # (m, p)
    assert mean.max() > mean.mean(axis=0).max() + 1e-6
    assert ranking.believed(posterior, pending, "unscented") == pytest.approx(mean.mean(axis=0).max(), abs=1e-12)
    np.testing.assert_allclose(ranking.believed(posterior, pending, "robust")[:, 0], mean.max(axis=1), atol=1e-12)


def test_what_is_stated_of_a_risk_measure_has_no_error_of_its_draws():
    """Of the mean less 0 deviations there is a closed form, that of the model between few trials."""
    posterior = GaussianProcess().fit(TRIED[:5], f(TRIED[:5])).posterior
    ranking = replace(ranking_of(), risk=Risk("mean-std", beta=0.0))
    U = np.array([[0.1], [0.5], [0.8]])
    moments = posterior.average(U, *ranking.accurate.quadrature)
    assert np.sqrt(moments.variance).min() > 0.01
    np.testing.assert_allclose(ranking.worth(posterior, U), moments.mean.mean(axis=0), atol=1e-9)


def test_a_risk_measure_decides_nothing_where_inputs_are_exact(posterior):
    points = Perturbations(exact(1))
    assert Ranking(points, points, Risk("cvar"), True).judged(posterior, TRIED[0], TRIED[1]) is None
    assert ranking_of().judged(posterior, TRIED[0], TRIED[1]) is None
    averse = ranking_of("cvar", finer=FINER)
    found = averse.judged(posterior, TRIED[0], TRIED[1])
    np.testing.assert_allclose(found, outcome(posterior, TRIED[:2], "cvar"), atol=0.02)


def test_of_equal_values_the_latest_is_first():
    values = np.random.default_rng(0).integers(0, 3, 40).astype(float)
    np.testing.assert_array_equal(_latest_of_equals(values), np.lexsort([-np.arange(40), -values]))


def test_of_many_trials_those_with_the_highest_values_are_looked_at(posterior, monkeypatch):
    """One observed too high is not first, one observed too low is not found; the others follow by their values."""
    values = f(TRIED)
    low, high = int(np.argmax(values)), int(np.argmin(values))
    values[low], values[high] = -1.0, 5.0
    history, exactly = History(TRIED, values, NONE, NONE), Perturbations(exact(1))
    ranking = Ranking(exactly, exactly, Risk(), noisy=True)
    assert ranking.trials(posterior, history, True)[0] == low
    monkeypatch.setattr("surehold.optimization.strategy.ranking.CONTENDERS", 6)
    by_value = np.argsort(-values)
    order = ranking.order(posterior, TRIED, values)
    modelled = posterior.moments(TRIED).mean.mean(axis=0)
    np.testing.assert_array_equal(order[:6], by_value[:6][np.argsort(-modelled[by_value[:6]])])
    np.testing.assert_array_equal(order[6:], by_value[6:])
    by_model = ranking.trials(posterior, history, True)
    np.testing.assert_array_equal(by_model[:6], order[:6])
    assert ranking.incumbent(posterior, history, "exact")[0] == pytest.approx(modelled[by_value[1:6]].max(), abs=1e-9)

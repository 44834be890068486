"""The thesis' strategy against its criterion on a fine grid, and its constants."""

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.acquisition.scales import Acquisition, criterion_name
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import exact, sigma_points
from surehold.optimization.strategy.ranking import History, Ranking
from surehold.optimization.strategy.thesis import PRESETS, ThesisImprovement, thesis_preset

GRID = np.linspace(0.0, 1.0, 2001)[:, None]
NONE = np.empty((0, 1))
TRIED = np.array([[0.05], [0.2], [0.4], [0.55], [0.8], [0.95]])
VALUES = np.sin(9.0 * TRIED[:, 0])


@pytest.mark.parametrize("criterion", ["ei", "uei", "pi", "ucb"])
def test_the_only_candidate_maximizes_the_criterion(criterion):
    posterior = thesis_preset("thesis-gf").gaussian_process().fit(TRIED, VALUES).posterior
    name = criterion_name(criterion)
    points = Perturbations(exact(1) if name.scale == "exact" else sigma_points(np.array([[0.05**2]])))
    strategy = ThesisImprovement(Ranking(points, points, Risk(), False, screened=False), name, 0.025, 2.0)
    found = strategy.candidates(posterior, History(TRIED, VALUES, NONE, NONE), np.random.default_rng(0))
    assert found.shape == (1, 1)
    # the highest observed value is the incumbent, under input noise too
    acquisition = Acquisition(posterior, name, points, VALUES.max(), margin=0.025, kappa=2.0)
    values = acquisition(GRID)
    assert acquisition(found)[0] >= values.max() - 1e-6 * np.ptp(values)


def test_a_trial_under_way_is_kept_away_from():
    posterior = thesis_preset("thesis-gf").gaussian_process().fit(TRIED, VALUES).posterior
    points = Perturbations(exact(1))
    strategy = ThesisImprovement(Ranking(points, points, Risk(), False, screened=False), criterion_name("ei"), 0.0, 2.0)
    history = History(TRIED, VALUES, NONE, NONE)
    first = strategy.candidates(posterior, history, np.random.default_rng(0))
    second = strategy.candidates(posterior, history._replace(pending=first), np.random.default_rng(0))
    assert abs(first[0, 0] - second[0, 0]) > 0.02


@pytest.mark.parametrize("name", ["thesis-rkhs", "thesis-gf", "thesis-gm"])
def test_the_bias_is_a_hundredth_of_the_signal_parameter(name):
    constants = thesis_preset(name)
    assert constants.margin == pytest.approx(0.01 / constants.signal_variance, rel=0.02)


def test_the_process_of_a_preset_has_its_constants():
    posterior = thesis_preset("thesis-grasp").gaussian_process().fit(TRIED, VALUES).posterior
    far = posterior.moments(np.array([[1e6]]))
    np.testing.assert_allclose(far.mean, 0.0, atol=1e-9)
    np.testing.assert_allclose(far.variance, 0.35, rtol=1e-3)
    assert far.mean.shape == (10, 1)


def test_unknown_preset():
    assert set(PRESETS) >= {"thesis", "thesis-rkhs", "thesis-gf", "thesis-gm", "thesis-grasp"}
    with pytest.raises(InputError, match="did you mean 'thesis-gm'"):
        thesis_preset("thesis-gmm")

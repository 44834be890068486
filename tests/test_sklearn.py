import warnings

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.datasets import load_diabetes, make_friedman1
from sklearn.ensemble import RandomForestRegressor
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor as Reference
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from surehold.sklearn import GaussianProcessRegressor

pytestmark = pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")


@parametrize_with_checks([GaussianProcessRegressor(), GaussianProcessRegressor(method="map", noise="none")])
def test_scikit_learn_accepts_it(estimator, check):
    check(estimator)


def test_in_a_pipeline_it_beats_a_forest_on_a_smooth_function():
    X, y = make_friedman1(120, noise=0.5, random_state=0)
    ours = cross_val_score(make_pipeline(StandardScaler(), GaussianProcessRegressor(random_state=0)), X, y, cv=3)
    forest = cross_val_score(RandomForestRegressor(50, random_state=0), X, y, cv=3)
    assert ours.mean() > 0.9
    assert ours.mean() > forest.mean() + 0.1


def test_real_data_as_well_as_scikit_learns_own():
    X, y = load_diabetes(return_X_y=True)
    X, y = X[:200], y[:200]
    kernel = ConstantKernel() * Matern(np.ones(X.shape[1]), nu=2.5) + WhiteKernel()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        theirs = cross_val_score(make_pipeline(StandardScaler(), Reference(kernel, normalize_y=True)), X, y, cv=3)
    ours = cross_val_score(GaussianProcessRegressor(method="map", random_state=0), X, y, cv=3)
    assert ours.mean() > theirs.mean() - 0.05


def test_grid_search_and_clone():
    rng = np.random.default_rng(0)
    X = rng.uniform(-100.0, 300.0, (40, 1))
    y = 1e4 + 50.0 * np.sin(X[:, 0] / 50.0)
    search = GridSearchCV(
        GaussianProcessRegressor(random_state=0), {"kernel": ["matern32", "squared_exponential"]}, cv=3
    ).fit(X, y)
    assert search.best_params_ == {"kernel": "squared_exponential"}
    best = clone(search.best_estimator_).fit(X, y)
    mean, std = best.predict([[0.0], [1000.0]], return_std=True)
    assert mean[0] == pytest.approx(1e4, abs=1.0)
    assert std[1] > 10.0 * std[0]
    assert 20.0 < np.median(best.length_scales_) < 300.0
    assert best.noise_std([[0.0]]) < 1.0


@pytest.mark.parametrize("settings", [{"kernel": "matern"}, {"noise": -1.0}, {"method": "mcmc"}, {"particles": 0}])
def test_bad_settings_are_refused_when_fitting(settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        GaussianProcessRegressor(**settings).fit([[0.0], [1.0]], [0.0, 1.0])

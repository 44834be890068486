import warnings

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.datasets import load_diabetes, make_friedman1
from sklearn.ensemble import RandomForestRegressor
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor as Reference
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from sklearn.model_selection import GridSearchCV, KFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from surehold.sklearn import GaussianProcessRegressor, TreedGaussianProcessRegressor

pytestmark = pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")


@parametrize_with_checks(
    [
        GaussianProcessRegressor(),
        GaussianProcessRegressor(method="map", noise="none"),
        TreedGaussianProcessRegressor(min_leaf=15),
        TreedGaussianProcessRegressor(method="map"),
    ]
)
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


def test_the_tree_learns_many_observations_of_a_function_with_a_jump():
    rng = np.random.default_rng(0)
    X = rng.uniform(-3.0, 7.0, (1200, 2))
    y = np.where(X[:, 0] < 4.0, 0.1 * X[:, 1], 5.0 + np.sin(3.0 * X[:, 0])) + 0.05 * rng.standard_normal(1200)
    model = make_pipeline(StandardScaler(), TreedGaussianProcessRegressor(40, method="map", random_state=0))
    folds = KFold(3, shuffle=True, random_state=0)
    treed = cross_val_score(model, X, y, cv=folds, scoring="neg_root_mean_squared_error")
    assert -treed.mean() < 0.25, "against a standard deviation of 2.3"
    fitted = TreedGaussianProcessRegressor(40, method="map", random_state=0).fit(X, y)
    assert fitted.process_.posterior.diagnostics.partition.leaves > 5
    assert np.median(fitted.noise_std(X)) == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("settings", [{"min_leaf": 1}, {"weight_power": -1.0}, {"trees": 0}])
def test_bad_settings_of_the_tree_are_refused_when_fitting(settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        TreedGaussianProcessRegressor(**settings).fit([[0.0], [1.0]], [0.0, 1.0])


@pytest.mark.parametrize("settings", [{"kernel": "matern"}, {"noise": -1.0}, {"method": "mcmc"}, {"particles": 0}])
def test_bad_settings_are_refused_when_fitting(settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        GaussianProcessRegressor(**settings).fit([[0.0], [1.0]], [0.0, 1.0])

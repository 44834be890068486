from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

import surehold as sh
from surehold.optimization.diagnosis import Diagnosis, diagnosis, shares
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.local_global.model import LocalGlobalProcess
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess


def hill(X):
    return np.sin(4.0 * X[:, 0]) + X[:, 1] ** 2


def crowded(n=60, seed=0):
    """Return trials, two thirds of them on a hill in a corner, as a search leaves them behind."""
    rng = np.random.default_rng(seed)
    X = np.concatenate([rng.random((n // 3, 2)), 0.85 + 0.1 * rng.random((n - n // 3, 2))])
    return X, np.where(np.all(X > 0.7, axis=1), 1.0, 0.0) + 0.2 * hill(X)


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_left_out_is_the_process_fitted_to_the_others(noise):
    """Rasmussen and Williams 2006, equation 5.12, beside scikit-learn."""
    rng = np.random.default_rng(1)
    X = rng.random((15, 2))
    y = hill(X) + noise * rng.standard_normal(15)
    scales, s2 = np.array([0.3, 0.6]), 1.4
    ours = GaussianProcess(length_scales=scales, signal_variance=s2, noise=noise, ratio=1e-8, standardize=False)
    found = ours.fit(X, y).posterior.left_out()
    kernel = ConstantKernel(s2) * Matern(scales, nu=2.5) + WhiteKernel(noise**2 + 1e-8 * s2)
    for i in range(15):
        rest = np.arange(15) != i
        reference = GaussianProcessRegressor(kernel, alpha=0.0, optimizer=None).fit(X[rest], y[rest])
        mean, std = reference.predict(X[i : i + 1], return_std=True)
        assert found.mean[0, i] == pytest.approx(mean[0], abs=1e-6)
        assert found.variance[0, i] == pytest.approx(std[0] ** 2, rel=1e-5)


def test_left_out_of_a_tree_is_that_of_its_leaves():
    X, y = crowded()
    tree = TreedGaussianProcess(min_leaf=15).fit(X, y)
    posterior = tree.posterior
    assert len(posterior.leaves) > 1
    found, home = posterior.left_out(), posterior.partition.route(X)
    for j, node in enumerate(posterior.partition.leaves):
        members = posterior.partition.nodes[node].members
        own = np.flatnonzero(home[members] == j)
        alone = posterior.leaves[j].left_out()
        inside = [i for i in own if not np.any(np.isin(X[members[i]], posterior.regions.upper))]
        np.testing.assert_array_equal(found.mean[:, members[inside]], alone.mean[:, inside])
    averaged = TreedGaussianProcess(min_leaf=15, trees=2).fit(X, y).posterior.left_out()
    np.testing.assert_array_equal(averaged.mean[:10], found.mean)
    assert averaged.variance.shape == (20, 60)


def test_left_out_of_the_local_global_process_is_near_the_truth():
    X = np.random.default_rng(3).random((40, 2))
    y = hill(X)
    found = LocalGlobalProcess().condition(X, y, np.random.default_rng(0)).left_out()
    assert np.abs(found.mean.mean(axis=0) - y).max() < 0.2 * np.ptp(y)
    assert np.all(found.variance > 0.0)


def test_shares_are_lengths_of_the_line_nearest_to_each_point():
    x = np.array([0.1, 0.4, 0.9, 0.95])
    borders = np.concatenate([[0.0], 0.5 * (x[1:] + x[:-1]), [1.0]])
    np.testing.assert_allclose(shares(x[:, None]), np.diff(borders), atol=2e-3)


def test_error_is_that_at_fresh_inputs():
    """Weighted by the share of the box; without weights it would be that of the crowd."""

    def f(X):
        return np.sin(12.0 * X[:, 0]) * np.cos(9.0 * X[:, 1])

    errors = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        X = np.concatenate([rng.random((40, 2)), 0.85 + 0.1 * rng.random((80, 2))])
        y, Q = f(X), rng.random((2000, 2))
        model = GaussianProcess().fit(X, y)
        at_fresh = np.sqrt(np.mean((model.predict(Q) - f(Q)) ** 2)) / f(Q).std()
        found = diagnosis(model.posterior, X, y)
        assert found is not None
        alone = np.sqrt(np.mean((model.posterior.left_out().mean.mean(axis=0) - y) ** 2)) / y.std()
        errors.append((at_fresh, found.error, alone))
    at_fresh, weighted, alone = np.mean(errors, axis=0)
    assert weighted == pytest.approx(at_fresh, rel=0.4)
    assert alone < 0.7 * at_fresh


def test_each_number_by_hand():
    X, y = crowded(24, 1)
    posterior = GaussianProcess().condition(X, y, np.random.default_rng(0))
    found, left, w = diagnosis(posterior, X, y), posterior.left_out(), shares(X)
    mean, between = left.mean.mean(axis=0), left.mean.var(axis=0)
    variance = left.variance.mean(axis=0) + between
    constant = [np.average(np.delete(y, i), weights=np.delete(w, i)) for i in range(24)]
    mine, its = (y - mean) ** 2, (y - constant) ** 2
    gap = w @ (mine - its)
    assert found.error == pytest.approx(np.sqrt(w @ mine / (w @ its)))
    assert found.excess == pytest.approx(gap / np.sqrt(np.sum(w**2 * (mine - its - gap) ** 2)))
    assert found.coverage == pytest.approx(w @ (np.abs(y - mean) < norm.ppf(0.975) * np.sqrt(variance)))
    assert found.disagreement == pytest.approx(w @ (between / variance))
    assert found.resolution == pytest.approx(np.median(posterior.length_scales, axis=0).min() * np.sqrt(24))


def test_more_than_a_constant_by_chance_is_not_said_to_explain_nothing():
    told = Diagnosis(error=1.2, excess=0.9, coverage=0.95, disagreement=0.1, resolution=1.0, n=100)
    assert not told.explains_nothing
    assert replace(told, excess=1.1).explains_nothing


def test_rounding_between_values_at_one_input_is_no_contradiction():
    X, y = crowded(24, 1)
    X, y = np.vstack([X, X[:1]]), np.append(y, y[0] + 1e-8)
    posterior = GaussianProcess().condition(X, y, np.random.default_rng(0))
    assert not diagnosis(posterior, X, y).contradicted
    y[-1] = y[0] + 1e-3
    assert diagnosis(GaussianProcess().condition(X, y, np.random.default_rng(0)), X, y).contradicted


def test_a_model_that_sees_islands_is_found_out():
    """Its length-scales are far below the spacing of trials; between them it believes in the mean of the crowd."""
    X, y = crowded()
    blind = GaussianProcess(length_scales=0.004).fit(X, y)
    found = diagnosis(blind.posterior, X, y)
    assert found is not None
    assert found.explains_nothing
    assert found.error > 1.1
    assert found.resolution == pytest.approx(0.004 * np.sqrt(60))
    assert f"{found.error:.2g} standard deviations" in found.warning
    seeing = diagnosis(GaussianProcess(kernel="matern52_two_scales", mean_variance=1.0).fit(X, y).posterior, X, y)
    assert seeing is not None
    assert not seeing.explains_nothing
    assert seeing.error < 0.8


def test_intervals_that_are_too_narrow_are_found_out():
    rng = np.random.default_rng(0)
    X = rng.random((40, 2))
    y = hill(X) + 0.3 * rng.standard_normal(40)
    sure = GaussianProcess(length_scales=1.5, signal_variance=1.0, noise=0.02).fit(X, y)
    found = diagnosis(sure.posterior, X, y)
    assert found is not None
    assert found.coverage < 0.6
    assert "95 % intervals hold" in found.warning


def test_nothing_is_said_of_trials_at_one_place():
    optimizer = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), noise="inferred", seed=0)
    for value in np.random.default_rng(0).normal(size=30):
        optimizer.tell([0.5], value)
    assert optimizer.diagnosis() is None
    assert optimizer.recommend().x == pytest.approx([0.5])


def test_nothing_is_said_of_few_trials_or_of_equal_values():
    X, y = crowded(12)
    few = Diagnosis(error=2.0, excess=3.0, coverage=0.1, disagreement=0.0, resolution=1.0, n=9)
    assert few.warning == ""
    posterior = GaussianProcess().fit(X, np.ones(12)).posterior
    assert diagnosis(posterior, X, np.ones(12)) is None
    assert diagnosis(posterior, X[:1], y[:1]) is None


def test_the_recommendation_warns():
    X, y = crowded()
    for surrogate, said in ((GaussianProcess(length_scales=0.004), "less of the response than a constant"), (None, "")):
        optimizer = sh.Optimizer(sh.Box.unit(2), surrogate=surrogate, input_noise=sh.InputNoise.unit(0.03))
        optimizer.restore(X, y)
        warning = optimizer.recommend().warning
        assert (said in warning) if said else (warning == "")


@pytest.mark.parametrize("fixed", [None, {"x1": 0.5}])
def test_on_a_lattice_and_with_failed_trials(fixed):
    optimizer = sh.Optimizer(sh.Box.unit(2), fixed=fixed, seed=0)
    for i in range(14):
        x = optimizer.ask()
        if i == 3:
            optimizer.tell(x, failed=True)
        else:
            optimizer.tell(x, float(np.sin(3.0 * x[1])))
    found = optimizer.diagnosis()
    assert found is not None
    assert found.n == 13, "the response is learnt from trials that gave a value"
    assert 0.0 <= found.coverage <= 1.0
    assert 0.0 <= found.disagreement <= 1.0


def test_repeats_that_differ_say_nothing_where_the_first_at_every_place_gave_the_same():
    optimizer = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), seed=0)
    optimizer.restore([[0.5], [0.5], [0.6]], [2.0, 1.0, 2.0])
    assert optimizer.diagnosis() is None


@pytest.mark.parametrize("noise", [None, "inferred", 0.05])
def test_values_that_contradict_each_other_at_one_input_are_named_where_no_noise_explains_them(noise):
    optimizer = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), noise=noise, seed=0)
    rng = np.random.default_rng(0)
    for x in (0.1, 0.3, 0.5, 0.7, 0.9):
        for _ in range(3):
            optimizer.tell([x], 1.0 - (x - 0.5) ** 2 + 0.05 * rng.normal())
    assert ("give noise='inferred'" in optimizer.recommend().warning) == (noise is None)


def test_equal_values_at_one_input_are_no_contradiction():
    optimizer = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), seed=0)
    for x in (0.1, 0.1, 0.3, 0.5, 0.7, 0.7, 0.9):
        optimizer.tell([x], 1.0 - (x - 0.5) ** 2)
    assert not optimizer.diagnosis().contradicted

from math import inf

import numpy as np
import pytest
from scipy.stats import norm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern

import surehold as sh
from surehold.defaults import LEAF_MARGIN, WIDEST_LEAF_MARGIN
from surehold.errors import InputError
from surehold.optimization.noise.quadratures import sigma_points
from surehold.optimization.strategy.thesis import thesis_preset
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning, Prior
from surehold.optimization.surrogates.gaussian_process.likelihood import (
    Evidence,
    log_posterior,
    log_posterior_and_gradient,
)
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess, _nearest, block_weights, least_leaf_width
from surehold.optimization.surrogates.treed.partition import grow

QUICK = Learning(particles=3, burn_in=2)


def jagged(X):
    return np.where(X[:, 0] < 0.5, X[:, 0], np.sin(60.0 * X[:, 0])) + 0.1 * X[:, -1]


def data(n=40, d=2, seed=0):
    X = np.random.default_rng(seed).random((n, d))
    return X, jagged(X)


def model(**settings):
    settings = {"min_leaf": 8, "process": GaussianProcess(learning=QUICK), **settings}
    return TreedGaussianProcess(**settings)


def test_a_tree_of_one_leaf_is_the_plain_process():
    X, y = data(20)
    queries = np.random.default_rng(1).random((7, 2))
    for process in (
        GaussianProcess(),
        GaussianProcess(noise="inferred"),
        thesis_preset("thesis-gm").gaussian_process(),
    ):
        plain = process.fit(X, y, seed=3).predict(queries, return_std=True)
        treed = TreedGaussianProcess(20, process=process).fit(X, y, seed=3).predict(queries, return_std=True)
        assert np.array_equal(plain, treed)


def test_each_leaf_is_a_process_of_its_own_trials():
    X, y = data()
    posterior = model(process=GaussianProcess(length_scales=[0.3, 0.7], signal_variance=2.0, standardize=False)).fit(
        X, y
    )
    posterior = posterior.posterior
    assert len(posterior.leaves) > 2
    queries = np.random.default_rng(1).random((50, 2))
    moments = posterior.moments(queries)
    home = posterior.partition.route(queries)
    kernel = 2.0 * Matern([0.3, 0.7], nu=2.5)
    for j, leaf in enumerate(posterior.partition.leaves):
        members = posterior.partition.nodes[leaf].members
        oracle = GaussianProcessRegressor(kernel, optimizer=None, alpha=2e-10).fit(X[members], y[members])
        if np.any(home == j):
            mean, std = oracle.predict(queries[home == j], return_std=True)
            assert moments.mean[0, home == j] == pytest.approx(mean, abs=1e-6)
            assert np.sqrt(moments.variance[0, home == j]) == pytest.approx(std, abs=1e-5)


@pytest.mark.parametrize("power", [1.0, inf])
def test_told_noise_stays_with_its_trials(power):
    X, y = data()
    told = np.random.default_rng(2).uniform(0.01, 0.5, len(y))
    process = GaussianProcess(length_scales=[0.3, 0.7], signal_variance=2.0, standardize=False)
    posterior = model(process=process, weight_power=power).fit(X, y, noise=told).posterior
    queries = np.random.default_rng(1).random((50, 2))
    moments, home = posterior.moments(queries), posterior.partition.route(queries)
    for j in np.unique(home):
        own = posterior.partition.nodes[posterior.partition.leaves[j]].members
        oracle = GaussianProcessRegressor(2.0 * Matern([0.3, 0.7], nu=2.5), optimizer=None, alpha=told[own] ** 2)
        mean, std = oracle.fit(X[own], y[own]).predict(queries[home == j], return_std=True)
        assert moments.mean[0, home == j] == pytest.approx(mean, abs=1e-6)
        assert np.sqrt(moments.variance[0, home == j]) == pytest.approx(std, abs=1e-6)
        variance = posterior.noise_variance(queries[home == j])
        assert variance == pytest.approx(np.full_like(variance, np.mean(told[own] ** 2)))


@pytest.mark.parametrize("power", [1.0, 2.0, 3.0, inf])
def test_the_likelihood_is_the_weighted_sum_of_scikit_learns(power):
    X, y = data(60)
    partition = model().fit(X, y).posterior.partition
    j = int(np.argmax([partition.nodes[leaf].depth for leaf in partition.leaves]))
    blocks = partition.blocks(j)
    depth = len(blocks) - 1
    assert depth >= 2
    # thesis (3.12), written out
    weights = [float(i == 0) if power == inf else (2 / (1 + depth - (depth - i))) ** power for i in range(depth + 1)]
    assert block_weights(depth + 1, power) == pytest.approx(weights)
    order = np.concatenate(blocks)
    evidence = Evidence(
        X[order],
        y[order],
        np.zeros(60),
        np.cumsum([0, *map(len, blocks)]),
        block_weights(depth + 1, power),
        np.zeros(2),
        np.full(2, 10.0),
        1.5,
        1e-4,
        0.0,
        0,
        False,
        False,
    )
    theta = np.log([0.2, 0.5])
    expected = norm(0.0, 10.0).logpdf(theta).sum()
    for weight, block in zip(weights, blocks, strict=True):
        oracle = GaussianProcessRegressor(1.5 * Matern([0.2, 0.5], nu=2.5), optimizer=None, alpha=1.5e-4)
        expected += weight * oracle.fit(X[block], y[block]).log_marginal_likelihood_value_
    assert log_posterior(theta, evidence) == pytest.approx(expected, rel=1e-9)
    assert log_posterior_and_gradient(theta, evidence)[0] == pytest.approx(expected, rel=1e-9)


def test_ancestors_draw_length_scales_towards_theirs():
    X, y = data(120, 1)
    process = GaussianProcess(learning=Learning(method="map"))
    own, shared = (model(min_leaf=15, weight_power=k, process=process).fit(X, y).posterior for k in (inf, 0.0))
    spread = [np.log([leaf.length_scales[0, 0] for leaf in p.leaves]).std() for p in (own, shared)]
    assert spread[1] < spread[0]


def quadrature():
    offsets = np.array([[0.0, 0.0], [0.15, 0.0], [-0.15, 0.05], [0.0, 0.3], [0.1, -0.3]])
    return offsets, np.array([0.4, 0.2, 0.2, 0.1, 0.1])


def test_an_average_adds_up_over_leaves():
    X, y = data(60)
    posterior = model().fit(X, y).posterior
    offsets, weights = quadrature()
    queries = np.random.default_rng(2).random((12, 2))
    average = posterior.average(queries, offsets, weights)
    for i, query in enumerate(queries):
        points = query + offsets
        home = posterior.partition.route(points)
        mean = sum(
            w * posterior.leaves[leaf].moments(p[None]).mean[:, 0]
            for w, p, leaf in zip(weights, points, home, strict=True)
        )
        assert average.mean[:, i] == pytest.approx(mean, abs=1e-9)
        variance = np.zeros(3)
        for leaf in np.unique(home):
            own = home == leaf
            variance += posterior.leaves[leaf].average(query[None], offsets[own], weights[own]).variance[:, 0]
        assert average.variance[:, i] == pytest.approx(variance, abs=1e-12)
    assert len({len(set(posterior.partition.route(q + offsets))) for q in queries}) > 1
    own = posterior.average(queries, np.broadcast_to(offsets, (12, *offsets.shape)).copy(), weights)
    assert own.mean == pytest.approx(average.mean, abs=1e-12)
    assert own.variance == pytest.approx(average.variance, abs=1e-12)


def test_gradients_are_finite_differences():
    X, y = data(60)
    posterior = model().fit(X, y).posterior
    offsets, weights = quadrature()
    queries = np.random.default_rng(3).random((6, 2))
    moments = posterior.average(queries, offsets, weights, gradient=True)
    h = 1e-6
    for k in range(2):
        step = h * np.eye(2)[k]
        up, down = (posterior.average(queries + s * step, offsets, weights) for s in (1.0, -1.0))
        assert moments.mean_gradient[:, :, k] == pytest.approx((up.mean - down.mean) / (2 * h), rel=1e-4, abs=1e-5)
        slope = (up.variance - down.variance) / (2 * h)
        assert moments.variance_gradient[:, :, k] == pytest.approx(slope, rel=1e-3, abs=1e-5)


def test_draws_have_the_moments_of_the_average():
    X, y = data(60)
    posterior = model().fit(X, y).posterior
    offsets, weights = quadrature()
    queries = np.random.default_rng(4).random((3, 2))
    normals = np.random.default_rng(5).standard_normal((20000, 5))
    draws = posterior.sample(queries[:, None, :] + offsets, normals) @ weights
    average = posterior.average(queries, offsets, weights)
    assert draws.mean(axis=2) == pytest.approx(average.mean, abs=5.0 * np.sqrt(average.variance.max() / 20000) + 1e-9)
    assert draws.var(axis=2) == pytest.approx(average.variance, rel=0.06, abs=1e-6)


def test_pending_trials_shrink_the_variance_of_their_own_leaf_only():
    X, y = data(60)
    posterior = model().fit(X, y).posterior
    queries = np.random.default_rng(6).random((80, 2))
    before, after = posterior.moments(queries), posterior.with_pending(queries[:1]).moments(queries)
    home = posterior.partition.route(queries)
    assert after.mean == pytest.approx(before.mean, abs=1e-5)
    assert np.all(after.variance[:, 0] < 1e-3 * before.variance[:, 0] + 1e-9)
    assert np.array_equal(after.variance[:, home != home[0]], before.variance[:, home != home[0]])
    assert np.all(after.variance <= before.variance + 1e-9)


def test_remembered_leaves_change_nothing():
    X, y = data(90)
    used = model()
    for n in (50, 70, 89):
        used.condition(X[:n], y[:n], np.random.default_rng(n))
    warm = used.condition(X, y, np.random.default_rng(1))
    cold = model().condition(X, y, np.random.default_rng(2))
    queries = np.random.default_rng(0).random((40, 2))
    assert np.array_equal(warm.moments(queries).mean, cold.moments(queries).mean)
    assert np.array_equal(warm.moments(queries).variance, cold.moments(queries).variance)


def test_one_more_trial_teaches_few_leaves_again():
    X, y = data(400)
    surrogate = model()
    before = surrogate.condition(X[:399], y[:399], np.random.default_rng(0))
    after = surrogate.condition(X, y, np.random.default_rng(0))
    kept = {id(leaf) for leaf in before.leaves} & {id(leaf) for leaf in after.leaves}
    assert len(kept) >= 0.8 * len(after.leaves)


def test_another_seed_gives_other_particles():
    X, y = data()
    one, two = (model(seed=seed).fit(X, y).posterior.leaves[0].length_scales for seed in (0, 1))
    assert not np.array_equal(one, two)
    again = model().fit(X, y, seed=1).posterior.leaves[0].length_scales
    assert np.array_equal(two, again)


def test_chains_continue_from_the_leaf_that_overlaps_most():
    X, y = data(60)
    still = GaussianProcess(prior=Prior((0.0, 3.0)), learning=Learning("slice", particles=1, burn_in=0))
    tree = model(process=still, continued=True)
    old = tree.condition(X[:59], y[:59], np.random.default_rng(0))
    one, two = (tree.condition(X, y, np.random.default_rng(1), p) for p in (old, None))
    assert len(one.leaves) > 1
    assert not np.array_equal(one.leaves[0].length_scales, two.leaves[0].length_scales)


def test_the_leaf_that_overlaps_most_has_the_largest_share_of_points():
    X, _ = data(160)
    y = np.sin(9.0 * X).sum(axis=1)
    old, new = (model().fit(X[part], y[part]).posterior for part in (slice(0, 100), slice(60, 160)))
    assert len(new.leaves) > 8
    points = np.random.default_rng(0).random((40_000, 2))
    homes = [posterior.partition.route(points) for posterior in (old, new)]
    for j in range(len(new.leaves)):
        counts = np.bincount(homes[0][homes[1] == j], minlength=len(old.leaves))
        assert counts[_nearest(new.partition, j, old)] >= 0.9 * counts.max()


def test_diagnostics_show_the_tree():
    X = np.linspace(0.0, 1.0, 41)[:, None]
    summary = model().fit(X, np.where(X[:, 0] > 0.5, 3.0, 0.0)).posterior.diagnostics.partition
    assert summary.leaves >= 2
    assert summary.depth >= 1
    assert summary.first_split == (0, pytest.approx(0.5, abs=0.026))


def test_noise_is_learnt_leaf_by_leaf():
    rng = np.random.default_rng(0)
    X = rng.random((160, 1))
    high = X[:, 0] > 0.5
    y = np.where(high, 4.0, 0.0) + np.where(high, 0.5, 0.02) * rng.standard_normal(160)
    tree = model(min_leaf=60, process=GaussianProcess(noise="inferred")).fit(X, y)
    quiet, loud = tree.noise_std([[0.25], [0.75]])
    # The trial on the border is shared: here it lies beyond the jump and makes the quiet side look a little louder.
    assert 0.5 < quiet / 0.02 < 2.0
    assert loud == pytest.approx(0.5, rel=0.4)


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_outputs_of_any_size(scale):
    X, y = data()
    mean, std = model().fit(X, scale * y).predict(X, return_std=True)
    assert mean == pytest.approx(scale * y, abs=1e-3 * scale)
    assert np.all(std < 0.1 * scale)


@pytest.mark.parametrize(
    ("X", "y"),
    [
        (np.full((1, 2), 0.5), np.ones(1)),
        (np.random.default_rng(0).random((30, 2)), np.ones(30)),
        (np.full((30, 2), 0.5), np.ones(30)),
        (np.repeat(np.random.default_rng(0).random((15, 2)), 3, axis=0), np.repeat(np.arange(15.0), 3)),
        (np.random.default_rng(0).random((40, 2)), np.eye(40)[7]),
    ],
    ids=["one", "constant", "same place", "repeated", "one peak"],
)
def test_degenerate_data(X, y):
    mean, std = model(min_leaf=4).fit(X, y).predict(X, return_std=True)
    assert np.all(np.isfinite(mean))
    assert np.all(np.isfinite(std))


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"min_leaf": 1}, "min_leaf"),
        ({"min_leaf": 2.5}, "min_leaf"),
        ({"min_leaf": True}, "min_leaf"),
        ({"min_leaf": "auto"}, "min_leaf"),
        ({"trees": 0}, "trees"),
        ({"weight_power": -1.0}, "weight_power"),
        ({"weight_power": np.nan}, "weight_power"),
        ({"weight_power": "inf"}, "weight_power"),
        ({"margin": -0.1}, "margin"),
        ({"margin": 0.5}, "margin"),
        ({"margin": np.nan}, "margin"),
        ({"seed": -1}, "seed"),
        ({"process": "gp"}, "process"),
    ],
)
def test_bad_settings_are_named(settings, word):
    with pytest.raises(InputError, match=word):
        TreedGaussianProcess(**settings)


def test_bad_data_are_named():
    X, y = data()
    for bad, outputs, word in (
        (X[0], y, "shape"),
        (X, y[:-1], "shape"),
        (X * np.nan, y, "NaN"),
        (X[:0], y[:0], "rows"),
    ):
        with pytest.raises(InputError, match=word):
            model().fit(bad, outputs)
    with pytest.raises(InputError, match="margin"):
        model(margin=[0.1, 0.1, 0.1]).fit(X, y)
    with pytest.raises(InputError, match="fit"):
        model().predict(X)
    with pytest.raises(InputError, match="noise"):
        model().fit(X, y, noise=[0.1])
    with pytest.raises(InputError, match="seed"):
        model().fit(X, y, seed=-1)


def test_no_leaf_is_narrower_than_the_noise_and_none_is_refused_under_much():
    margin = least_leaf_width(np.array([0.0, 0.001, 0.2, 3.0]))
    assert margin == pytest.approx([LEAF_MARGIN, 0.001, 0.2, WIDEST_LEAF_MARGIN])
    X, y = data()
    assert np.all(np.isfinite(model(margin=margin[2:]).fit(X, y).predict(X)))


BOX = sh.Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})


def run(n, **settings):
    optimizer = sh.Optimizer(BOX, surrogate="tgp", **settings)
    for _ in range(n):
        x = optimizer.ask()
        optimizer.tell(x, float(jagged(x[None])[0]))
    return optimizer


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"input_noise": sh.InputNoise.unit(0.04)},
        {"input_noise": sh.InputNoise.unit(0.04), "criterion": "uei", "border": "clip"},
        {"input_noise": sh.InputNoise.unit(0.04), "risk": "cvar"},
        {"preset": "thesis-rkhs", "input_noise": sh.InputNoise.unit(0.04)},
        {"noise": "inferred"},
    ],
    ids=["plain", "robust", "unscented", "risk", "thesis robust", "noise"],
)
def test_the_optimizer_runs_on_a_tree_and_repeats_itself(settings):
    optimizer = run(33, n_initial=30, seed=1, **settings)
    assert optimizer.posterior.diagnostics.partition.leaves > 1
    assert np.isfinite(optimizer.recommend().mean)
    assert np.array_equal(optimizer.X, run(33, n_initial=30, seed=1, **settings).X)
    assert optimizer.ask(3).shape == (3, 2)


def test_an_optimizer_rebuilt_from_its_trials_asks_the_same():
    first = run(36, n_initial=30, seed=2)
    second = sh.Optimizer(BOX, surrogate="tgp", n_initial=30, seed=2)
    for x, y in zip(first.X, first.y, strict=True):
        second.tell(x, y)
    assert np.array_equal(first.ask(), second.ask())


def test_a_needle_beside_a_hill_is_found():
    problem = sh.problems.RKHS()
    result = sh.maximize(problem, problem.box, 50, n_initial=5, seed=0, surrogate="tgp")
    assert result.y.max() > 5.73


def test_input_noise_keeps_the_answer_off_the_needle():
    problem = sh.problems.RKHS()
    noise = sh.InputNoise.unit(0.01)
    result = sh.maximize(problem, problem.box, 40, n_initial=5, seed=0, surrogate="tgp", input_noise=noise)
    assert problem.expectation(result.recommendation.x, noise) > 4.9


def test_margins_follow_the_input_noise():
    optimizer = run(60, n_initial=60, seed=3, input_noise=sh.InputNoise({"a": 0.2, "b": 0.0}))
    regions = optimizer.posterior.regions
    assert np.all((regions.upper - regions.lower)[:, 0] >= 0.2)


def test_sigma_points_of_a_covariance_cross_leaves():
    X, y = data(60)
    posterior = model().fit(X, y).posterior
    tau = posterior.partition.nodes[0].split
    query = np.full((1, 2), 0.5)
    query[0, tau.dimension] = tau.threshold
    rule = sigma_points(np.diag([0.01, 0.01]))
    home = posterior.partition.route(query + rule.offsets)
    assert len(set(home)) > 1
    whole = posterior.average(query, rule.offsets, rule.weights)
    center = posterior.leaves[posterior.partition.route(query)[0]].average(query, rule.offsets, rule.weights)
    assert not np.allclose(whole.mean, center.mean)


def test_the_evidence_splits_what_is_jagged_and_leaves_what_is_smooth():
    X = np.random.default_rng(0).random((120, 2))
    jagged_tree = model(min_leaf="evidence").fit(X, jagged(X)).posterior
    smooth_tree = model(min_leaf="evidence").fit(X, np.sin(3.0 * X[:, 0]) + X[:, 1]).posterior
    assert jagged_tree.diagnostics.partition.leaves > 1
    assert smooth_tree.diagnostics.partition.leaves == 1


def test_the_evidence_of_a_process_is_its_likelihood_less_what_was_fitted():
    X, y = data(25)
    process = GaussianProcess(length_scales=[0.3, 0.7], signal_variance=2.0, standardize=False)
    oracle = GaussianProcessRegressor(2.0 * Matern([0.3, 0.7], nu=2.5), optimizer=None, alpha=2e-10).fit(X, y)
    flat = norm(0.0, 1.0).logpdf(np.log([0.3, 0.7]) - np.log(0.2 * np.sqrt(2.0))).sum()  # the prior's own density
    value = process.log_evidence(X, y, process.standardization(y))
    assert value == pytest.approx(oracle.log_marginal_likelihood_value_ + flat, rel=1e-6)


def test_the_evidence_of_a_tree_is_that_of_its_leaves_each_trial_counted_once():
    X, y = data(60)
    told = np.random.default_rng(2).uniform(0.01, 0.5, len(y))
    process = GaussianProcess(length_scales=[0.3, 0.7], signal_variance=2.0)
    tree = model(process=process, min_leaf="evidence")
    partition, outputs = grow(X, y, 8, np.zeros(2)), process.standardization(y).coarse()
    home = partition.route(X)
    flat = norm(0.0, 1.0).logpdf(np.log([0.3, 0.7]) - np.log(0.2 * np.sqrt(2.0))).sum()  # as above
    expected = 0.0
    for j in range(len(partition.leaves)):
        own = home == j
        oracle = GaussianProcessRegressor(
            2.0 * Matern([0.3, 0.7], nu=2.5), optimizer=None, alpha=(told[own] / outputs.scale) ** 2
        ).fit(X[own], (y[own] - y[own].mean()) / outputs.scale)
        expected += oracle.log_marginal_likelihood_value_ + flat
    assert len(partition.leaves) > 2
    assert tree._log_evidence(partition, X, y, told, outputs) == pytest.approx(expected, rel=1e-6)


def largest_jumps(posterior):
    """Return the largest step of the mean along each of 9 lines, on a net too fine for smooth changes to count."""
    a = np.linspace(0.0, 1.0, 4001)
    lines = [np.column_stack([a, np.full_like(a, b)]) for b in np.linspace(0.1, 0.9, 9)]
    return np.array([np.abs(np.diff(posterior.moments(line).mean.mean(axis=0))).max() for line in lines])


def test_several_trees_soften_the_jumps():
    jumps = []
    for seed in range(6):  # in one input there are no jumps: the trial on the border is shared
        X = np.random.default_rng(seed).random((60, 2))
        fitted = (model(trees=trees).fit(X, np.sin(9.0 * X[:, 0]) + X[:, 1]) for trees in (1, 5))
        jumps.append([largest_jumps(tree.posterior).mean() for tree in fitted])
    one, five = np.mean(jumps, axis=0)
    assert one > 0.1
    assert five < 0.75 * one


def test_averaged_trees_are_the_particles_of_all():
    X, y = data(60)
    posterior = model(trees=3).fit(X, y).posterior
    offsets, weights = quadrature()
    queries = np.random.default_rng(7).random((6, 2))
    averages = posterior.average(queries, offsets, weights, gradient=True)
    assert averages.mean.shape == (9, 6)
    for t, tree in enumerate(posterior.trees):
        for whole, part in zip(averages, tree.average(queries, offsets, weights, gradient=True), strict=True):
            assert np.array_equal(whole[3 * t : 3 * t + 3], part)
    assert len({tree.diagnostics.partition.first_split for tree in posterior.trees}) > 1
    assert posterior.sample(queries[:, None, :] + offsets, np.zeros((2, 5))).shape == (9, 6, 2, 5)
    assert np.all(posterior.with_pending(queries[:1]).moments(queries[:1]).variance < 1e-3 * y.var())


def test_whatever_averaged_trees_tell_is_told_tree_after_tree():
    X, y = data(60)
    rng = np.random.default_rng(9)
    process = GaussianProcess(noise="inferred", learning=QUICK)
    posterior = model(trees=3, process=process).fit(X, y + 0.1 * rng.standard_normal(60)).posterior
    queries, normals = rng.random((6, 2)), rng.standard_normal((2, 4))
    points = rng.random((3, 4, 2))
    for ask in (
        lambda trees: trees.means(queries),
        lambda trees: trees.noise_variance(queries),
        lambda trees: trees.sample(points, normals),
        lambda trees: trees.left_out().mean,
        lambda trees: trees.left_out().variance,
        lambda trees: trees.thinned(2, 1).moments(queries).variance,
        lambda trees: trees.with_pending(queries[:2]).moments(queries).variance,
    ):
        parts = [ask(tree) for tree in posterior.trees]
        assert not np.array_equal(parts[0], parts[1])
        assert np.array_equal(ask(posterior), np.concatenate(parts))


def test_a_thinned_tree_is_that_of_its_particles():
    X, y = data(60)
    posterior, queries = model().fit(X, y).posterior, np.random.default_rng(8).random((20, 2))
    whole = posterior.moments(queries)
    for first in range(3):
        one = posterior.thinned(1, first).moments(queries)
        assert np.array_equal(one.mean, whole.mean[[first]])
        assert np.array_equal(one.variance, whole.variance[[first]])


def test_one_particle_of_several_trees_is_any_of_theirs():
    """Thompson sampling draws a function of one particle: of the first tree alone, the others had no say."""
    X, y = data(60)
    posterior, queries = model(trees=4).fit(X, y).posterior, np.random.default_rng(8).random((20, 2))
    whole = posterior.moments(queries).mean
    singles = [posterior.thinned(1, first).moments(queries).mean for first in range(12)]
    assert all(len(one) == 1 for one in singles)
    order = [np.flatnonzero(np.all(whole == one, axis=1))[0] for one in singles]
    assert sorted(order) == list(range(12)), "each particle of each tree, once"


def test_a_trial_on_a_border_is_left_out_of_the_first_leaf_that_has_it():
    X, y = data(60)
    posterior = model().fit(X, y).posterior
    found = posterior.left_out()
    members = [posterior.partition.nodes[leaf].members for leaf in posterior.partition.leaves]
    shared = [i for i in range(60) if sum(i in own for own in members) > 1]
    assert shared
    for i in shared:
        j = next(j for j, own in enumerate(members) if i in own)
        alone, place = posterior.leaves[j].left_out(), int(np.flatnonzero(members[j] == i)[0])
        assert np.array_equal(found.mean[:, i], alone.mean[:, place])
        assert np.array_equal(found.variance[:, i], alone.variance[:, place])


@pytest.mark.parametrize("settings", [{"min_leaf": "evidence"}, {"trees": 3}])
def test_options_repeat_themselves_and_take_degenerate_data(settings):
    X, y = data(50)
    one, two = (model(**settings).fit(X, y).predict(X[:5], return_std=True) for _ in range(2))
    assert np.array_equal(one, two)
    warm = model(**settings)
    warm.fit(X[:49], y[:49])
    assert np.array_equal(warm.fit(X, y).predict(X[:5]), one[0])
    for inputs, outputs in ((X[:1], y[:1]), (X, np.ones(50)), (np.full((50, 2), 0.5), y), (np.round(X), y)):
        assert np.all(np.isfinite(model(**settings).fit(inputs, outputs).predict(X)))

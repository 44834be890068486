"""Predictions from the nearest trials, compared with those from all of them."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.special import ndtri
from scipy.stats import qmc

import surehold as sh
from surehold.defaults import MANY, NEIGHBORS
from surehold.errors import SureholdError
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning
from surehold.optimization.surrogates.gaussian_process.kernels import KERNELS, correlation
from surehold.optimization.surrogates.gaussian_process.neighbors import NeighborPosterior
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior


def _response(X):
    return np.sin(6.0 * X[:, 0]) * np.cos(4.0 * X[:, 1]) + 0.3 * X.sum(axis=1)


def _trials(n, d=2, seed=0):
    X = qmc.LatinHypercube(d, rng=seed).random(n)
    return X, _response(X)


def _both(n, d=2, noise=None, kernel="matern52"):
    X, y = _trials(n, d)
    settings = {"kernel": kernel} if noise is None else {"kernel": kernel, "noise": noise}
    exact = sh.GaussianProcess(**settings).condition_on_all(X, y, np.random.default_rng(1))
    theta = exact.hyperparameters.theta
    return exact, NeighborPosterior(exact.evidence, theta, exact.outputs, exact.diagnostics.evaluations)


OFFSETS = 0.05 * np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
WEIGHTS = np.array([0.4, 0.15, 0.15, 0.15, 0.15])


@pytest.mark.parametrize("kernel", ["matern52", "matern52_two_scales"])
@pytest.mark.parametrize("gradient", [False, True])
def test_with_fewer_trials_than_neighbors_nothing_is_left_out(gradient, kernel):
    exact, near = _both(NEIGHBORS[0] - 1, kernel=kernel)  # one more is under way below
    np.testing.assert_array_equal(near.length_scales, exact.length_scales)
    queries = np.random.default_rng(2).random((7, 2))
    for ours, theirs in zip(
        near.average(queries, OFFSETS, WEIGHTS, gradient),
        exact.average(queries, OFFSETS, WEIGHTS, gradient),
        strict=True,
    ):
        if theirs is None:
            assert ours is None
        else:
            np.testing.assert_allclose(ours, theirs, rtol=2e-3, atol=1e-6)  # sums in another order
    pending = np.array([[0.5, 0.5]])
    np.testing.assert_allclose(
        near.with_pending(pending).moments(queries).variance,
        exact.with_pending(pending).moments(queries).variance,
        rtol=2e-3,
        atol=1e-6,
    )
    normals = np.random.default_rng(3).standard_normal((3, 2))
    points = np.random.default_rng(4).random((2, 2, 2))
    np.testing.assert_allclose(near.sample(points, normals), exact.sample(points, normals), rtol=2e-3, atol=1e-4)
    np.testing.assert_allclose(near.noise_variance(queries), exact.noise_variance(queries))
    assert near.thinned(3).moments(queries).mean.shape == exact.thinned(3).moments(queries).mean.shape


def test_noise_pending_trials_and_particles_are_those_of_the_model_that_leaves_nothing_out():
    X, y = _trials(NEIGHBORS[0] - 2)
    rng = np.random.default_rng(6)
    process = sh.GaussianProcess(noise="inferred", learning=Learning(particles=6, burn_in=2))
    exact = process.fit(X, y + 0.1 * rng.standard_normal(len(y))).posterior
    exact = GaussianProcessPosterior(
        exact.evidence._replace(noise=rng.uniform(0.001, 0.05, len(y))), exact.hyperparameters.theta, exact.outputs, 0
    )
    near = NeighborPosterior(exact.evidence, exact.hyperparameters.theta, exact.outputs, 0)
    queries, pending = rng.random((5, 2)), rng.random((2, 2))
    np.testing.assert_allclose(near.noise_variance(queries), exact.noise_variance(queries), rtol=1e-12)
    weights = 2.0 * WEIGHTS
    for ours, theirs in (
        (near, exact),
        (near.thinned(2, 1), exact.thinned(2, 1)),
        (near.with_pending(pending), exact.with_pending(pending)),
        (near.with_pending(pending).thinned(2, 1), exact.with_pending(pending).thinned(2, 1)),
    ):
        pairs = zip(ours.average(queries, OFFSETS, weights), theirs.average(queries, OFFSETS, weights), strict=True)
        for one, other in list(pairs)[:2]:
            np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("noise", [None, 0.1])
def test_the_nearest_trials_tell_nearly_what_all_do(noise):
    exact, near = _both(300, noise=noise)
    queries = np.random.default_rng(2).random((40, 2))
    theirs, ours = exact.average(queries, OFFSETS, WEIGHTS), near.average(queries, OFFSETS, WEIGHTS)
    deviation = np.sqrt(theirs.variance)
    miss = np.abs(ours.mean - theirs.mean)
    assert miss.max() < 0.01 * np.std(_response(queries)) or np.sqrt(np.mean((miss / deviation) ** 2)) < 0.5
    assert np.all(ours.variance >= theirs.variance - 1e-9), "fewer trials never tell more"
    assert np.median(np.sqrt(ours.variance) / deviation) < 1.5


def test_trials_whose_covariance_cannot_be_factorized_give_neither_moments_nor_draws():
    """A variance that vanishes beside that of the mean; a draw was made of what had lain in memory before."""
    _, near = _both(300)
    theta = near.hyperparameters.theta.copy()
    theta[:, :2], theta[:, -1] = 1.0, -45.0
    bad = NeighborPosterior(near.evidence._replace(mean_variance=1.0), theta, near.outputs, 0)
    points = np.array([[[0.5, 0.5], [0.6, 0.5]]])
    for ask in (lambda: bad.moments(points[0]), lambda: bad.sample(points, np.zeros((1, 2)))):
        with pytest.raises(SureholdError, match="covariance of the trials"):
            ask()


@pytest.mark.parametrize(("d", "times"), [(2, 1.0), (10, 1.0), (15, 1.5), (40, 3.0)])
def test_the_nearest_of_every_set_are_found(d, times):
    X = np.random.default_rng(4).random((300, d))
    exact = sh.GaussianProcess().condition(X, X.sum(axis=1), np.random.default_rng(1))
    theta = exact.hyperparameters.theta
    near = NeighborPosterior(exact.evidence, theta, exact.outputs, 0)
    queries = np.random.default_rng(5).random((9, d))
    rows, counts, reach = near.nearest(queries)
    scale = np.exp(-theta[:, :d].mean(axis=0))
    distances = cdist(queries * scale, near.evidence.X * scale)
    for i in range(9):
        wanted = set()
        for level, count in enumerate(NEIGHBORS):
            part = np.arange(300)[:: 8**level]
            wanted |= set(part[np.argsort(distances[i, part])[: round(times * count)]].tolist())
        assert set(rows[i, : counts[i]].tolist()) == wanted
        np.testing.assert_allclose(reach[i], np.sort(distances[i])[round(times * NEIGHBORS[0]) - 1])


def test_gradients_are_those_of_the_values_where_the_neighbors_stay():
    _, near = _both(300, noise=0.1)
    query, step = np.array([[0.31, 0.62]]), 1e-5
    found = near.average(query, OFFSETS, WEIGHTS, gradient=True)
    for k in range(2):
        shift = step * np.eye(2)[k]
        up, down = (near.average(query + sign * shift, OFFSETS, WEIGHTS) for sign in (1.0, -1.0))
        np.testing.assert_allclose(found.mean_gradient[:, 0, k], (up.mean - down.mean)[:, 0] / (2 * step), rtol=1e-3)


WIDE = 0.15 * ndtri(qmc.Halton(2, seed=0).random(64))  # beyond what one neighborhood reaches of 300 trials
EQUAL = np.full(64, 1.0 / 64.0)
INSIDE = 0.3 + 0.4 * np.random.default_rng(2).random((12, 2))


def test_averages_over_more_than_a_neighborhood_are_those_of_their_points():
    exact, near = _both(300)
    theirs, ours = exact.average(INSIDE, WIDE, EQUAL), near.average(INSIDE, WIDE, EQUAL)
    truth = _response((INSIDE[:, None] + WIDE).reshape(-1, 2)).reshape(12, 64) @ EQUAL
    points = (INSIDE[:, None] + WIDE).reshape(-1, 2)
    singly = near.moments(points).mean.mean(axis=0).reshape(12, 64) @ EQUAL
    miss = np.sqrt(np.mean((ours.mean.mean(axis=0) - truth) ** 2))
    assert miss < 3.0 * np.sqrt(np.mean((singly - truth) ** 2)) + 1e-4, "near as good as each point by itself"
    assert np.all(ours.variance >= theirs.variance * (1.0 - 1e-3)), "fewer trials never tell more"
    assert np.all(np.sqrt(np.mean((ours.mean - theirs.mean) ** 2 / ours.variance)) < 1.0), "as unsure as it is wrong"


def test_the_average_of_noisy_trials_is_nearly_as_sure_as_from_all():
    exact, near = _both(300, noise=0.1)
    theirs, ours = exact.average(INSIDE, WIDE, EQUAL), near.average(INSIDE, WIDE, EQUAL)
    assert np.all(ours.variance >= theirs.variance * (1.0 - 1e-6))
    assert np.all(ours.variance < 1.5 * theirs.variance), "errors of the points are not all the same error"


@pytest.mark.parametrize("kernel", ["matern52", "matern52_product"])
def test_gradients_are_those_of_the_values_with_several_neighborhoods(kernel):
    _, near = _both(300, noise=0.1, kernel=kernel)
    query, step = np.array([[0.31, 0.62]]), 1e-5
    slopes = np.where(WIDE > 0.2, 0.0, 1.0)  # as of points at the border
    found = near.average(query, WIDE, EQUAL, gradient=True, slopes=slopes)
    for k in range(2):
        change = step * np.eye(2)[k]
        values = [near.average(query, WIDE + sign * slopes * change, EQUAL) for sign in (1.0, -1.0)]
        for ours, up, down in zip(found[2:], *(moments[:2] for moments in values), strict=True):
            np.testing.assert_allclose(ours[:, 0, k], (up - down)[:, 0] / (2 * step), rtol=1e-3, atol=1e-7)


def _by_numpy(near, query, points, weights):
    """Return mean and variance (m,) of the average over points (s, d), as `neighbor_averages` says they are."""
    evidence, own, m2 = near.evidence, near.hyperparameters, near.evidence.mean_variance
    rows, counts, reach = near.nearest(query[None])
    shares, around = near._neighborhoods.shares(query[None], points[None], reach), near._neighborhoods
    anchors = shares.anchors[0][shares.anchors[0] >= 0]
    trials = [rows[0, : counts[0]], *(around._rows[a, : around._counts[a]] for a in anchors)]
    mean, variance = [], []
    for j, scales in enumerate(near.length_scales):

        def k(P, R, j=j, scales=scales):
            shape = own.inverse_l[j, 2:]
            return own.s2[j] * correlation(KERNELS[evidence.kernel], P, R, scales, *shape) + m2

        A = k(evidence.X, evidence.X) + np.diag(evidence.noise + own.v[j] + evidence.ratio * own.s2[j])
        W = np.zeros(len(evidence.X))
        for group, members in enumerate(trials):
            inside = shares.groups[0] == group
            K = weights[inside] @ k(points[inside], evidence.X[members])
            W[members] += np.linalg.solve(A[np.ix_(members, members)], K)
        c = weights @ k(points, evidence.X)
        mean.append(W @ near._Y[j])
        variance.append(weights @ k(points, points) @ weights - 2.0 * W @ c + W @ A @ W)
    outputs = near.outputs
    return outputs.shift * weights.sum() + outputs.scale * np.array(mean), outputs.square * np.array(variance)


@pytest.mark.parametrize("kernel", ["matern52", "matern52_two_scales"])
def test_averages_over_several_neighborhoods_are_the_estimate_that_they_are_said_to_be(kernel):
    """With a mean to be learnt, told noise beside learnt noise, offsets of each query's own, and weights of any sum."""
    X, y = _trials(300)
    rng = np.random.default_rng(7)
    y = y + 0.1 * rng.standard_normal(300)
    learning = Learning(particles=3, burn_in=2)
    process = sh.GaussianProcess(kernel=kernel, noise="inferred", mean_variance=1.5, learning=learning)
    exact = process.condition_on_all(X, y, np.random.default_rng(1))
    evidence = exact.evidence._replace(noise=rng.uniform(0.001, 0.05, 300))
    near = NeighborPosterior(evidence, exact.hyperparameters.theta, exact.outputs, 0)
    offsets = rng.uniform(0.5, 1.0, (5, 1, 1)) * WIDE[:32]
    weights, queries = rng.uniform(0.0, 0.05, 32), INSIDE[:5]
    slopes = np.where(rng.random(offsets.shape) < 0.2, 0.0, 1.0)
    found = near.average(queries, offsets, weights, gradient=True, slopes=slopes)
    for i, query in enumerate(queries):
        mean, variance = _by_numpy(near, query, query + offsets[i], weights)
        np.testing.assert_allclose(found.mean[:, i], mean, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(found.variance[:, i], variance, rtol=1e-5, atol=1e-9)
    step = 1e-6
    for k in range(2):
        change = step * slopes * np.eye(2)[k]
        up, down = (near.average(queries, offsets + sign * change, weights) for sign in (1.0, -1.0))
        for ours, above, below in zip(found[2:], up[:2], down[:2], strict=True):
            np.testing.assert_allclose(ours[:, :, k], (above - below) / (2 * step), rtol=1e-3, atol=1e-6)
    alone = near.average(queries[:1], 0.02 * offsets[0], weights, gradient=True, slopes=slopes[0])
    narrow = near.average(queries, np.concatenate([offsets[1:], 0.02 * offsets[:1]])[[4, 0, 1, 2, 3]], weights)
    np.testing.assert_allclose(narrow.mean[:, :1], alone.mean, rtol=1e-9)


def test_what_was_averaged_before_changes_nothing(monkeypatch):
    wanted = _both(300)[1].average(INSIDE, WIDE, EQUAL)
    near = _both(300)[1]
    near.average(INSIDE[6:], WIDE, EQUAL)
    np.testing.assert_array_equal(near.average(INSIDE, WIDE, EQUAL).variance, wanted.variance)
    monkeypatch.setattr("surehold.optimization.surrogates.gaussian_process.neighborhoods._MOST", 0)  # nothing is kept
    offsets = np.tile(WIDE, (12, 1, 1))
    np.testing.assert_allclose(near.average(INSIDE, offsets, EQUAL).mean, wanted.mean, rtol=1e-12)
    one = near.average(INSIDE[3:4], WIDE, EQUAL, gradient=True)
    np.testing.assert_allclose(one.variance[:, 0], wanted.variance[:, 3], rtol=1e-6)


def test_one_trial_more_keeps_averages_under_input_noise():
    def f(X):
        return np.sin(7.0 * X[:, 0]) * np.cos(5.0 * X[:, 1])

    X = np.random.default_rng(0).random((MANY + 1, 2))
    means = []
    for n in (MANY, MANY + 1):
        optimizer = sh.Optimizer(sh.Box.unit(2), input_noise=sh.InputNoise.unit(0.1), surrogate="gp", n_initial=1)
        optimizer.restore(X[:n], f(X[:n]))
        means.append(optimizer.predict(INSIDE, under_noise=True)[0])
    np.testing.assert_allclose(means[1], means[0], atol=3e-4)


def test_many_trials_are_answered_from_their_neighbors_and_few_are_not():
    model = sh.GaussianProcess()
    for n, kind in ((MANY, GaussianProcessPosterior), (MANY + 1, NeighborPosterior)):
        assert isinstance(model.fit(*_trials(n)).posterior, kind)
    fixed = sh.GaussianProcess(length_scales=0.2, signal_variance=1.0)
    assert isinstance(fixed.fit(*_trials(MANY + 1)).posterior, GaussianProcessPosterior)


def test_an_optimizer_with_many_trials_still_finds_the_top():
    X, y = _trials(MANY + 20)
    optimizer = sh.Optimizer(sh.Box.unit(2), n_initial=1, seed=0)
    for x, value in zip(X, y, strict=True):
        optimizer.tell(x, value)
    for _ in range(12):
        x = optimizer.ask()
        optimizer.tell(x, float(_response(x[None])[0]))
    net = np.stack(np.meshgrid(*(np.linspace(0.0, 1.0, 801),) * 2), axis=-1).reshape(-1, 2)
    assert optimizer.recommend().observed > _response(net).max() - 1e-3

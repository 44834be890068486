import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest, multivariate_normal, norm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern

from surehold.errors import InputError, SureholdError
from surehold.optimization.noise.quadratures import sigma_points
from surehold.optimization.surrogates.gaussian_process.hyperparameters import Learning, Prior
from surehold.optimization.surrogates.gaussian_process.kernels import KERNELS, correlation
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.gaussian_process.posterior import surprise
from surehold.optimization.surrogates.protocol import means, mixture
from surehold.optimization.surrogates.treed.model import TreedGaussianProcess

RADIAL = {
    "matern52": lambda scales: Matern(scales, nu=2.5),
    "matern32": lambda scales: Matern(scales, nu=1.5),
    "squared_exponential": lambda scales: RBF(scales),
}
S = np.array([[0.01, 0.004], [0.004, 0.006]])


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    X = rng.random((20, 2))
    return X, 3.0 + np.sin(5 * X[:, 0]) + X[:, 1] ** 2, rng.random((7, 2))


@pytest.fixture(scope="module")
def learnt(data):
    X, y, _ = data
    return GaussianProcess(mean_variance=0.5).fit(X, y).posterior


def differences(f, U, h=1e-6):
    """Return central differences (..., d) of f at U (q, d), f returning (..., q)."""
    steps = h * np.eye(U.shape[1])
    return np.stack([(f(U + step) - f(U - step)) / (2 * h) for step in steps], axis=-1)


@pytest.mark.parametrize("kernel", RADIAL)
@pytest.mark.parametrize("standardize", [False, True])
def test_equal_to_scikit_learn(kernel, standardize, data):
    X, y, Q = data
    scales, s2, noise = np.array([0.3, 0.8]), 1.7, 0.05
    reference = GaussianProcessRegressor(
        ConstantKernel(s2) * RADIAL[kernel](scales),
        alpha=(noise / (y.std() if standardize else 1.0)) ** 2,
        optimizer=None,
        normalize_y=standardize,
    ).fit(X, y)
    mean, std = reference.predict(Q, return_std=True)
    ours = GaussianProcess(
        kernel=kernel, length_scales=scales, signal_variance=s2, noise=noise, ratio=0.0, standardize=standardize
    ).fit(X, y)
    found = ours.predict(Q, return_std=True)
    np.testing.assert_allclose(found[0], mean, atol=1e-8)
    np.testing.assert_allclose(found[1], std, atol=1e-8)
    np.testing.assert_allclose(ours.predict(Q), mean, atol=1e-8)


def test_average_is_that_of_the_joint_covariance(data, learnt):
    X, y, Q = data
    rng = np.random.default_rng(1)
    offsets, weights = 0.2 * rng.standard_normal((5, 2)), np.array([0.3, -0.2, 0.4, 0.35, 0.15])
    found = learnt.average(Q, offsets, weights)
    outputs, p = learnt.outputs, learnt.hyperparameters
    for j, scales in enumerate(learnt.length_scales):

        def k(A, B, scales=scales, s2=p.s2[j]):
            return s2 * correlation("matern52", A, B, scales) + 0.5

        A = k(X, X) + 1e-10 * p.s2[j] * np.eye(20)
        for i, q in enumerate(Q):
            P = q + offsets
            joint_mean = outputs.shift + outputs.scale * k(P, X) @ np.linalg.solve(A, outputs.apply(y))
            joint = outputs.scale**2 * (k(P, P) - k(P, X) @ np.linalg.solve(A, k(X, P)))
            assert found.mean[j, i] == pytest.approx(weights @ joint_mean, abs=1e-7)
            assert found.variance[j, i] == pytest.approx(weights @ joint @ weights, abs=1e-7)


def test_average_over_one_exact_point_is_the_prediction(data, learnt):
    moments = learnt.moments(data[2])
    average = learnt.average(data[2], np.zeros((2, 2)), np.array([0.25, 0.75]))
    np.testing.assert_allclose(average.mean, moments.mean, atol=1e-9)
    np.testing.assert_allclose(average.variance, moments.variance, atol=1e-9)


def test_offsets_of_each_query(data, learnt):
    Q = data[2]
    rng = np.random.default_rng(2)
    offsets, weights = 0.1 * rng.standard_normal((7, 3, 2)), np.array([0.5, 0.3, 0.2])
    together = learnt.average(Q, offsets, weights, gradient=True)
    for i in range(7):
        alone = learnt.average(Q[i : i + 1], offsets[i], weights, gradient=True)
        for one, all_ in zip(alone, together, strict=True):
            np.testing.assert_allclose(one[:, 0], all_[:, i], atol=1e-9)


@pytest.mark.parametrize(("count", "queries"), [(1, 450), (64, 10), (300, 2)])
@pytest.mark.parametrize("kernel", KERNELS)
def test_many_queries_at_once_are_answered_as_each_alone(kernel, count, queries, data):
    X, y, _ = data
    posterior = GaussianProcess(kernel=kernel, length_scales=[0.3, 0.6], mean_variance=0.5, ratio=1e-6).fit(X, y)
    rng = np.random.default_rng(4)
    Q, offsets, weights = rng.random((queries, 2)), 0.1 * rng.standard_normal((queries, count, 2)), rng.random(count)
    together = posterior.posterior.average(Q, offsets, weights, gradient=True)
    alone = [posterior.posterior.average(Q[i : i + 1], offsets[i], weights, gradient=True) for i in range(queries)]
    for found, each in zip(together, zip(*alone, strict=True), strict=True):
        np.testing.assert_allclose(found, np.concatenate(each, axis=1), rtol=1e-9, atol=1e-9)


def test_what_is_remembered_of_perturbations_is_of_these_alone(data, learnt):
    Q, weights = data[2], np.array([0.5, 0.3, 0.2])
    near, far = (scale * np.random.default_rng(3).standard_normal((3, 2)) for scale in (0.1, 0.2))
    asked = [
        (offsets, weights if order > 0 else weights[::-1].copy(), gradient, slopes)
        for offsets in (near, far)
        for order in (1, -1)
        for gradient in (False, True)
        for slopes in (None, np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]))
    ]
    for offsets, w, gradient, slopes in [*asked, *asked[::-1]]:
        found = learnt.average(Q, offsets, w, gradient, slopes)
        own = [None if part is None else np.tile(part, (len(Q), 1, 1)) for part in (offsets, slopes)]
        for one, other in zip(found, learnt.average(Q, own[0], w, gradient, own[1]), strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kernel", KERNELS)
def test_gradients(kernel, data):
    X, y, Q = data
    posterior = GaussianProcess(kernel=kernel, mean_variance=0.5, ratio=1e-6).fit(X, y).posterior
    offsets, weights = sigma_points(S, k=0.5)
    for xi, w in ((np.zeros((1, 2)), np.ones(1)), (offsets, weights)):
        found = posterior.average(Q, xi, w, gradient=True)
        plain = posterior.average(Q, xi, w)
        np.testing.assert_allclose(found.mean, plain.mean, atol=1e-9)
        np.testing.assert_allclose(found.variance, plain.variance, atol=1e-9)
        mean = differences(lambda U, xi=xi, w=w: posterior.average(U, xi, w).mean, Q)
        variance = differences(lambda U, xi=xi, w=w: posterior.average(U, xi, w).variance, Q)
        np.testing.assert_allclose(found.mean_gradient, mean, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(found.variance_gradient, variance, rtol=1e-4, atol=1e-5)


def test_gradient_where_points_are_held_at_the_border(learnt):
    offsets, weights = sigma_points(S)
    U = np.array([[0.02, 0.5], [0.97, 0.99]])

    def held(V):
        return np.clip(V[:, None, :] + offsets, 0.0, 1.0) - V[:, None, :]

    inside = (U[:, None, :] + offsets > 0.0) & (U[:, None, :] + offsets < 1.0)
    found = learnt.average(U, held(U), weights, True, inside.astype(float))
    mean = differences(lambda V: learnt.average(V, held(V), weights).mean, U)
    variance = differences(lambda V: learnt.average(V, held(V), weights).variance, U)
    np.testing.assert_allclose(found.mean_gradient, mean, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found.variance_gradient, variance, rtol=1e-4, atol=1e-5)


def test_mixture_is_the_law_of_total_variance(data, learnt):
    moments = learnt.moments(data[2])
    mean, variance = mixture(moments)
    rng = np.random.default_rng(4)
    particle = rng.integers(len(moments.mean), size=400_000)
    draws = moments.mean[particle, 0] + np.sqrt(moments.variance[particle, 0]) * rng.standard_normal(400_000)
    assert mean[0] == pytest.approx(draws.mean(), abs=5 * draws.std() / 632)
    assert variance[0] == pytest.approx(draws.var(), rel=0.03)


def test_draws_have_the_posterior_moments(data, learnt):
    points = np.random.default_rng(5).random((2, 3, 2))
    normals = np.random.default_rng(6).standard_normal((60_000, 3))
    draws = learnt.sample(points, normals)
    for i in range(2):
        moments = learnt.moments(points[i])
        error = np.sqrt(moments.variance / 60_000)
        assert np.all(np.abs(draws[:, i].mean(axis=1) - moments.mean) < 5 * error + 1e-6)
        np.testing.assert_allclose(draws[:, i].var(axis=1), moments.variance, rtol=0.05, atol=1e-7)
        w = np.array([0.2, 0.3, 0.5])
        together = learnt.average(np.zeros((1, 2)), points[i], w).variance[:, 0]
        np.testing.assert_allclose((draws[:, i] @ w).var(axis=1), together, rtol=0.05, atol=1e-7)


@pytest.mark.parametrize("clipped", [False, True])
def test_draws_of_many_queries_at_once_are_those_of_each_alone(learnt, clipped):
    rng = np.random.default_rng(8)
    points = rng.random((5, 1, 2)) + 0.2 * rng.standard_normal((6, 2))
    points = np.clip(points, 0.0, 1.0) if clipped else points
    normals = rng.standard_normal((4, 6))
    together = learnt.sample(points, normals)
    alone = np.concatenate([learnt.sample(points[i : i + 1], normals) for i in range(5)], axis=1)
    np.testing.assert_allclose(together, alone, atol=1e-6)
    assert learnt.sample(points[:0], normals).shape == (len(together), 0, 4, 6)


@pytest.mark.parametrize("kernel", ["matern52", "squared_exponential", "matern52_two_scales"])
def test_means_alone_are_those_of_the_moments(kernel, data):
    X, y, _ = data
    queries = np.random.default_rng(1).uniform(-0.2, 1.2, (450, 2))
    posterior = GaussianProcess(kernel=kernel, mean_variance=0.3).condition(X, 9.0 * y, np.random.default_rng(0))
    np.testing.assert_allclose(posterior.means(queries), posterior.moments(queries).mean, rtol=1e-9)
    tree = TreedGaussianProcess().condition(X, y, np.random.default_rng(0))
    for any_one in (posterior, tree):
        np.testing.assert_allclose(means(any_one, queries), any_one.moments(queries).mean, rtol=1e-9)


def test_pending_trials_equal_a_refit_on_their_means(data):
    X, y, Q = data
    fixed = {"length_scales": [0.3, 0.6], "signal_variance": 1.3, "standardize": False, "noise": 0.1}
    posterior = GaussianProcess(**fixed).fit(X, y).posterior
    waiting = np.array([[0.2, 0.9], [0.5, 0.5]])
    believed = posterior.moments(waiting).mean[0]
    refit = GaussianProcess(**fixed).fit(np.vstack([X, waiting]), np.concatenate([y, believed])).posterior
    found = posterior.with_pending(waiting).moments(Q)
    np.testing.assert_allclose(found.mean, refit.moments(Q).mean, atol=1e-9)
    np.testing.assert_allclose(found.variance, refit.moments(Q).variance, atol=1e-9)


def test_pending_trials_leave_every_particles_mean_alone(data, learnt):
    found = learnt.with_pending(np.array([[0.2, 0.9], [0.5, 0.5]]))
    np.testing.assert_allclose(found.moments(data[2]).mean, learnt.moments(data[2]).mean, atol=1e-6)
    assert np.all(found.moments(data[2]).variance <= learnt.moments(data[2]).variance + 1e-9)


def test_a_thinned_posterior_is_that_of_its_particles(data, learnt):
    few, all_ = learnt.thinned(3).moments(data[2], gradient=True), learnt.moments(data[2], gradient=True)
    for one, whole in zip(few, all_, strict=True):
        np.testing.assert_array_equal(one, whole[::3])


def test_a_thinned_posterior_keeps_what_its_particles_believe_of_pending_trials(data, learnt):
    waiting = learnt.with_pending(data[2][:2])
    some = waiting.thinned(3, 1)
    np.testing.assert_array_equal(some.hyperparameters.theta, waiting.hyperparameters.theta[1::3])
    for one, whole in zip(some.left_out()[:2], waiting.left_out()[:2], strict=True):
        np.testing.assert_array_equal(one, whole[1::3])


def test_hyperparameters_are_learnt_from_the_first_trials_until_later_ones_contradict():
    rng = np.random.default_rng(11)
    X = rng.random((71, 1))
    y = np.sin(6 * X[:, 0])
    model = GaussianProcess()
    learnt = [model.condition(X[:n], y[:n], np.random.default_rng(0)).hyperparameters.theta for n in (68, 71)]
    np.testing.assert_array_equal(learnt[0], learnt[1])
    fresh = GaussianProcess().condition(X, y, np.random.default_rng(0))
    np.testing.assert_array_equal(fresh.hyperparameters.theta, learnt[1])
    assert fresh.surprise(68) < 4.0
    y[69] += 1.0
    contradicted = GaussianProcess().condition(X, y, np.random.default_rng(0))
    assert not np.array_equal(contradicted.hyperparameters.theta, learnt[1])
    np.testing.assert_allclose(contradicted.moments(X).mean, np.broadcast_to(y, (10, 71)), atol=1e-3)


def test_surprise_counts_standard_deviations(data):
    X, y, _ = data
    fixed = {"length_scales": [0.3, 0.6], "signal_variance": 1.3, "standardize": False, "noise": 0.1}
    before = GaussianProcess(**fixed).fit(X[:-1], y[:-1]).posterior.moments(X[-1:])
    after = GaussianProcess(**fixed).fit(X, y).posterior
    expected = abs(y[-1] - before.mean[0, 0]) / np.sqrt(before.variance[0, 0] + 0.01)
    assert after.surprise(len(y) - 1) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("spread", "few"), [(0.1, False), (2.0, False), (3.0, True), (6.0, True)])
def test_what_few_particles_explain_is_a_surprise(spread, few):
    """The particles weighed by the density of the later trials given the first ones, by SciPy."""
    rng, n, k, m = np.random.default_rng(5), 6, 4, 12
    roots = rng.standard_normal((m, n, n))
    A = roots @ roots.transpose(0, 2, 1) + np.exp(spread * rng.standard_normal(m))[:, None, None] * np.eye(n)
    y = rng.standard_normal(n)
    found = surprise(np.array([np.linalg.inv(np.linalg.cholesky(a)) for a in A]), np.tile(y, (m, 1)), k)
    logs, misses = np.empty(m), np.empty((m, n - k))
    for j, a in enumerate(A):
        parts = (multivariate_normal(np.zeros(c), a[:c, :c]).logpdf(y[:c]) for c in (n, k))
        logs[j] = next(parts) - next(parts)
        for i in range(k, n):
            gain = np.linalg.solve(a[:i, :i], a[:i, i])
            misses[j, i - k] = abs(y[i] - gain @ y[:i]) / np.sqrt(a[i, i] - gain @ a[:i, i])
    weights = np.exp(logs - logs.max())
    effective = weights.sum() ** 2 / np.square(weights).sum()
    assert (effective < 0.25 * m) == few
    assert found == (np.inf if few else pytest.approx(misses.min(axis=0).max()))


def test_equal_outputs_leave_the_prior():
    X = np.random.default_rng(0).random((12, 2))
    learning, prior = Learning(particles=4000), Prior((-1.0, 0.5), (0.7, 2.0), (-3.0, 1.5))
    posterior = GaussianProcess(prior=prior, learning=learning, noise="inferred").fit(X, np.ones(12)).posterior
    theta = posterior.hyperparameters.theta
    for column, (mean, deviation) in zip(theta.T, [(-1.0, 0.5)] * 2 + [(0.7, 2.0), (-3.0, 1.5)], strict=True):
        assert kstest(column, norm(mean, deviation).cdf).pvalue > 0.01


def test_learns_the_length_scales_of_a_known_process():
    rng = np.random.default_rng(7)
    X = rng.random((150, 2))
    K = correlation("matern52", X, X, np.array([0.15, 0.8])) + 1e-8 * np.eye(150)
    y = np.linalg.cholesky(K) @ rng.standard_normal(150)
    scales = GaussianProcess(learning=Learning(particles=20, burn_in=10)).fit(X, y).posterior.length_scales
    assert 0.1 < np.median(scales[:, 0]) < 0.22
    assert 0.5 < np.median(scales[:, 1]) < 1.3


def test_infers_the_noise():
    rng = np.random.default_rng(8)
    X = rng.random((120, 1))
    y = np.sin(6 * X[:, 0]) + 0.2 * rng.standard_normal(120)
    posterior = GaussianProcess(noise="inferred").fit(X, y).posterior
    noise = posterior.outputs.scale * np.sqrt(posterior.hyperparameters.v)
    assert 0.16 < np.median(noise) < 0.25


@pytest.mark.parametrize("method", ["elliptical_slice", "slice", "map"])
def test_interpolates_and_repeats_itself(method, data):
    X, y, Q = data
    learning = Learning(method=method)
    model = GaussianProcess(learning=learning).fit(X, y, seed=3)
    np.testing.assert_allclose(model.predict(X), y, atol=1e-5)
    assert np.array_equal(model.predict(Q), GaussianProcess(learning=learning).fit(X, y, seed=3).predict(Q))


def test_the_mode_is_a_maximum(data):
    from surehold.optimization.surrogates.gaussian_process.hyperparameters import mode
    from surehold.optimization.surrogates.gaussian_process.likelihood import log_posterior

    X, y, _ = data
    evidence = GaussianProcess().fit(X, y).posterior.evidence
    theta, evaluations = mode(evidence)
    top = log_posterior(theta, evidence)
    assert evaluations > 0
    for step in 0.02 * np.vstack([np.eye(3), -np.eye(3)]):
        assert log_posterior(theta + step, evidence) <= top + 1e-5


def test_coordinate_wise_chains_go_on_from_the_previous_particles(data):
    X, y, _ = data
    model = GaussianProcess(learning=Learning("slice", particles=2, burn_in=0))
    first = model.condition(X, y, np.random.default_rng(0))
    follow = model.condition(X, y, np.random.default_rng(1), first)
    fresh = model.condition(X, y, np.random.default_rng(1))
    assert not np.array_equal(follow.hyperparameters.theta, fresh.hyperparameters.theta)


HARD = {
    "repeated inputs": (np.full((6, 2), 0.3), np.arange(6.0)),
    "repeated inputs and outputs": (np.full((6, 2), 0.3), np.full(6, 2.0)),
    "one observation": (np.array([[0.2, 0.7]]), np.array([5.0])),
    "one observation of 0": (np.array([[0.2, 0.7]]), np.array([0.0])),
    "constant outputs": (np.random.default_rng(0).random((12, 2)), np.full(12, 0.1)),
    "constant huge outputs": (np.random.default_rng(0).random((12, 2)), np.full(12, 1e300)),
    "near-duplicates that disagree": (
        np.concatenate([np.random.default_rng(0).random((8, 2)), np.random.default_rng(0).random((8, 2)) + 1e-9]),
        np.random.default_rng(1).standard_normal(16),
    ),
    "flat start, one peak": (np.random.default_rng(0).random((12, 2)), np.array([0.0] * 11 + [1.0])),
    "one tiny peak on a large constant": (
        np.random.default_rng(0).random((12, 2)),
        np.array([1e6] * 11 + [1e6 + 1e-3]),
    ),
    "a line": (np.linspace(0, 1, 30)[:, None] * [1.0, 1.0], np.linspace(0, 1, 30)),
    "many dimensions, few points": (np.random.default_rng(0).random((3, 15)), np.array([1.0, 2.0, 4.0])),
    "outlier": (np.random.default_rng(0).random((20, 1)), np.array([0.0, 1.0] * 9 + [0.5, 1e8])),
}
SIZES = [1.0, 1e12, 1e-12, 1e200, 1e-200, -1e299, 5e-324]


@pytest.mark.parametrize("case", HARD)
@pytest.mark.parametrize("noise", ["none", "inferred"])
def test_hard_data_give_numbers(case, noise):
    X, y = HARD[case]
    model = GaussianProcess(noise=noise).fit(X, y)
    Q = np.random.default_rng(9).random((30, X.shape[1]))
    mean, std = model.predict(np.concatenate([Q, X]), return_std=True)
    assert np.all(np.isfinite(mean)), "a mean is not finite"
    assert np.all(np.isfinite(std)), "a standard deviation is not finite"
    assert np.all(std >= 0.0)
    moments = model.posterior.average(Q, np.zeros((1, X.shape[1])), np.ones(1), gradient=True)
    assert np.isfinite(moments.mean_gradient).all()
    assert np.isfinite(moments.variance_gradient).all()
    assert model.posterior.diagnostics.observations == len(X)
    assert model.posterior.diagnostics.flat == bool(np.ptp(y) == 0.0)


@pytest.mark.parametrize("size", SIZES)
def test_outputs_of_any_size_give_numbers(size, data):
    X, y, Q = data
    model = GaussianProcess().fit(X, size * y)
    posterior = model.posterior.average(Q, *sigma_points(S), gradient=True)
    for values in (*model.predict(Q, return_std=True), *posterior):
        assert np.isfinite(values).all()
    if 1e-150 < abs(size) < 1e150:
        plain = GaussianProcess().fit(X, y)
        np.testing.assert_allclose(model.predict(Q) / size, plain.predict(Q), rtol=1e-6)
        np.testing.assert_allclose(
            model.predict(Q, return_std=True)[1] / abs(size), plain.predict(Q, return_std=True)[1], rtol=1e-5
        )


def test_length_scales_far_beyond_the_box(data):
    X, _, Q = data
    y = X @ [1.0, 2.0]
    for scales in (1e2, 1e5, 1e8):
        model = GaussianProcess(length_scales=[scales, scales]).fit(X, y)
        mean, std = model.predict(Q, return_std=True)
        assert np.isfinite([mean, std]).all()
    assert GaussianProcess(prior=Prior((8.0, 1.0))).fit(X, y).predict(Q) == pytest.approx(Q @ [1.0, 2.0], abs=0.05)


def test_no_nugget_with_repeated_inputs_is_counted_as_repaired():
    X = np.array([[0.1], [0.1], [0.5]])
    model = GaussianProcess(ratio=0.0, length_scales=[0.3], signal_variance=1.0).fit(X, [1.0, 1.0, 2.0])
    assert model.posterior.diagnostics.repaired == 1
    assert model.predict([[0.1], [0.5]]) == pytest.approx([1.0, 2.0], abs=1e-4)


def test_a_flat_start_is_unknown_not_certain():
    X = np.random.default_rng(0).random((10, 2))
    model = GaussianProcess().fit(X, np.zeros(10))
    assert model.posterior.diagnostics.flat
    _, std = model.predict(np.random.default_rng(1).random((50, 2)), return_std=True)
    assert std.max() > 0.3
    assert std.min() > 1e-3
    stated = GaussianProcess(output_range=(0.0, 40.0)).fit(X, np.zeros(10)).predict([[0.5, 0.5]], return_std=True)[1]
    assert stated == pytest.approx(10.0 * model.predict([[0.5, 0.5]], return_std=True)[1])


@pytest.mark.parametrize("size", [5e-6, -3e8])
def test_equal_outputs_may_vary_by_their_size(size):
    X = np.random.default_rng(0).random((10, 2))
    Q = np.random.default_rng(1).random((50, 2))
    deviations = [GaussianProcess().fit(X, np.full(10, y)).predict(Q, return_std=True)[1] for y in (1.0, size)]
    np.testing.assert_allclose(deviations[1], abs(size) * deviations[0], rtol=1e-9)


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 12), st.integers(1, 5), st.integers(0, 2**31), st.sampled_from([0.0, 1e-12, 1e-9, 1e-3, 1.0]))
def test_any_clustering_gives_numbers(n, d, seed, spread):
    rng = np.random.default_rng(seed)
    X = np.clip(rng.random(d) + spread * rng.standard_normal((n, d)), 0.0, 1.0)
    y = rng.standard_normal(n) * 10.0 ** rng.integers(-12, 12)
    mean, std = (
        GaussianProcess(learning=Learning(particles=2, burn_in=1))
        .fit(X, y)
        .predict(rng.random((5, d)), return_std=True)
    )
    assert np.isfinite([mean, std]).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"kernel": "matern"}, "did you mean"),
        ({"signal_variance": 0.0}, "signal_variance"),
        ({"signal_variance": np.nan}, "signal_variance"),
        ({"noise": -1.0}, "standard deviation"),
        ({"noise": "some"}, "inferred"),
        ({"ratio": -1e-3}, "ratio"),
        ({"mean_variance": -1.0}, "mean_variance"),
        ({"mean_variance": np.inf}, "mean_variance"),
        ({"output_range": (1.0, 0.0)}, "output_range"),
        ({"output_range": 3.0}, "output_range"),
        ({"length_scales": [0.0]}, "length_scales"),
    ],
)
def test_bad_settings(options, words):
    with pytest.raises(InputError, match=words):
        GaussianProcess(**options)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Learning(method="mcmc"), "learning method"),
        (lambda: Learning(particles=0), "particles"),
        (lambda: Learning(burn_in=-1), "burn_in"),
        (lambda: Learning(thin=1.5), "thin"),
        (lambda: Learning(width=0.0), "width"),
        (lambda: Prior((0.0, 0.0)), "log_length_scale"),
        (lambda: Prior((0.0, 1.0), log_signal_variance=(np.nan, 1.0)), "log_signal_variance"),
    ],
)
def test_bad_learning_and_priors(build, words):
    with pytest.raises(InputError, match=words):
        build()


@pytest.mark.parametrize(
    ("X", "y", "words"),
    [
        ([0.1, 0.2], [1.0, 2.0], "shape"),
        ([[0.1], [0.2]], [1.0], "2 rows"),
        ([[0.1], [np.nan]], [1.0, 2.0], "X holds NaN"),
        ([[0.1], [0.2]], [1.0, np.inf], "y holds NaN"),
        (np.empty((0, 2)), [], "no rows"),
        ([["a"]], [1.0], "numeric"),
    ],
)
def test_bad_data(X, y, words):
    with pytest.raises(InputError, match=words):
        GaussianProcess().fit(X, y)


def test_predictions_need_data_of_the_same_dimension():
    with pytest.raises(InputError, match="fit"):
        GaussianProcess().predict([[0.0]])
    with pytest.raises(InputError, match="shape"):
        GaussianProcess().fit([[0.1], [0.9]], [0.0, 1.0]).predict([[0.1, 0.2]])
    with pytest.raises(InputError, match="length_scales"):
        GaussianProcess(length_scales=[0.1, 0.2, 0.3]).fit([[0.1], [0.9]], [0.0, 1.0])


def test_draws_at_no_number_end_with_an_error():
    posterior = GaussianProcess().fit([[0.1], [0.5], [0.9]], [0.0, 1.0, 0.5]).posterior
    with pytest.raises(SureholdError, match="drawn"):
        posterior.sample(np.full((1, 2, 1), np.nan), np.zeros((1, 2)))

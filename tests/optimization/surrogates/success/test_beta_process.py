"""The smoothed beta process, against direct sums, SciPy's beta distribution and differences."""

import numpy as np
import pytest
from scipy import stats
from sklearn.gaussian_process.kernels import RBF

from surehold.errors import InputError
from surehold.optimization.surrogates.success import beta_process
from surehold.optimization.surrogates.success.beta_process import BetaProcess, left_out_likelihood

SCALES = np.array([0.2, 0.35])
PRIOR = (0.7, 1.9)


def data(n=30, most=6, seed=0):
    rng = np.random.default_rng(seed)
    X = rng.random((n, 2))
    of = rng.integers(1, most + 1, n)
    share = rng.binomial(of, np.exp(-4.0 * ((X - 0.6) ** 2).sum(axis=1))) / of
    return X, share, of.astype(float)


def conditioned(scales=SCALES, prior=PRIOR):
    X, y, of = data()
    return BetaProcess(prior, length_scales=scales).condition(X, y, np.random.default_rng(0), trials=of)


def counts_by_sums(x):
    """Return alpha and beta at x (2,) by one sum over single executions."""
    alpha, beta = PRIOR
    for z, share, of in zip(*data(), strict=True):
        weight = float(RBF(SCALES)(x[None], z[None])[0, 0])
        alpha += weight * round(share * of)
        beta += weight * (of - round(share * of))
    return alpha, beta


def test_moments_are_those_of_the_beta_distribution_of_direct_sums(monkeypatch):
    Q = np.random.default_rng(1).random((7, 2))
    expected = np.array([stats.beta.stats(*counts_by_sums(x)) for x in Q]).T
    for entries in (10**9, 50, 1):  # all at once, and in pieces
        monkeypatch.setattr(beta_process, "_AT_ONCE", entries)
        found = conditioned().moments(Q)
        np.testing.assert_allclose(found.mean[0], expected[0], rtol=1e-12)
        np.testing.assert_allclose(found.variance[0], expected[1], rtol=1e-10)


def test_executions_told_one_by_one_count_the_same():
    X, y, of = data()
    one = conditioned().moments(X)
    singles = [(x, k < round(s * n)) for x, s, n in zip(X, y, of, strict=True) for k in range(int(n))]
    places, happened = np.array([x for x, _ in singles]), np.array([h for _, h in singles], dtype=float)
    other = BetaProcess(PRIOR, length_scales=SCALES).condition(places, happened, np.random.default_rng(0)).moments(X)
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-12)
    np.testing.assert_allclose(one.variance, other.variance, rtol=1e-12)


def test_far_from_all_trials_the_prior_stands():
    mean, variance = stats.beta.stats(*PRIOR)
    found = conditioned(np.full(2, 0.01)).moments(np.array([[50.0, 50.0]]))
    assert (found.mean.item(), found.variance.item()) == pytest.approx((mean, variance))


def differences(function, U, h=1e-6):
    return np.stack([(function(U + h * e) - function(U - h * e)) / (2 * h) for e in np.eye(U.shape[1])], axis=-1)


@pytest.mark.parametrize("held", [False, True])
def test_gradients_by_differences(held):
    posterior = conditioned()
    U = np.random.default_rng(2).random((4, 2))
    offsets, weights = 0.1 * np.random.default_rng(3).standard_normal((5, 2)), np.array([0.3, 0.3, 0.2, 0.1, 0.1])
    free = np.ones((5, 2))
    if held:
        free[1, 0] = free[3, 1] = 0.0

    def at(V):  # a point that is held keeps its coordinate while the query moves
        moved = offsets + (1.0 - free) * (U - V)[:, None, :]
        return posterior.average(V, moved, weights, True, np.broadcast_to(free, moved.shape) if held else None)

    found = at(U)
    np.testing.assert_allclose(found.mean_gradient[0], differences(lambda V: at(V).mean[0], U), atol=1e-7)
    np.testing.assert_allclose(found.variance_gradient[0], differences(lambda V: at(V).variance[0], U), atol=1e-8)
    single = posterior.moments(U, gradient=True)
    np.testing.assert_allclose(
        single.variance_gradient[0], differences(lambda V: posterior.moments(V).variance[0], U), atol=1e-8
    )


def test_joint_draws_have_the_stated_distribution():
    posterior = conditioned()
    points = np.array([[[0.5, 0.5], [0.55, 0.5], [0.9, 0.1]]])
    draws = posterior.sample(points, np.random.default_rng(0).standard_normal((40_000, 3)))[0, 0]
    for k in range(3):
        assert stats.kstest(draws[:, k], stats.beta(*counts_by_sums(points[0, k])).cdf).pvalue > 0.01
    ranks = stats.norm.ppf(stats.rankdata(draws, axis=0) / (len(draws) + 1))
    np.testing.assert_allclose(np.corrcoef(ranks.T), RBF(SCALES)(points[0]), atol=0.015)
    weights = np.array([0.5, 0.3, 0.2])
    average = posterior.average(points[0, :1], points[0] - points[0, 0], weights)
    assert (draws @ weights).mean() == pytest.approx(average.mean.item(), abs=0.003)
    assert (draws @ weights).var() == pytest.approx(average.variance.item(), rel=0.05)


def test_one_noise_free_point_is_no_average():
    posterior, U = conditioned(), np.random.default_rng(2).random((3, 2))
    single, average = posterior.moments(U, True), posterior.average(U, np.zeros((1, 2)), np.ones(1), True)
    for one, other in zip(single, average, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_left_out_likelihood_as_models_without_each_place_give_and_its_gradient():
    X, y, of = data(12)
    s = y * of
    rows = np.array([0, 3, 4, 11])
    expected = 0.0
    for i in rows:
        rest = np.arange(12) != i
        other = BetaProcess(PRIOR, length_scales=SCALES).condition(
            X[rest], y[rest], np.random.default_rng(0), trials=of[rest]
        )
        p = other.moments(X[i : i + 1]).mean.item()
        expected += s[i] * np.log(p) + (of[i] - s[i]) * np.log(1.0 - p)
    value, slope = left_out_likelihood(SCALES, X, s, of - s, PRIOR, rows)
    assert value == pytest.approx(expected, rel=1e-12)

    def by_logs(logs):
        return np.array(left_out_likelihood(np.exp(logs), X, s, of - s, PRIOR, rows)[0])

    np.testing.assert_allclose(slope, differences(by_logs, np.log(SCALES)[None]), rtol=1e-6)


def test_a_variable_without_effect_gets_a_longer_scale():
    X = np.random.default_rng(0).random((150, 2))
    y = (np.abs(X[:, 0] - 0.5) < 0.15).astype(float)
    learnt = BetaProcess().condition(X, y, np.random.default_rng(0)).length_scales
    assert learnt[1] > 4.0 * learnt[0]


def test_where_few_trials_succeed_the_kernel_is_not_wide():
    """Against a prior about 1/2 wide kernels win by more counts alone (.57 here); the true width is .1."""
    for seed in (0, 4):
        rng = np.random.default_rng(seed)
        X = np.column_stack([rng.random(301), rng.integers(0, 5, 301) / 4])
        p = 0.9 * np.exp(-0.5 * ((X[:, 0] - 0.6) / 0.1) ** 2) * (X[:, 1] == 0.5)
        y = (rng.random(301) < p).astype(float)
        assert 0.03 < BetaProcess().condition(X, y, rng).length_scales[0] < 0.2


def test_pending_trials_shrink_the_variance_and_keep_the_mean():
    posterior = conditioned()
    U = np.array([[0.3, 0.8]])
    before, after = posterior.moments(U), posterior.with_pending(U).moments(U)
    assert after.mean.item() == pytest.approx(before.mean.item(), rel=1e-12)
    total = sum(counts_by_sums(U[0]))
    assert after.variance.item() == pytest.approx(before.variance.item() * (total + 1.0) / (total + 2.0), rel=1e-12)


def test_noise_is_that_of_one_outcome():
    posterior, U = conditioned(), np.array([[0.3, 0.8]])
    alpha, beta = counts_by_sums(U[0])
    expected = stats.beta(alpha, beta).expect(lambda p: p * (1.0 - p))
    assert posterior.noise_variance(U).item() == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"prior": (0.0, 1.0)}, r"prior is \(0\.0, 1\.0\); give two positive counts"),
        ({"prior": (1.0,)}, "two positive counts"),
        ({"length_scales": [0.1, -1.0]}, "give a positive number of box widths each"),
    ],
)
def test_bad_settings(arguments, message):
    with pytest.raises(InputError, match=message):
        BetaProcess(**arguments)

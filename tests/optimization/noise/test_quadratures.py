import numpy as np
import pytest
from filterpy.kalman import JulierSigmaPoints, MerweScaledSigmaPoints
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, norm, qmc

from surehold.errors import InputError
from surehold.optimization.noise.quadratures import (
    QUADRATURES,
    central_difference_points,
    gauss_hermite,
    quadrature,
    quasi_monte_carlo,
    scaled_sigma_points,
    sigma_points,
)


def covariance_of(d, seed):
    B = np.random.default_rng(seed).standard_normal((d, d))
    return B @ B.T + 0.1 * np.eye(d)


def in_order(points):
    return points[np.lexsort(points.T.round(9))]


@pytest.mark.parametrize("d", [1, 2, 3, 7])
@pytest.mark.parametrize("k", [1.0, 0.0, 2.5, -0.5])
def test_equal_to_filterpy(d, k):
    S = covariance_of(d, d)
    reference = JulierSigmaPoints(d, kappa=k)
    offsets, weights = sigma_points(S, k)
    np.testing.assert_allclose(offsets, reference.sigma_points(np.zeros(d), S), atol=1e-12)
    np.testing.assert_allclose(weights, reference.Wm, atol=1e-12)


@pytest.mark.parametrize("d", [1, 3])
def test_scaled_points_equal_filterpy(d):
    S = covariance_of(d, d)
    reference = MerweScaledSigmaPoints(d, alpha=0.5, beta=2.0, kappa=0.0)
    offsets, weights = scaled_sigma_points(S)
    np.testing.assert_allclose(offsets, reference.sigma_points(np.zeros(d), S), atol=1e-12)
    np.testing.assert_allclose(weights, reference.Wm, atol=1e-12)


@given(st.sampled_from(QUADRATURES[:4]), st.integers(1, 4), st.integers(0, 1000))
def test_exact_for_quadratics(name, d, seed):
    S = covariance_of(d, seed)
    offsets, weights = quadrature(name, S)
    rng = np.random.default_rng(seed)
    H, g, c = rng.standard_normal((d, d)), rng.standard_normal(d), rng.standard_normal()
    values = np.einsum("si,ij,sj->s", offsets, H, offsets) + offsets @ g + c
    assert weights @ values == pytest.approx(np.trace(H @ S) + c, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_gauss_hermite_is_exact_up_to_its_degree(order):
    offsets, weights = gauss_hermite([[4.0]], order)
    double_factorial = 1.0
    for half in range(order):  # E x^(2 half) = 4^half (2 half - 1)!!
        assert weights @ offsets[:, 0] ** (2 * half) == pytest.approx(4.0**half * double_factorial)
        double_factorial *= 2 * half + 1


def test_central_differences_match_the_fourth_moment():
    offsets, weights = central_difference_points([[4.0]])
    assert weights @ offsets[:, 0] ** 4 == pytest.approx(3.0 * 16.0)


@pytest.mark.parametrize("d", [1, 2, 5])
def test_quasi_monte_carlo_is_a_normal_sample(d):
    S = covariance_of(d, d)
    offsets, weights = quasi_monte_carlo(S, 11)
    assert offsets.shape == (2048, d)
    np.testing.assert_allclose(weights @ offsets, 0.0, atol=1e-12)
    np.testing.assert_allclose(offsets.T @ (offsets * weights[:, None]), S, rtol=0.03, atol=0.03)
    first = offsets[:, 0] / np.sqrt(S[0, 0])
    assert np.quantile(first, 0.9) == pytest.approx(1.2816, abs=0.02)
    smooth = np.cos(offsets.sum(axis=1))
    chance = smooth.std() / np.sqrt(2048)
    assert abs(weights @ smooth - np.exp(-0.5 * S.sum())) < chance, "no better than plain sampling"


@pytest.mark.parametrize("name", QUADRATURES)
def test_variables_without_noise_get_no_points(name):
    S = np.zeros((3, 3))
    S[np.ix_([0, 2], [0, 2])] = [[0.04, 0.01], [0.01, 0.09]]
    offsets, weights = quadrature(name, S)
    alone = quadrature(name, [[0.04, 0.01], [0.01, 0.09]])
    assert not offsets[:, 1].any()
    np.testing.assert_allclose(offsets[:, [0, 2]], alone.offsets)
    np.testing.assert_allclose(weights, alone.weights)
    nothing = quadrature(name, np.zeros((2, 2)))
    assert nothing.offsets.tolist() == [[0.0, 0.0]]
    assert nothing.weights.tolist() == [1.0]


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: sigma_points(np.eye(2), -2.0), "above -2"),
        (lambda: sigma_points(np.eye(2), np.nan), "finite"),
        (lambda: sigma_points(np.ones(2)), "square"),
        (lambda: sigma_points([[1.0, 0.0], [0.5, 1.0]]), "symmetric"),
        (lambda: sigma_points([[1.0, 2.0], [2.0, 1.0]]), "positive definite"),
        (lambda: sigma_points([[np.inf]]), "finite"),
        (lambda: sigma_points("a"), "'a'; give a finite square matrix"),
        (lambda: scaled_sigma_points(np.eye(2), 0.0), "alpha"),
        (lambda: scaled_sigma_points(np.eye(2), 1.0, -2.0), "kappa"),
        (lambda: central_difference_points(np.eye(2), 0.0), "step"),
        (lambda: gauss_hermite(np.eye(2), 0), "order"),
        (lambda: gauss_hermite(np.eye(9), 5), "unscented"),
        (lambda: quadrature("simpson", np.eye(2)), "unscented"),
    ],
)
def test_bad_arguments(build, words):
    with pytest.raises(InputError, match=words):
        build()


@pytest.mark.parametrize("name", ["gauss_hermite", "quasi_monte_carlo"])
def test_bounded_noise_against_an_integral_over_the_rectangle(name):
    from scipy.integrate import dblquad

    half = np.array([0.3, 0.1])
    points, weights = quadrature(name, np.diag(half**2 / 3.0), bounded=True, exponent=9)
    assert np.all(np.abs(points) <= half + 1e-12)
    np.testing.assert_allclose(weights @ points, 0.0, atol=1e-12)
    np.testing.assert_allclose((weights * points.T) @ points, np.diag(half**2 / 3.0), atol=1e-4)

    def f(x, y):
        return np.cos(3.0 * x + 1.0) * np.exp(y)

    expected = dblquad(lambda y, x: f(x, y), -half[0], half[0], -half[1], half[1])[0] / (4.0 * half.prod())
    assert weights @ f(*points.T) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("d", [1, 2, 3, 7])
def test_quasi_random_points_take_equal_shares_of_the_noise_along_each_variable(d):
    shares = (np.arange(64) + 0.5) / 64
    uniform, _ = quasi_monte_carlo(np.eye(d), 6, bounded=True)
    normal, _ = quasi_monte_carlo(np.eye(d), 6)
    for rule, even, off in ((uniform, 2.0 * shares - 1.0, 1e-12), (normal, norm.ppf(shares), 0.5)):
        for column in rule.T:
            np.testing.assert_allclose(np.sort(column), even / np.sqrt(np.mean(even**2)), atol=off)


@pytest.mark.parametrize(("d", "exponent"), [(1, 5), (2, 5), (7, 5), (16, 5), (3, 6), (8, 7)])
def test_quasi_random_points_have_the_covariance_and_no_farther_ones_than_normal_noise(d, exponent):
    covariance = covariance_of(d, 1)
    points, weights = quasi_monte_carlo(covariance, exponent)
    np.testing.assert_allclose(
        (weights[:, None] * points).T @ points, covariance, atol=1e-10 * np.abs(covariance).max()
    )
    squared = np.sum(np.linalg.solve(np.linalg.cholesky(covariance), points.T) ** 2, axis=0)
    assert squared.max() < chi2(d).isf(1e-4 if d < 16 else 0.2)
    if d <= 3:  # where so many points can tell
        assert np.quantile(squared, 0.9) == pytest.approx(chi2(d).isf(0.1), rel=0.2)


@pytest.mark.parametrize("d", [17, 40])
def test_quasi_random_points_of_very_many_variables_have_the_variances(d):
    points, weights = quasi_monte_carlo(np.diag(np.arange(1.0, d + 1.0)), 5)
    np.testing.assert_allclose(weights @ points, 0.0, atol=1e-12)
    np.testing.assert_allclose(weights @ points**2, np.arange(1.0, d + 1.0))


@pytest.mark.parametrize("d", [2, 3])
def test_quasi_random_points_are_spread_more_evenly_than_scrambled_sequences(d):
    uniform, _ = quasi_monte_carlo(np.eye(d), 6, bounded=True)
    shares = 0.5 + (0.5 - 0.25 / 32) * uniform / np.abs(uniform).max()  # the outermost are a quarter of a cell inside
    others = [qmc.discrepancy(qmc.Sobol(d, rng=seed).random_base2(6)) for seed in range(100)]
    assert qmc.discrepancy(shares) < np.quantile(others, 0.05)

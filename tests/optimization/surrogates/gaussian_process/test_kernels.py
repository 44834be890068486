import numpy as np
import pytest
from scipy.special import expit, logit
from sklearn.gaussian_process.kernels import RBF, Matern

from surehold.errors import InputError
from surehold.optimization.surrogates.gaussian_process.kernels import (
    KERNELS,
    along,
    correlation,
    correlation_and_factor,
    kernel_number,
    self_correlation,
    two_scale_slopes,
)


class Product:
    """Thesis (3.2) as printed: the product of scikit-learn's kernels of one variable."""

    def __init__(self, scales):
        self._scales = scales

    def __call__(self, X, Q):
        parts = [Matern(s, nu=2.5)(X[:, k : k + 1], Q[:, k : k + 1]) for k, s in enumerate(self._scales)]
        return np.prod(parts, axis=0)


class TwoScales:
    """The sum of two of scikit-learn's kernels."""

    def __init__(self, scales):
        self._scales = scales

    def __call__(self, X, Q):
        long, short = Matern(self._scales, nu=2.5), Matern(self._scales / PROPORTION, nu=2.5)
        return (1.0 - SHARE) * long(X, Q) + SHARE * short(X, Q)


REFERENCE = {
    "matern52": lambda scales: Matern(scales, nu=2.5),
    "matern32": lambda scales: Matern(scales, nu=1.5),
    "squared_exponential": lambda scales: RBF(scales),
    "matern52_product": Product,
    "matern52_two_scales": lambda scales: TwoScales(scales),
}
PROPORTION, SHARE = 7.0, 0.3
#: what else the scales of a kernel hold
SHAPE = {"matern52_two_scales": (PROPORTION, SHARE)}


@pytest.fixture
def points():
    rng = np.random.default_rng(0)
    return rng.random((9, 3)), rng.random((5, 3)), np.array([0.3, 1.7, 0.05])


@pytest.mark.parametrize("name", REFERENCE)
def test_equal_to_scikit_learn(name, points):
    X, Q, scales = points
    np.testing.assert_allclose(
        correlation(name, X, Q, scales, *SHAPE.get(name, ())), REFERENCE[name](scales)(X, Q), atol=1e-14
    )


@pytest.mark.parametrize("name", KERNELS)
def test_self_correlation_is_the_cross_correlation(name, points):
    X, _, scales = points
    out = np.empty((9, 9))
    self_correlation(kernel_number(name), X, np.append(1.0 / scales, SHAPE.get(name, ())), out)
    full = np.tril(out) + np.tril(out, -1).T
    np.testing.assert_allclose(full, correlation(name, X, X, scales, *SHAPE.get(name, ())), atol=1e-15)


@pytest.mark.parametrize("name", KERNELS)
def test_symmetric_positive_and_one_at_home(name, points):
    X, _, scales = points
    C = correlation(name, X, X, scales, *SHAPE.get(name, ()))
    np.testing.assert_allclose(C, C.T, atol=1e-16)
    np.testing.assert_allclose(np.diag(C), 1.0, atol=1e-15)
    assert np.linalg.eigvalsh(C).min() > 0.0


@pytest.mark.parametrize("name", KERNELS)
def test_far_points_are_uncorrelated_without_overflow(name):
    far = correlation(name, [[0.0]], [[1.0], [1e8], [1e150]], np.array([1e-9]), *SHAPE.get(name, ()))
    assert np.all((far >= 0.0) & (far < 1e-250))


@pytest.mark.parametrize("name", REFERENCE)
def test_factor_gives_both_derivatives(name, points):
    X, Q, scales = points
    out, factor = np.empty((9, 5)), np.empty((9, 5))
    shape = SHAPE.get(name, ())
    correlation_and_factor(kernel_number(name), X, Q, np.append(1.0 / scales, shape), out, factor)
    np.testing.assert_allclose(out, correlation(name, X, Q, scales, *SHAPE.get(name, ())), atol=1e-15)
    h = 1e-6
    for k in range(3):
        step = h * np.eye(3)[k]
        numeric = (correlation(name, X, Q + step, scales, *shape) - correlation(name, X, Q - step, scales, *shape)) / (
            2 * h
        )
        t = Q[None, :, k] - X[:, None, k]
        share = np.vectorize(along)(kernel_number(name), t, 1.0 / scales[k])
        np.testing.assert_allclose(-factor * share * t / scales[k] ** 2, numeric, atol=1e-8)
        up, down = scales * np.exp(step), scales * np.exp(-step)
        numeric = (correlation(name, X, Q, up, *shape) - correlation(name, X, Q, down, *shape)) / (2 * h)
        np.testing.assert_allclose(factor * share * t**2 / scales[k] ** 2, numeric, atol=1e-8)


def test_factor_is_finite_at_zero_distance():
    for name in KERNELS:
        out, factor = np.empty((1, 1)), np.empty((1, 1))
        scales = np.append(np.ones(2), SHAPE.get(name, ()))
        correlation_and_factor(kernel_number(name), np.zeros((1, 2)), np.zeros((1, 2)), scales, out, factor)
        assert out[0, 0] == pytest.approx(1.0, abs=1e-15)
        assert np.isfinite(factor[0, 0])


def test_unknown_kernel():
    with pytest.raises(InputError, match="did you mean 'matern52'"):
        correlation("matern", [[0.0]], [[0.0]], np.ones(1))


def test_derivatives_by_the_shape_of_two_scales(points):
    X, Q, scales = points
    squared = np.sum(((X[:, None] - Q) / scales) ** 2, axis=2)
    by_proportion, by_share = np.vectorize(two_scale_slopes)(squared, PROPORTION, SHARE)
    h, name = 1e-6, "matern52_two_scales"
    up, down = (correlation(name, X, Q, scales, PROPORTION * np.exp(step), SHARE) for step in (h, -h))
    np.testing.assert_allclose(by_proportion, (up - down) / (2 * h), atol=1e-8)
    up, down = (correlation(name, X, Q, scales, PROPORTION, expit(logit(SHARE) + step)) for step in (h, -h))
    np.testing.assert_allclose(by_share, (up - down) / (2 * h), atol=1e-8)


def test_a_short_part_without_a_share_changes_no_bit(points):
    X, Q, scales = points
    plain = correlation("matern52", X, Q, scales)
    np.testing.assert_array_equal(correlation("matern52_two_scales", X, Q, scales, PROPORTION, 1e-21), plain)


def test_neither_share_nor_proportion_is_the_squared_exponential_bit_for_bit(points):
    X, Q, scales = points
    found, expected = np.empty((2, 2, len(X), len(Q)))
    inverse = 1.0 / scales
    correlation_and_factor(kernel_number("matern52_two_scales"), X, Q, np.append(inverse, (0.0, 0.0)), *found)
    correlation_and_factor(kernel_number("squared_exponential"), X, Q, inverse, *expected)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(correlation("matern52_two_scales", X, Q, scales, 1e-21, 1e-21), expected[0])

import numpy as np
import pytest
from scipy.special import expit, logit
from sklearn.gaussian_process.kernels import RBF, Matern

from surehold.errors import InputError
from surehold.optimization.surrogates.gaussian_process.kernels import (
    KERNELS,
    LOG_ADDITIVE,
    along,
    correlation,
    correlation_and_factor,
    correlations,
    kernel_number,
    rectangle,
    transposed,
    triangle,
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


class Additive:
    """The sum of scikit-learn's kernels of one variable each, and one of all of them."""

    def __init__(self, scales):
        self._scales = scales

    def __call__(self, X, Q):
        parts = [Matern(s, nu=2.5)(X[:, k : k + 1], Q[:, k : k + 1]) for k, s in enumerate(self._scales)]
        return (1.0 - SHARE) * np.mean(parts, axis=0) + SHARE * Matern(self._scales / PROPORTION, nu=2.5)(X, Q)


REFERENCE = {
    "matern52": lambda scales: Matern(scales, nu=2.5),
    "matern32": lambda scales: Matern(scales, nu=1.5),
    "squared_exponential": lambda scales: RBF(scales),
    "matern52_product": Product,
    "matern52_two_scales": TwoScales,
    "additive": Additive,
}
PROPORTION, SHARE = 7.0, 0.3
#: what else the scales of a kernel hold
SHAPE = {
    "matern52_two_scales": (PROPORTION, SHARE),
    "additive": (PROPORTION * np.exp(LOG_ADDITIVE), SHARE),
}


def kernel_of(name):
    """Return the name by which the compiled functions know it: a sum is a form of two scales."""
    return "matern52_two_scales" if name == "additive" else name


def correlation_of(name, X, Q, scales):
    return correlation(kernel_of(name), X, Q, scales, *SHAPE.get(name, ()))


@pytest.fixture
def points():
    rng = np.random.default_rng(0)
    return rng.random((9, 3)), rng.random((5, 3)), np.array([0.3, 1.7, 0.05])


@pytest.mark.parametrize("name", REFERENCE)
def test_equal_to_scikit_learn(name, points):
    X, Q, scales = points
    np.testing.assert_allclose(correlation_of(name, X, Q, scales), REFERENCE[name](scales)(X, Q), atol=1e-14)


@pytest.mark.parametrize("name", REFERENCE)
def test_a_triangle_holds_the_correlations_of_points_with_those_before_them(name, points):
    X, _, scales = points
    number, inverse = kernel_number(kernel_of(name)), np.append(1.0 / scales, SHAPE.get(name, ()))
    starts = triangle(len(X))
    out, factor = np.empty((2, starts[-1]))
    correlations(number, X, transposed(X), inverse, starts, out, factor)
    full, full_factor = np.empty((2, len(X), len(X)))
    correlation_and_factor(number, X, X, inverse, full, full_factor)
    lower = np.tril_indices(len(X))
    np.testing.assert_allclose(out, full[lower], atol=1e-15)
    np.testing.assert_allclose(factor, full_factor[lower], atol=1e-13)


@pytest.mark.parametrize("count", [1, 7, 8, 31, 64])
@pytest.mark.parametrize("name", REFERENCE)
def test_rows_of_any_length_are_alike(name, count):
    rng = np.random.default_rng(1)
    P, Q, scales = rng.random((5, 3)), rng.random((count, 3)), np.array([0.3, 1.7, 0.05])
    number, inverse = kernel_number(kernel_of(name)), np.append(1.0 / scales, SHAPE.get(name, ()))
    out = np.empty(5 * count)
    correlations(number, P, transposed(Q), inverse, rectangle(5, count), out, out[:0])
    np.testing.assert_allclose(out.reshape(5, count), REFERENCE[name](scales)(P, Q), atol=1e-14)


@pytest.mark.parametrize("name", REFERENCE)
def test_symmetric_positive_and_one_at_home(name, points):
    X, _, scales = points
    C = correlation_of(name, X, X, scales)
    np.testing.assert_allclose(C, C.T, atol=1e-16)
    np.testing.assert_allclose(np.diag(C), 1.0, atol=1e-15)
    assert np.linalg.eigvalsh(C).min() > 0.0


@pytest.mark.parametrize("name", REFERENCE)
def test_far_points_are_uncorrelated_without_overflow(name):
    far = correlation_of(name, [[0.0]], [[1.0], [1e8], [1e150]], np.array([1e-9]))
    assert np.all((far >= 0.0) & (far < 1e-250))


@pytest.mark.parametrize("name", REFERENCE)
def test_factor_gives_both_derivatives(name, points):
    X, Q, scales = points
    out, factor, room = np.empty((3, 9, 5))
    number, inverse = kernel_number(kernel_of(name)), np.append(1.0 / scales, SHAPE.get(name, ()))
    correlation_and_factor(number, X, Q, inverse, out, factor)
    np.testing.assert_allclose(out, correlation_of(name, X, Q, scales), atol=1e-15)
    h = 1e-6
    for k in range(3):
        step = h * np.eye(3)[k]
        numeric = (correlation_of(name, X, Q + step, scales) - correlation_of(name, X, Q - step, scales)) / (2 * h)
        t = Q[None, :, k] - X[:, None, k]
        g = along(number, X, transposed(Q), inverse, k, rectangle(9, 5), factor.ravel(), room.ravel()).reshape(9, 5)
        np.testing.assert_allclose(-g * t / scales[k] ** 2, numeric, atol=1e-8)
        up, down = scales * np.exp(step), scales * np.exp(-step)
        numeric = (correlation_of(name, X, Q, up) - correlation_of(name, X, Q, down)) / (2 * h)
        np.testing.assert_allclose(g * t**2 / scales[k] ** 2, numeric, atol=1e-8)


def test_factor_is_finite_at_zero_distance():
    for name in REFERENCE:
        out, factor = np.empty((1, 1)), np.empty((1, 1))
        scales = np.append(np.ones(2), SHAPE.get(name, ()))
        correlation_and_factor(kernel_number(kernel_of(name)), np.zeros((1, 2)), np.zeros((1, 2)), scales, out, factor)
        assert out[0, 0] == pytest.approx(1.0, abs=1e-15)
        assert np.isfinite(factor[0, 0])


def test_unknown_kernel():
    with pytest.raises(InputError, match="did you mean 'matern52'"):
        correlation("matern", [[0.0]], [[0.0]], np.ones(1))


@pytest.mark.parametrize("name", SHAPE)
def test_derivatives_by_the_shape_of_two_scales(name, points):
    X, Q, scales = points
    proportion, share = SHAPE[name]
    squared = np.sum(((X[:, None] - Q) / scales) ** 2, axis=2)
    by_proportion, by_share = np.empty((2, len(X), len(Q)))
    C = correlation_of(name, X, Q, scales)
    two_scale_slopes(squared.ravel(), C.ravel(), proportion, share, by_proportion.ravel(), by_share.ravel())
    h, kernel = 1e-6, kernel_of(name)
    up, down = (correlation(kernel, X, Q, scales, proportion * np.exp(step), share) for step in (h, -h))
    np.testing.assert_allclose(by_proportion, (up - down) / (2 * h), atol=1e-8)
    up, down = (correlation(kernel, X, Q, scales, proportion, expit(logit(share) + step)) for step in (h, -h))
    np.testing.assert_allclose(by_share, (up - down) / (2 * h), atol=1e-8)


def test_every_kernel_has_a_reference():
    assert {kernel_of(name) for name in REFERENCE} == set(KERNELS)


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

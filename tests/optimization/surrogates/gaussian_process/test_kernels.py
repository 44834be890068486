import numpy as np
import pytest
from sklearn.gaussian_process.kernels import RBF, Matern

from surehold.errors import InputError
from surehold.optimization.surrogates.gaussian_process.kernels import (
    KERNELS,
    along,
    correlation,
    correlation_and_factor,
    kernel_number,
    self_correlation,
)


class Product:
    """Thesis (3.2) as printed: the product of scikit-learn's kernels of one variable."""

    def __init__(self, scales):
        self._scales = scales

    def __call__(self, X, Q):
        parts = [Matern(s, nu=2.5)(X[:, k : k + 1], Q[:, k : k + 1]) for k, s in enumerate(self._scales)]
        return np.prod(parts, axis=0)


REFERENCE = {
    "matern52": lambda scales: Matern(scales, nu=2.5),
    "matern32": lambda scales: Matern(scales, nu=1.5),
    "squared_exponential": lambda scales: RBF(scales),
    "matern52_product": Product,
}


@pytest.fixture
def points():
    rng = np.random.default_rng(0)
    return rng.random((9, 3)), rng.random((5, 3)), np.array([0.3, 1.7, 0.05])


@pytest.mark.parametrize("name", REFERENCE)
def test_equal_to_scikit_learn(name, points):
    X, Q, scales = points
    np.testing.assert_allclose(correlation(name, X, Q, scales), REFERENCE[name](scales)(X, Q), atol=1e-14)


@pytest.mark.parametrize("name", KERNELS)
def test_self_correlation_is_the_cross_correlation(name, points):
    X, _, scales = points
    out = np.empty((9, 9))
    self_correlation(kernel_number(name), X, 1.0 / scales, out)
    full = np.tril(out) + np.tril(out, -1).T
    np.testing.assert_allclose(full, correlation(name, X, X, scales), atol=1e-15)


@pytest.mark.parametrize("name", KERNELS)
def test_symmetric_positive_and_one_at_home(name, points):
    X, _, scales = points
    C = correlation(name, X, X, scales)
    np.testing.assert_allclose(C, C.T, atol=1e-16)
    np.testing.assert_allclose(np.diag(C), 1.0, atol=1e-15)
    assert np.linalg.eigvalsh(C).min() > 0.0


@pytest.mark.parametrize("name", KERNELS)
def test_far_points_are_uncorrelated_without_overflow(name):
    far = correlation(name, [[0.0]], [[1.0], [1e8], [1e150]], np.array([1e-9]))
    assert np.all((far >= 0.0) & (far < 1e-250))


@pytest.mark.parametrize("name", REFERENCE)
def test_factor_gives_both_derivatives(name, points):
    X, Q, scales = points
    out, factor = np.empty((9, 5)), np.empty((9, 5))
    correlation_and_factor(kernel_number(name), X, Q, 1.0 / scales, out, factor)
    np.testing.assert_allclose(out, correlation(name, X, Q, scales), atol=1e-15)
    h = 1e-6
    for k in range(3):
        step = h * np.eye(3)[k]
        numeric = (correlation(name, X, Q + step, scales) - correlation(name, X, Q - step, scales)) / (2 * h)
        t = Q[None, :, k] - X[:, None, k]
        share = np.vectorize(along)(kernel_number(name), t, 1.0 / scales[k])
        np.testing.assert_allclose(-factor * share * t / scales[k] ** 2, numeric, atol=1e-8)
        up, down = scales * np.exp(step), scales * np.exp(-step)
        numeric = (correlation(name, X, Q, up) - correlation(name, X, Q, down)) / (2 * h)
        np.testing.assert_allclose(factor * share * t**2 / scales[k] ** 2, numeric, atol=1e-8)


def test_factor_is_finite_at_zero_distance():
    for name in KERNELS:
        out, factor = np.empty((1, 1)), np.empty((1, 1))
        correlation_and_factor(kernel_number(name), np.zeros((1, 2)), np.zeros((1, 2)), np.ones(2), out, factor)
        assert out[0, 0] == 1.0
        assert np.isfinite(factor[0, 0])


def test_unknown_kernel():
    with pytest.raises(InputError, match="did you mean 'matern52'"):
        correlation("matern", [[0.0]], [[0.0]], np.ones(1))

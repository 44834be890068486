import numpy as np
import pytest
from scipy.linalg import solve_triangular

from surehold.optimization.numerics.triangular import (
    gram_of_lower,
    invert_lower,
    solve_lower,
    solve_lower_transposed,
    times_lower,
    times_lower_transposed,
)

SIZES = [*range(1, 12), 30, 193]


def lower(n):
    """Return a well-conditioned lower triangular matrix (n, n)."""
    rng = np.random.default_rng(n)
    return np.tril(rng.standard_normal((n, n)), -1) / np.sqrt(n) + np.diag(1.0 + rng.random(n))


@pytest.mark.parametrize("n", SIZES)
def test_solutions_and_inverse_are_those_of_lapack(n):
    L, b = lower(n), np.random.default_rng(1).standard_normal(n)
    noise = L + np.triu(np.full((n, n), np.nan), 1)  # what stands above the diagonal is not read
    forward, backward, inverse = b.copy(), b.copy(), np.full((n, n), np.nan)
    solve_lower(noise, forward)
    solve_lower_transposed(noise, backward)
    invert_lower(noise, inverse)
    np.testing.assert_allclose(forward, solve_triangular(L, b, lower=True), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(backward, solve_triangular(L.T, b), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(inverse, solve_triangular(L, np.eye(n), lower=True), rtol=1e-9, atol=1e-10)
    assert np.array_equal(np.triu(inverse, 1), np.zeros((n, n)))


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("q", [0, 1, 3, 4, 9])
def test_products_are_those_of_numpy(n, q):
    T, K, out = lower(n), np.random.default_rng(2).standard_normal((q, n)), np.full((q, n), np.nan)
    times_lower(T, K, out)
    np.testing.assert_allclose(out, K @ T.T, rtol=1e-12, atol=1e-12)
    times_lower_transposed(T, K, out)
    np.testing.assert_allclose(out, K @ T, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("n", SIZES)
def test_gram_matrix_is_that_of_numpy(n):
    T, out = lower(n), np.full((n, n), np.nan)
    gram_of_lower(T, out)
    np.testing.assert_allclose(np.tril(out), np.tril(T.T @ T), rtol=1e-12, atol=1e-12)

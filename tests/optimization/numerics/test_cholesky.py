import numpy as np
import pytest
from scipy.linalg import cholesky as lapack_cholesky
from scipy.linalg import solve_triangular

from surehold.optimization.numerics.cholesky import cholesky, invert_lower, solve_lower, solve_lower_transposed


@pytest.mark.parametrize("n", [*range(1, 12), 30, 193, 700])
def test_cholesky_is_that_of_lapack(n):
    rng = np.random.default_rng(n)
    B = rng.standard_normal((n, n))
    A = B @ B.T + n * np.eye(n)
    L = A.copy()
    assert cholesky(L)
    expected = lapack_cholesky(A, lower=True)
    np.testing.assert_allclose(np.tril(L), expected, atol=1e-11 * n)
    b = rng.standard_normal(n)
    forward, backward = b.copy(), b.copy()
    solve_lower(L, forward)
    solve_lower_transposed(L, backward)
    np.testing.assert_allclose(forward, solve_triangular(expected, b, lower=True), atol=1e-10)
    np.testing.assert_allclose(backward, solve_triangular(expected.T, b), atol=1e-10)
    inverse = np.empty((n, n))
    invert_lower(L, inverse)
    np.testing.assert_allclose(inverse @ expected, np.eye(n), atol=1e-9)


@pytest.mark.parametrize("n", [3, 250, 500])
@pytest.mark.parametrize("where", [0, -1])
def test_cholesky_refuses_what_is_not_positive_definite(n, where):
    A = np.eye(n)
    A[where, where] = -1e-3
    assert not cholesky(A)
    A = np.eye(n)
    A[where, where] = np.nan
    assert not cholesky(A)

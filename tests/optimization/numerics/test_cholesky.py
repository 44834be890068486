import numpy as np
import pytest
from scipy.linalg import cholesky as lapack_cholesky

from surehold.optimization.numerics.cholesky import cholesky


@pytest.mark.parametrize("n", [*range(1, 12), 30, 193, 700])
def test_cholesky_is_that_of_lapack(n):
    rng = np.random.default_rng(n)
    B = rng.standard_normal((n, n))
    A = B @ B.T + n * np.eye(n)
    L = A.copy()
    assert cholesky(L)
    np.testing.assert_allclose(np.tril(L), lapack_cholesky(A, lower=True), atol=1e-11 * n)


@pytest.mark.parametrize("n", [3, 250, 500])
@pytest.mark.parametrize("where", [0, -1])
def test_cholesky_refuses_what_is_not_positive_definite(n, where):
    A = np.eye(n)
    A[where, where] = -1e-3
    assert not cholesky(A)
    A = np.eye(n)
    A[where, where] = np.nan
    assert not cholesky(A)

"""Cholesky factorization of small matrices (compiled).

Legend: A (n, n) symmetric and positive definite, of which the lower triangle is read; L its lower Cholesky factor.
For n up to a few hundred, calls of LAPACK from compiled code cost more than the arithmetic: `benchmarks.factorization`.
"""

from math import sqrt

from surehold.optimization.numerics.products import eight_products, product, two_products
from surehold.store.kernels import njit

__all__ = ["cholesky"]


@njit(cache=True, fastmath={"contract"})
def cholesky(A):
    """Overwrite the lower triangle of A (n, n) with its Cholesky factor; False if A is not positive definite.

    Two columns at a time, and four rows below them together.
    """
    n = A.shape[0]
    for j in range(0, n - 1, 2):
        u, v = A[j], A[j + 1]
        uu, uv = two_products(u, u, v, j)
        pivot = u[j] - uu
        if not pivot > 0.0:
            return False
        u[j] = sqrt(pivot)
        first = 1.0 / u[j]
        v[j] = (v[j] - uv) * first
        between = v[j]
        pivot = v[j + 1] - product(v, v, j) - between * between
        if not pivot > 0.0:
            return False
        v[j + 1] = sqrt(pivot)
        second = 1.0 / v[j + 1]
        i = j + 2
        while i + 4 <= n:
            a, b, c, d = A[i], A[i + 1], A[i + 2], A[i + 3]
            au, bu, cu, du, av, bv, cv, dv = eight_products(a, b, c, d, u, v, j)
            a[j], b[j], c[j], d[j] = (a[j] - au) * first, (b[j] - bu) * first, (c[j] - cu) * first, (d[j] - du) * first
            a[j + 1] = (a[j + 1] - av - a[j] * between) * second
            b[j + 1] = (b[j + 1] - bv - b[j] * between) * second
            c[j + 1] = (c[j + 1] - cv - c[j] * between) * second
            d[j + 1] = (d[j + 1] - dv - d[j] * between) * second
            i += 4
        for row in range(i, n):
            a = A[row]
            au, av = two_products(a, u, v, j)
            a[j] = (a[j] - au) * first
            a[j + 1] = (a[j + 1] - av - a[j] * between) * second
    if n % 2 == 1:
        last = A[n - 1]
        pivot = last[n - 1] - product(last, last, n - 1)
        if not pivot > 0.0:
            return False
        last[n - 1] = sqrt(pivot)
    return True

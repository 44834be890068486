"""Scalar products of the beginnings of rows, several at a time (compiled).

A number that is loaded once then serves several sums: eight products of four rows with two take six loads a step, where
one by one they take sixteen. `benchmarks.factorization` times what is made of them beside BLAS and LAPACK.
"""

from surehold.store.kernels import njit

__all__ = ["eight_products", "product", "two_products"]


@njit(cache=True, fastmath={"reassoc", "contract"})
def product(a, b, stop):
    """Return the sum of a[k] b[k] over k < stop."""
    t = 0.0
    for k in range(stop):
        t += a[k] * b[k]
    return t


@njit(cache=True, fastmath={"reassoc", "contract"})
def two_products(a, u, v, stop):
    """Return the products of a with u and with v."""
    s = t = 0.0
    for k in range(stop):
        s += a[k] * u[k]
        t += a[k] * v[k]
    return s, t


@njit(cache=True, fastmath={"reassoc", "contract"})
def eight_products(a, b, c, d, u, v, stop):
    """Return the products of a, b, c and d with u, then those with v."""
    au = bu = cu = du = av = bv = cv = dv = 0.0
    for k in range(stop):
        au += a[k] * u[k]
        bu += b[k] * u[k]
        cu += c[k] * u[k]
        du += d[k] * u[k]
        av += a[k] * v[k]
        bv += b[k] * v[k]
        cv += c[k] * v[k]
        dv += d[k] * v[k]
    return au, bu, cu, du, av, bv, cv, dv

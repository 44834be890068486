"""Products, inverses and solutions with small lower triangular matrices (compiled).

Legend: L, T (n, n) lower triangular; of L the lower triangle alone is read, T holds zeros above its diagonal. Vectors
stand in rows, so that every inner loop runs along memory; blocks of rows are taken together (see `products`). Beside
BLAS and LAPACK: `benchmarks.factorization`.
"""

from surehold.optimization.numerics.products import eight_products, product, two_products
from surehold.store.kernels import njit

__all__ = [
    "gram_of_lower",
    "invert_lower",
    "solve_lower",
    "solve_lower_transposed",
    "times_lower",
    "times_lower_transposed",
]


@njit(cache=True, fastmath={"reassoc", "contract"})
def solve_lower(L, b):
    """Overwrite b (n,) with L^-1 b."""
    for i in range(b.size):
        b[i] = (b[i] - product(L[i], b, i)) / L[i, i]


@njit(cache=True, fastmath={"reassoc", "contract"})
def solve_lower_transposed(L, b):
    """Overwrite b (n,) with L'^-1 b."""
    for i in range(b.size - 1, -1, -1):
        b[i] /= L[i, i]
        t = b[i]
        for k in range(i):
            b[k] -= L[i, k] * t


@njit(cache=True, fastmath={"contract"})
def invert_lower(L, inverse):
    """Fill `inverse` (n, n) with the inverse of L, zeros above its diagonal, row by row from the rows above."""
    inverse[:] = 0.0
    for i in range(L.shape[0]):
        diagonal = 1.0 / L[i, i]
        row = inverse[i]
        k = 0
        while k + 4 <= i:
            t, u, v, w = L[i, k] * diagonal, L[i, k + 1] * diagonal, L[i, k + 2] * diagonal, L[i, k + 3] * diagonal
            a, b, c, d = inverse[k], inverse[k + 1], inverse[k + 2], inverse[k + 3]
            for j in range(k + 4):
                row[j] -= t * a[j] + u * b[j] + v * c[j] + w * d[j]
            k += 4
        for rest in range(k, i):
            t = L[i, rest] * diagonal
            a = inverse[rest]
            for j in range(rest + 1):
                row[j] -= t * a[j]
        row[i] = diagonal


@njit(cache=True)
def times_lower(T, K, out):
    """Fill row i of `out` (q, n) with T times row i of K (q, n)."""
    q, n = K.shape
    even, whole = n - n % 2, q - q % 4
    for r in range(0, even, 2):
        for i in range(0, whole, 4):
            found = eight_products(K[i], K[i + 1], K[i + 2], K[i + 3], T[r], T[r + 1], r + 2)
            out[i, r], out[i + 1, r], out[i + 2, r], out[i + 3, r] = found[:4]
            out[i, r + 1], out[i + 1, r + 1], out[i + 2, r + 1], out[i + 3, r + 1] = found[4:]
        for i in range(whole, q):
            out[i, r], out[i, r + 1] = two_products(K[i], T[r], T[r + 1], r + 2)
    for r in range(even, n):
        for i in range(q):
            out[i, r] = product(K[i], T[r], n)


@njit(cache=True, fastmath={"contract"})
def times_lower_transposed(T, V, out):
    """Fill row i of `out` (q, n) with T' times row i of V (q, n)."""
    q, n = V.shape
    out[:] = 0.0
    whole = n - n % 4
    for r in range(0, whole, 4):
        a, b, c, d = T[r], T[r + 1], T[r + 2], T[r + 3]
        for i in range(q):
            t, u, v, w = V[i, r], V[i, r + 1], V[i, r + 2], V[i, r + 3]
            o = out[i]
            for k in range(r + 4):
                o[k] += t * a[k] + u * b[k] + v * c[k] + w * d[k]
    for r in range(whole, n):
        a = T[r]
        for i in range(q):
            t = V[i, r]
            o = out[i]
            for k in range(r + 1):
                o[k] += t * a[k]


@njit(cache=True, fastmath={"contract"})
def gram_of_lower(T, out):
    """Fill the lower triangle of `out` (n, n) with that of T' T; above its diagonal `out` holds nothing of use."""
    n = T.shape[0]
    out[:] = 0.0
    whole = n - n % 4
    for r in range(0, whole, 4):
        a, b, c, d = T[r], T[r + 1], T[r + 2], T[r + 3]
        for i in range(r + 4):
            t, u, v, w = a[i], b[i], c[i], d[i]
            o = out[i]
            for k in range(i + 1):
                o[k] += t * a[k] + u * b[k] + v * c[k] + w * d[k]
    for r in range(whole, n):
        a = T[r]
        for i in range(r + 1):
            t = a[i]
            o = out[i]
            for k in range(i + 1):
                o[k] += t * a[k]

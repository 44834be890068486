"""Cholesky factors and triangular matrices, ours beside LAPACK and BLAS: `python -m benchmarks.factorization`.

The slice sampler factorizes thousands of matrices of 5 to 150 rows for every trial. Least CPU time of 9 rounds of 50
calls, on one core, each library on the memory layout it works in. Below, the other steps of a prediction: the inverse
of a factor beside LAPACK's dtrtri, and its products with itself and with 8 vectors beside BLAS as compiled code calls
it (dgemm by numpy.dot in numba, which multiplies the zeros as well).
"""

import time

import numba
import numpy as np
from scipy.linalg import lapack
from threadpoolctl import threadpool_limits

from surehold.optimization.numerics.cholesky import cholesky
from surehold.optimization.numerics.triangular import gram_of_lower, invert_lower, times_lower, times_lower_transposed

SIZES = (5, 10, 20, 40, 80, 140, 190, 400, 1000)
ROUNDS, COPIES = 9, 50


def microseconds(factorize, A):
    """Return the CPU microseconds of one factorization."""
    factorize(A.copy(order="K"))
    rounds = []
    for _ in range(ROUNDS):
        copies = [A.copy(order="K") for _ in range(COPIES)]
        start = time.process_time()
        for copy in copies:
            factorize(copy)
        rounds.append((time.process_time() - start) / COPIES)
    return 1e6 * min(rounds)


@numba.njit
def dgemm(A, B):
    return np.dot(A, B)


@numba.njit
def dgemm_transposed(A, B):
    return np.dot(A.T, B)


def steps(n):
    """Yield the name of a step, ours and theirs, for matrices of n rows; each is called with what it may overwrite."""
    rng = np.random.default_rng(n)
    T = np.tril(rng.standard_normal((n, n)), -1) / np.sqrt(n) + np.diag(1.0 + rng.random(n))
    K, out, square = rng.standard_normal((8, n)), np.empty((8, n)), np.empty((n, n))
    columns = np.ascontiguousarray(K.T)
    yield "inverse", lambda L: invert_lower(L, square), lambda L: lapack.dtrtri(L.T, lower=0), T
    yield "T' T", lambda L: gram_of_lower(L, square), lambda L: dgemm_transposed(L, L), T
    yield "T k", lambda L: times_lower(L, K, out), lambda L: dgemm(L, columns), T
    yield "T' k", lambda L: times_lower_transposed(L, K, out), lambda L: dgemm_transposed(L, columns), T


def main():
    print(f"{'n':>6} {'surehold us':>12} {'dpotrf us':>12} {'dpotrf/surehold':>16}")
    with threadpool_limits(1):
        for n in SIZES:
            B = np.random.default_rng(n).standard_normal((n, n))
            A = B @ B.T + n * np.eye(n)
            ours = microseconds(cholesky, A)
            theirs = microseconds(lambda M: lapack.dpotrf(M, lower=1, overwrite_a=1, clean=0), np.asfortranarray(A))
            print(f"{n:6} {ours:12.1f} {theirs:12.1f} {theirs / ours:16.2f}")
        print(f"\n{'n':>6} {'step':>8} {'surehold us':>12} {'library us':>12} {'library/surehold':>16}")
        for n in SIZES:
            for name, ours, theirs, T in steps(n):
                mine, other = microseconds(ours, T), microseconds(theirs, T)
                print(f"{n:6} {name:>8} {mine:12.1f} {other:12.1f} {other / mine:16.2f}")


if __name__ == "__main__":
    main()

"""Cholesky factors of small matrices, ours beside LAPACK's: `python -m benchmarks.factorization`.

The slice sampler factorizes thousands of matrices of 5 to 150 rows for every trial. Least CPU time of 9 rounds of 50
factorizations, on one core, each library on the memory layout it works in.
"""

import time

import numpy as np
from scipy.linalg import lapack
from threadpoolctl import threadpool_limits

from surehold.optimization.numerics.cholesky import cholesky

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


def main():
    print(f"{'n':>6} {'surehold us':>12} {'dpotrf us':>12} {'dpotrf/surehold':>16}")
    with threadpool_limits(1):
        for n in SIZES:
            B = np.random.default_rng(n).standard_normal((n, n))
            A = B @ B.T + n * np.eye(n)
            ours = microseconds(cholesky, A)
            theirs = microseconds(lambda M: lapack.dpotrf(M, lower=1, overwrite_a=1, clean=0), np.asfortranarray(A))
            print(f"{n:6} {ours:12.1f} {theirs:12.1f} {theirs / ours:16.2f}")


if __name__ == "__main__":
    main()

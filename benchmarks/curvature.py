"""Curvature of many hyperparameters along few directions against the whole: `python -m benchmarks.curvature [d ...]`.

d variables, 20 + d/5 trials of a function of ten of them, the processes of one and of two scales. Printed are the
smallest and the largest ratio of the two standard deviations of theta in any direction, how much the log evidence of
two scales against one changes, and the CPU seconds of both ways.
"""

import time

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from benchmarks.arguments import chosen
from surehold.optimization.surrogates.gaussian_process import curvature
from surehold.optimization.surrogates.gaussian_process.hyperparameters import mode
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

DIMENSIONS = (200, 400, 1000)


def roots(evidence, center):
    """Return the roots by few directions and by all, and the CPU seconds of each."""
    few = curvature.MANY_HYPERPARAMETERS
    found, seconds = [], []
    for many in (few, center.size):
        curvature.MANY_HYPERPARAMETERS = many
        start = time.process_time()
        found.append(curvature.root_of_covariance(evidence, center))
        seconds.append(time.process_time() - start)
    curvature.MANY_HYPERPARAMETERS = few
    return found, seconds


def main():
    for d in chosen(__doc__, DIMENSIONS, name="d"):
        X = qmc.LatinHypercube(d, rng=0).random(20 + d // 5)
        y = np.sin(3.0 * X[:, :10]).sum(axis=1)
        changes = []
        for kernel in ("matern52", "matern52_two_scales"):
            process = GaussianProcess(kernel=kernel)
            evidence = process._evidence(X, y, process.standardization(y), [len(y)], (1.0,), None)
            center, _ = mode(evidence)
            (short, whole), seconds = roots(evidence, center)
            ratio = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(whole, short @ short.T) @ np.linalg.inv(whole).T))
            changes.append(np.linalg.slogdet(short)[1] - np.linalg.slogdet(whole)[1])
            print(
                f"d = {d}, {kernel}: deviations {ratio.min():.2f} to {ratio.max():.2f} of the whole curvature's, "
                f"{seconds[0]:.2f} and {seconds[1]:.2f} s",
                flush=True,
            )
        print(f"d = {d}: log evidence of two scales against one {changes[1] - changes[0]:+.2f}", flush=True)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()

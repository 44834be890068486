"""Is the noise found where it is as large as the signal? `python -m benchmarks.inferred_noise`.

Random functions of `benchmarks.calibration`, uniformly drawn inputs, normal observation noise of a share of the
function's standard deviation over the box, the default model with `noise="inferred"`. Printed are the stated noise in
units of the true one, and the share of executions at the recommended input that fall below the stated 5 % quantile:
with the search for the mode beginning at little noise and at much, as it is, and at little alone. Means and standard
errors over seeds.
"""

import argparse
from unittest import mock

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import norm
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.calibration import random_function
from surehold.defaults import NOISE_VARIANCE_PRIOR
from surehold.optimization.surrogates.gaussian_process import hyperparameters

SIZES = ((1, 40), (2, 80), (3, 60), (5, 100))  # variables, trials
SHARES = (0.3, 0.7, 1.0, 1.5)


def one(d, n, share, seed, once):
    """Return stated noise / true noise, and the share of executions below the stated quantile."""
    rng = np.random.default_rng([d, n, round(100 * share), seed])
    f = random_function(d, rng)
    deviation = share * float(f(rng.random((4096, d))).std())
    X = rng.random((n, d))
    start = NOISE_VARIANCE_PRIOR[0] if once else hyperparameters.MODE_NOISE_START
    optimizer = sh.Optimizer(sh.Box.unit(d), noise="inferred", seed=seed)
    with threadpool_limits(1), mock.patch.object(hyperparameters, "MODE_NOISE_START", start):
        optimizer.restore(X, f(X) + deviation * rng.standard_normal(n))
        answer = optimizer.recommend()
        stated = float(optimizer.posterior.noise_variance(answer.x[None, :]).mean()) ** 0.5
    below = norm.cdf((answer.quantile - f(answer.x[None, :])[0]) / deviation)
    return stated / deviation, float(below)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    print("variables, trials, noise / signal: stated / true noise, below the 5 % quantile; from little noise alone")
    for d, n in SIZES:
        for share in SHARES:
            rows = Parallel(given.processes)(
                delayed(one)(d, n, share, given.first + run, once)
                for run in range(given.runs)
                for once in (False, True)
            )
            both = np.array(rows).reshape(given.runs, 2, 2)
            mean, error = both.mean(axis=0), both.std(axis=0, ddof=1) / given.runs**0.5
            words = [f"{mean[i, 0]:.2f} ({error[i, 0]:.2f}), {mean[i, 1]:.3f} ({error[i, 1]:.3f})" for i in (0, 1)]
            print(f"{d}, {n}, {share}: {words[0]}; {words[1]}", flush=True)


if __name__ == "__main__":
    main()

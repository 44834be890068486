"""What learning where the noise is larger gains: `python -m benchmarks.varying_noise`.

Random functions of `benchmarks.calibration`, uniformly drawn inputs, noise that is the same everywhere (.1), or that
grows along the first variable threefold (.06 to .18) or tenfold (.03 to .3). Printed is by how much the expected log
density of a fresh observation, anywhere in the box, is higher with `noise="heteroscedastic"` than with "inferred":
always learnt as varying, and as it is, varying only where the observations speak for it; and the share of runs in which
they do. Means and standard errors over seeds; that equal odds are fair was seen on seeds 0 to 23.
"""

import argparse
from unittest import mock

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from benchmarks.calibration import random_function
from surehold.defaults import CONSTANT_MEAN_VARIANCE
from surehold.optimization.surrogates.gaussian_process import heteroscedastic
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

SIZES = ((1, 10), (1, 20), (1, 50), (1, 100), (2, 30), (2, 70), (2, 150), (4, 140))  # variables, observations
NOISES = {
    "the same": lambda X: np.full(len(X), 0.1),
    "threefold": lambda X: 0.06 * 3.0 ** X[:, 0],
    "tenfold": lambda X: 0.03 * 10.0 ** X[:, 0],
}


def log_density(noise, X, y, Q, truth, deviation, seed):
    """Return the mean expected log density of observations at Q, and whether the noise was learnt as varying."""
    model = GaussianProcess(kernel="matern52_two_scales", mean_variance=CONSTANT_MEAN_VARIANCE, noise=noise)
    model.fit(X, y, seed)
    mean, std = model.predict(Q, return_std=True)
    variance = std**2 + model.noise_std(Q) ** 2
    squares = (mean - truth) ** 2 + deviation**2
    return -0.5 * np.mean(np.log(2.0 * np.pi * variance) + squares / variance), model.posterior.log_noise is not None


def one(d, n, kind, seed):
    """Return the gains of always and of as it is, and whether that is varying."""
    rng = np.random.default_rng([d, n, seed, 77])
    f, deviation = random_function(d, rng), NOISES[kind]
    X = rng.random((n, d))
    y = f(X) + deviation(X) * rng.standard_normal(n)
    Q = rng.random((500, d))
    asked = X, y, Q, f(Q), deviation(Q), seed
    with threadpool_limits(1):
        plain, _ = log_density("inferred", *asked)
        found, varies = log_density("heteroscedastic", *asked)
        with mock.patch.object(heteroscedastic, "_varies", return_value=True):
            always, _ = log_density("heteroscedastic", *asked)
    return always - plain, found - plain, varies


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=100, help="first seed")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.runs)
    print(f"{'noise':10} {'d':>3} {'n':>4}  {'always':>16} {'as it is':>16}  varying")
    with Parallel(n_jobs=arguments.processes) as parallel:
        for kind in NOISES:
            for d, n in SIZES:
                *gains, varies = np.array(parallel(delayed(one)(d, n, kind, seed) for seed in seeds)).T
                cells = [f"{gain.mean():+.3f} ({gain.std(ddof=1) / len(gain) ** 0.5:.3f})" for gain in gains]
                print(f"{kind:10} {d:3d} {n:4d}  {cells[0]:>16} {cells[1]:>16}  {varies.mean():.2f}", flush=True)


if __name__ == "__main__":
    main()

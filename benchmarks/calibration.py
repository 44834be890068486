"""Are the stated numbers kept at the recommended input? `python -m benchmarks.calibration [--runs 120]`.

Random functions of standard deviation 1 (2,000 random Fourier features of a Matérn-5/2 kernel, length-scale drawn
between 0.15 and 0.6 times sqrt(d)), one a run; the optimizer makes 10 + 10 d trials and recommends. Printed for each
row and number of variables d, with standard errors over runs:

    below     share of 4,096 fresh executions at the recommended input that fall below the stated 5 % quantile
    covered   share of runs in which the expected outcome there lies in the stated 95 % interval of the mean
    bias      stated mean minus expected outcome

Seeds from 10,000 on are for choosing constants, seeds below for reporting.
"""

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from scipy import special
from scipy.stats import qmc

import surehold as sh

DIMENSIONS = (1, 2, 4, 6)
INPUT_NOISE, WIDE_NOISE = 0.04, 0.1
#: name of a row -> (settings of the optimizer, standard deviation of the observations)
ROWS: dict[str, tuple[dict[str, Any], float]] = {
    "plain": ({}, 0.0),
    "known .1": ({"noise": 0.1}, 0.1),
    "inferred .1": ({"noise": "inferred"}, 0.1),
    "inferred .3": ({"noise": "inferred"}, 0.3),
    "heteroscedastic .1": ({"noise": "heteroscedastic"}, 0.1),
    "input noise": ({"input_noise": sh.InputNoise.unit(INPUT_NOISE)}, 0.0),
    "straying": ({"input_noise": sh.InputNoise.unit(INPUT_NOISE), "noise_while_exploring": True}, 0.0),
    "straying .1": ({"input_noise": sh.InputNoise.unit(WIDE_NOISE), "noise_while_exploring": True}, 0.0),
}


def random_function(d: int, rng: np.random.Generator) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function of points (q, d): a sum of random Fourier features, about a draw of a Matérn-5/2 process."""
    scale = np.sqrt(d) * np.exp(rng.uniform(np.log(0.15), np.log(0.6)))
    normals = rng.standard_normal((2000, d))
    frequencies = normals / scale * np.sqrt(5.0 / rng.chisquare(5.0, (2000, 1)))
    phases, amplitudes = rng.uniform(0.0, 2.0 * np.pi, 2000), rng.standard_normal(2000)
    return lambda X: np.cos(X @ frequencies.T + phases) @ amplitudes * np.sqrt(2.0 / 2000)


def one(row: str, d: int, seed: int) -> tuple[float, float, float]:
    """Return share below the quantile, whether the mean's interval covers, and the bias of the mean."""
    settings, deviation = ROWS[row]
    rng = np.random.default_rng([d, seed])
    f = random_function(d, rng)
    box = sh.Box({f"x{i}": (0.0, 1.0) for i in range(d)})
    optimizer = sh.Optimizer(box, seed=seed, **settings)
    noise = settings.get("input_noise")
    spread = 0.0 if noise is None else float(np.sqrt(noise.unit_covariance(box)[0, 0]))
    strays = spread * settings.get("noise_while_exploring", False)
    for _ in range(10 + 10 * d):
        x = optimizer.ask()
        at = x + (strays * rng.standard_normal(d) if strays else 0.0)
        optimizer.tell(x, float(f(at[None])[0]) + deviation * rng.standard_normal())
    best = optimizer.recommend()
    normals = special.ndtri(qmc.Sobol(d + 1, seed=rng).random(4096))
    means = f(best.x + spread * normals[:, :d])
    executions = means + deviation * normals[:, d]
    low, high = best.expectation.quantile(0.025), best.expectation.quantile(0.975)
    expected = float(means.mean())
    return float(np.mean(executions < best.quantile)), float(low <= expected <= high), best.mean - expected


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=120, help="runs of each row and number of variables")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rows", nargs="*", default=list(ROWS), choices=list(ROWS))
    parser.add_argument("--dimensions", nargs="*", type=int, default=list(DIMENSIONS))
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.runs)
    print(f"{'row':20} {'d':>3}  {'below .05 (se)':16} {'mean covered .95':17} {'bias (se)':16}")
    with Parallel(n_jobs=arguments.workers) as parallel:
        for row in arguments.rows:
            pooled = []
            for d in arguments.dimensions:
                values = np.array(parallel(delayed(one)(row, d, seed) for seed in seeds))
                pooled.append(values)
                _print(row, str(d), values)
            _print(row, "all", np.concatenate(pooled))


def _print(row: str, d: str, values: np.ndarray) -> None:
    mean, error = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))
    cells = [f"{m:.3f} ({e:.3f})" for m, e in zip(mean, error, strict=True)]
    print(f"{row:20} {d:>3}  {cells[0]:16} {cells[1]:17} {cells[2]:16}", flush=True)


if __name__ == "__main__":
    main()

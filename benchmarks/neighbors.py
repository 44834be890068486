"""What a model loses beyond 800 trials, each query being answered from those near it: `python -m benchmarks.neighbors`.

For functions whose variables interact or do not, in 10, 15, 20 and 30 variables: the error at 200 fresh inputs over the
standard deviation of the function, and the share of 95 % intervals that hold, by 800 trials and by 1,500, median of
`--runs` draws of function and trials; and the CPU seconds of an ask among the latter under an input noise of .02. With
`--times T` of T times as many trials near by as up to ten variables have.
"""

import argparse
import time

import numpy as np
from threadpoolctl import threadpool_limits

import surehold as sh
from surehold.optimization.surrogates.gaussian_process import neighbors

VARIABLES = (10, 15, 20, 30)
TRIALS = (800, 1500)
ASKS = 3


def functions(d, rng):
    """Return functions of inputs (n, d) by name."""
    center = rng.random(d)
    weights, phases = 2.0 * rng.standard_normal((3 * d, d)) / np.sqrt(d), 6.0 * rng.random(3 * d)
    heights = rng.standard_normal(3 * d)

    def rosenbrock(X):
        Z = 2.0 * X - 0.5
        terms = 100.0 * (Z[:, 1:] - Z[:, :-1] ** 2) ** 2 + (1.0 - Z[:, :-1]) ** 2
        return -np.log1p(terms.sum(axis=1))

    return {
        "sum of cosines": lambda X: -np.cos(3.0 * (X - center)).sum(axis=1),
        "sum of waves": lambda X: np.sin((X - 0.5) @ weights.T + phases) @ heights,
        "log Rosenbrock": rosenbrock,
    }


def measure(f, d, n, rng):
    """Return error and coverage at fresh inputs, and the median CPU seconds of an ask."""
    optimizer = sh.Optimizer(
        sh.Box({f"x{i}": (0.0, 1.0) for i in range(d)}), seed=0, input_noise=sh.InputNoise.unit(0.02)
    )
    X, fresh = rng.random((n, d)), rng.random((200, d))
    for x, y in zip(X, f(X), strict=True):
        optimizer.tell(x, float(y))
    mean, deviation = optimizer.predict(fresh)[:2]
    truth = f(fresh)
    times = []
    for _ in range(ASKS if n == TRIALS[-1] else 0):
        start = time.process_time()
        x = np.asarray(optimizer.ask())
        times.append(time.process_time() - start)
        optimizer.tell(x, float(f(x[None])[0]))
    error = float(np.sqrt(np.mean((mean - truth) ** 2)) / truth.std())
    return error, float(np.mean(np.abs(mean - truth) < 1.96 * deviation)), float(np.median(times)) if times else np.nan


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0, help="of the first run")
    parser.add_argument("--times", type=float)
    parser.add_argument("--variables", type=int, nargs="+", default=VARIABLES)
    told = parser.parse_args()
    if told.times is not None:
        neighbors.NEIGHBORS = tuple(round(told.times * count) for count in neighbors.NEIGHBORS)
        neighbors.MOST_TIMES_NEIGHBORS = 1.0
    print(
        f"{'function':16} {'d':>3} {'error by 800':>14} {'by 1,500':>10} {'covered':>9} {'by 1,500':>10} {'ask [s]':>9}"
    )
    with threadpool_limits(1):
        for d in told.variables:
            rows: dict[str, list[list[float]]] = {}
            for seed in range(told.seed, told.seed + told.runs):
                for name, f in functions(d, np.random.default_rng([seed, d])).items():
                    few, many = (measure(f, d, n, np.random.default_rng([seed, d, n])) for n in TRIALS)
                    rows.setdefault(name, []).append([few[0], many[0], few[1], many[1], many[2]])
            for name, found in rows.items():
                by_few, by_many, covered, also, seconds = np.median(found, axis=0)
                print(
                    f"{name:16} {d:3} {by_few:14.4f} {by_many:10.4f} {covered:9.3f} {also:10.3f} {seconds:9.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()

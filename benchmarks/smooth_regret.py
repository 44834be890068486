"""Plain runs on smooth functions, where precision counts: `python -m benchmarks.smooth_regret --seeds 20`.

    python -m benchmarks.smooth_regret --functions branin ackley-4 --methods default tgp optuna-gp

Branin and six-hump camel in 40 trials; Hartmann-6, Levy-4, Rosenbrock-4, Styblinski-Tang-5 and Ackley-4 in 80; 5 d
initial ones, the same for every method, seed by seed. No noise anywhere; peers are those that are installed, and those
whose runs are in the file of `--rows`. Printed are mean and standard error of log10 of the regret (known maximum minus
best observed, at least 1e-9) at half and full budget, and the paired difference at full budget from the first method.
Ackley is on [-14, 26]^4: in its usual box the optimum is the center, where some methods begin. The functions named
-wide are on larger boxes. The method as-told is the default without what `optimization.low_tail` does to deep values.
`--rows FILE` keeps the runs, a line each, and those that it holds are not made again.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from benchmarks.kept_runs import keep, kept
from surehold.campaigns.methods import Surehold
from surehold.campaigns.peers import PEERS, installed_peers
from surehold.optimization.surrogates.named import DEFAULT_SURROGATE, surrogate_named
from surehold.problems.published import branin


class AsTold:
    """The default surrogate under another type: the search then takes values as they are told, deep ones, too."""

    noisy = False

    def __init__(self):
        self._process = surrogate_named(DEFAULT_SURROGATE, input_deviations=np.zeros(1))

    def condition(self, X, y, rng, previous=None):
        return self._process.condition(X, y, rng, previous)


OURS = {
    "default": {},
    "as-told": {"surrogate": AsTold()},
    "tgp": {"surrogate": "tgp"},
    "local-global": {"surrogate": "local_global"},
    "gp": {"surrogate": "gp"},
}
_LEAST = 1e-9


def camel(x):
    a, b = x.T
    return (4.0 - 2.1 * a**2 + a**4 / 3.0) * a**2 + a * b + (4.0 * b**2 - 4.0) * b**2


def hartmann_6(x):
    rates = np.array(
        [[10, 3, 17, 3.5, 1.7, 8], [0.05, 10, 17, 0.1, 8, 14], [3, 3.5, 1.7, 10, 17, 8], [17, 8, 0.05, 10, 0.1, 14]]
    )
    places = 1e-4 * np.array(
        [
            [1312, 1696, 5569, 124, 8283, 5886],
            [2329, 4135, 8307, 3736, 1004, 9991],
            [2348, 1451, 3522, 2883, 3047, 6650],
            [4047, 8828, 8732, 5743, 1091, 381],
        ]
    )
    inner = np.sum(rates * (x[:, None] - places) ** 2, axis=2)
    return -np.exp(-inner) @ np.array([1.0, 1.2, 3.0, 3.2])


def levy(x):
    w = 1.0 + (x - 1.0) / 4.0
    middle = np.sum((w[:, :-1] - 1.0) ** 2 * (1.0 + 10.0 * np.sin(np.pi * w[:, :-1] + 1.0) ** 2), axis=1)
    last = (w[:, -1] - 1.0) ** 2 * (1.0 + np.sin(2.0 * np.pi * w[:, -1]) ** 2)
    return np.sin(np.pi * w[:, 0]) ** 2 + middle + last


def rosenbrock(x):
    return np.sum(100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2, axis=1)


def styblinski_tang(x):
    return 0.5 * np.sum(x**4 - 16.0 * x**2 + 5.0 * x, axis=1)


def ackley(x):
    root = np.sqrt(np.mean(x**2, axis=1))
    return -20.0 * np.exp(-0.2 * root) - np.exp(np.mean(np.cos(2.0 * np.pi * x), axis=1)) + 20.0 + np.e


#: Function to be minimized, its minimum, lower and upper bounds (d,), trials.
FUNCTIONS = {
    "branin": (branin, 0.39788735772973816, [-5.0, 0.0], [10.0, 15.0], 40),
    "camel": (camel, -1.031628453489877, [-2.0, -1.0], [2.0, 1.0], 40),
    "hartmann-6": (hartmann_6, -3.322368011415515, [0.0] * 6, [1.0] * 6, 80),
    "levy-4": (levy, 0.0, [-10.0] * 4, [10.0] * 4, 80),
    "rosenbrock-4": (rosenbrock, 0.0, [-2.048] * 4, [2.048] * 4, 80),
    "styblinski-tang-5": (styblinski_tang, -39.16616570377142 * 5, [-5.0] * 5, [5.0] * 5, 80),
    "ackley-4": (ackley, 0.0, [-14.0] * 4, [26.0] * 4, 80),
}
#: The same in boxes where values range much wider, by name only.
FUNCTIONS |= {
    "camel-wide": (camel, -1.031628453489877, [-3.0, -2.0], [3.0, 2.0], 40),
    "rosenbrock-4-wide": (rosenbrock, 0.0, [-5.0] * 4, [10.0] * 4, 80),
}


def run(name, method, seed):
    """Return log10 regret at half and full budget, and CPU seconds."""
    f, minimum, lower, upper, budget = FUNCTIONS[name]
    low, wide = np.array(lower), np.array(upper) - np.array(lower)
    d = low.size
    initial = qmc.LatinHypercube(d, rng=np.random.default_rng([seed, 95])).random(5 * d)
    started = time.process_time()
    values = []
    with threadpool_limits(1):
        if method in OURS:
            optimizer = Surehold(d, initial, seed, None, OURS[method])
        else:
            optimizer = installed_peers()[method](d, initial, seed)
        for _ in range(budget):
            u = np.clip(np.asarray(optimizer.ask(), dtype=np.float64), 0.0, 1.0)
            values.append(-float(f((low + u * wide)[None])[0]))
            optimizer.tell(u, values[-1])
    regret = np.maximum(-minimum - np.maximum.accumulate(values), _LEAST)
    return np.log10(regret[budget // 2 - 1]), np.log10(regret[-1]), time.process_time() - started


def _kept(name, method, seeds, file, processes):
    """Return what the run of each seed found, those of a file included."""
    known = kept(file)
    missing = [asked for seed in seeds if (asked := (name, method, seed)) not in known]
    runs = Parallel(n_jobs=processes, return_as="generator")(delayed(run)(*asked) for asked in missing)
    for asked, found in zip(missing, runs, strict=True):
        known[asked] = [float(number) for number in found]
        keep(file, asked, known[asked])
    return [known[name, method, seed] for seed in seeds]


def main():
    parser = argparse.ArgumentParser(description="Plain runs on smooth functions, where precision counts.")
    parser.add_argument("--seeds", type=int, default=20, help="number of seeds, 2 or more")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument(
        "--functions", nargs="+", default=[name for name in FUNCTIONS if "wide" not in name], choices=list(FUNCTIONS)
    )
    parser.add_argument("--methods", nargs="+", default=[*OURS, *installed_peers()], choices=[*OURS, *PEERS])
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--rows", type=Path, help="file of the runs, a line each")
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    made = kept(arguments.rows)
    for method in sorted(set(arguments.methods) - {*OURS, *installed_peers()}):
        if any((name, method, seed) not in made for name in arguments.functions for seed in seeds):
            parser.error(f"{method} is not installed, and some of its runs have to be made; pip install '.[peers]'")
    print(f"{arguments.seeds} seeds; log10 of the regret")
    print(f"{'function':18} {'method':22} {'half':>15} {'full':>15} {'- first':>15} {'CPU s':>6}")
    for name in arguments.functions:
        reference = None
        for method in arguments.methods:
            half, full, seconds = np.array(_kept(name, method, seeds, arguments.rows, arguments.processes)).T
            reference = full if reference is None else reference
            parts = [
                f"{v.mean():7.2f} ({v.std(ddof=1) / np.sqrt(len(v)):5.2f})" for v in (half, full, full - reference)
            ]
            print(f"{name:18} {method:22} {' '.join(parts)} {seconds.mean():6.1f}", flush=True)


if __name__ == "__main__":
    main()

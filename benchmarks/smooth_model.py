"""What the smooth one of the default's three models gains: `python -m benchmarks.smooth_model --first 330 --count 117`.

Landscapes of `benchmarks.generated_landscapes`' training seeds, in one to eight variables under all kinds of noise; a
run of the default on each, and one whose model has no particles of the squared-exponential process, with the same
initial design. Printed are, of all landscapes and by their variables, mean regrets [%] at full budget with standard
errors, runs within 1 %, the paired difference, that of the logarithm (base 10; regrets below 0.01 % count as that), and
how many runs come within 1 % with the smooth model that do not without it, and the other way round.

`--rows FILE` keeps the runs; those that it holds are not made again, and with `--count 0` all of them are printed.

`--hidden` prints how many landscapes are hidden instead: as many uniform points as there are trials have less than half
a chance that one of them sees a tenth of the height of the hill where the outcome is best, that hill alone, without
noise. `--set test` takes the test seeds for that.
"""

import argparse
import json
from pathlib import Path
from unittest import mock

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.generated_landscapes import BUDGETS, TEST, TRAINING, landscape
from benchmarks.search_variants import begun, regret
from surehold.optimization.surrogates.gaussian_process import hyperparameters

VARIANTS = ("without", "default")
GROUPS = {"all": (1, 8), "1-3 variables": (1, 3), "4-6 variables": (4, 6), "7-8 variables": (7, 8)}
SEEN, POINTS, LEAST = 0.1, 20_000, 0.01
SMOOTH = np.array([False, True, False])  # of rough, smooth, two scales


def run(seed, variant):
    """Return the final regret [%] of a run on the landscape of a seed."""
    own = hyperparameters.shared_out

    def without(log_evidences, count):
        return own(np.where(SMOOTH, np.nan, log_evidences), count)

    problem, design, (optimizer,) = begun(seed, "two_scales")
    with mock.patch.object(hyperparameters, "shared_out", without if variant == "without" else own):
        for _ in range(BUDGETS[problem.dimension]):
            x = np.clip(design.pop(0) if design else optimizer.ask(), 0.0, 1.0)
            optimizer.tell(x, problem(x))
        return regret(problem, optimizer.recommend().x)


def chance_seen(seed):
    """Return the chance that one of as many uniform points as trials sees a tenth of the hill of the best outcome."""
    problem = landscape(seed)
    points = np.random.default_rng([seed, 7]).random((POINTS, problem.dimension))
    inverses = np.linalg.inv(problem.covariances)
    at_best, at_points = (
        np.exp(-0.5 * np.einsum("nki,kij,nkj->nk", apart, inverses, apart))
        for apart in (x[:, None] - problem.centers for x in (problem.best().x[None], points))
    )
    highest = int(np.argmax(problem.heights * at_best[0]))
    return 1.0 - np.mean(at_points[:, highest] < SEEN) ** BUDGETS[problem.dimension]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=330, help="number of the first landscape of the set")
    parser.add_argument("--count", type=int, default=117, help="landscapes")
    parser.add_argument("--rows", type=Path, help="file of the runs, a line each")
    parser.add_argument("--hidden", action="store_true", help="print how many landscapes are hidden; no runs")
    parser.add_argument("--set", choices=["training", "test"], default="training", help="of --hidden")
    arguments = parser.parse_args()
    seeds = (TEST if arguments.set == "test" else TRAINING)[arguments.first : arguments.first + arguments.count]
    if arguments.hidden:
        hidden = {seed: chance_seen(seed) < 0.5 for seed in seeds}
        for name, members in _groups(seeds).items():
            print(f"{name}: {sum(hidden[seed] for seed in members)} of {len(members)} hidden")
        return
    known = {}
    if arguments.rows is not None and arguments.rows.exists():
        known = {(seed, variant): found for seed, variant, found in map(json.loads, arguments.rows.open())}
    with threadpool_limits(1):
        for seed in seeds:
            for variant in VARIANTS:
                if (seed, variant) not in known:
                    known[seed, variant] = run(seed, variant)
                    if arguments.rows is not None:
                        with arguments.rows.open("a") as file:
                            print(json.dumps([seed, variant, known[seed, variant]]), file=file)
    seeds = seeds or sorted({seed for seed, _ in known})
    for name, members in _groups(seeds).items():
        if len(members) > 1:
            _print_group(name, *(np.array([known[seed, variant] for seed in members]) for variant in VARIANTS))


def _groups(seeds):
    """Return the seeds of each group."""
    d = {seed: landscape(seed).dimension for seed in seeds}
    return {name: [seed for seed in seeds if low <= d[seed] <= high] for name, (low, high) in GROUPS.items()}


def _print_group(name, before, now):
    def told(values):
        return f"{values.mean():+.3f} ({values.std(ddof=1) / len(values) ** 0.5:.3f})"

    logarithm = np.log10(np.maximum(now, LEAST) / np.maximum(before, LEAST))
    found, once = now <= 1.0, before <= 1.0
    print(
        f"{name:14} {len(now):4}  without {told(before)}, {once.sum()} within 1 %; with {told(now)}, {found.sum()};"
        f" difference {told(now - before)}, of logarithms {told(logarithm)};"
        f" won {np.sum(found & ~once)}, lost {np.sum(once & ~found)}"
    )


if __name__ == "__main__":
    main()

"""Which landscapes hide their best hill? `python -m benchmarks.hidden_hills --set test`.

A landscape of `benchmarks.generated_landscapes` is hidden if as many uniform points as there are trials have less than
half a chance that one of them sees a tenth of the height of the hill where the outcome is best, that hill alone and
without noise. Printed are the seeds of the hidden ones, by number of variables.
"""

import argparse

import numpy as np

from benchmarks.generated_landscapes import BUDGETS, TEST, TRAINING, landscape

GROUPS = {"all": (1, 8), "1-3 variables": (1, 3), "4-6 variables": (4, 6), "7-8 variables": (7, 8)}
SEEN, POINTS = 0.1, 20_000


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
    parser.add_argument("--set", choices=["training", "test"], default="training")
    parser.add_argument("--count", type=int, default=40, help="landscapes")
    arguments = parser.parse_args()
    seeds = (TEST if arguments.set == "test" else TRAINING)[: arguments.count]
    hidden = {seed: chance_seen(seed) < 0.5 for seed in seeds}
    for name, (low, high) in GROUPS.items():
        members = [seed for seed in seeds if low <= landscape(seed).dimension <= high]
        found = [str(seed) for seed in members if hidden[seed]]
        print(f"{name}: {len(found)} of {len(members)} hidden: {' '.join(found)}")


if __name__ == "__main__":
    main()

"""Best value observed at the thesis' budgets, beside other optimizers: `python -m benchmarks.best_observed`.

    python -m benchmarks.best_observed --seeds 20 --methods "surehold gp" optuna-tpe --problems rkhs gf

Every method gets the same Latin hypercube as its initial design, seed by seed. Printed are mean and standard error of
the best value, the number of evaluations to come within 1 % of the maximum (median and 90th percentile over seeds; "-"
where that share of the seeds never does), and the largest number of times one run proposed one point (equal to 1e-6 of
the box).
"""

import argparse
import time

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from surehold.campaigns.methods import Surehold
from surehold.campaigns.peers import installed_peers

BUDGETS = {"rkhs": (5, 50), "gf": (20, 60), "gm": (30, 140), "gf-stretched": (20, 60)}
OURS = {"surehold gp": {}, "surehold tgp": {"surrogate": "tgp"}, "surehold local-global": {"surrogate": "local_global"}}
THESIS = {"surehold gp, thesis": {}, "surehold tgp, thesis": {"surrogate": "tgp"}}


def problem_named(name):
    return sh.problems.GF(stretched=True) if name == "gf-stretched" else sh.problems.synthetic_function(name)


def makers(problem):
    preset = "thesis-gf" if problem == "gf-stretched" else f"thesis-{problem}"
    settings = {**OURS, **{name: {**extra, "preset": preset} for name, extra in THESIS.items()}}
    ours = {name: (lambda d, initial, seed, s=s: Surehold(d, initial, seed, None, s)) for name, s in settings.items()}
    return {**ours, **installed_peers()}


def run(maker, problem, initial, budget, seed):
    """Return the values (budget,) and how often the commonest proposal after the initial design was made."""
    optimizer = maker(problem.box.dimension, initial, seed)
    points, values = [], []
    for _ in range(budget):
        u = np.clip(np.asarray(optimizer.ask(), dtype=np.float64), 0.0, 1.0)
        y = float(problem(problem.box.from_unit(u)))
        optimizer.tell(u, y)
        points.append(u)
        values.append(y)
    _, counts = np.unique(np.round(np.array(points)[len(initial) :], 6), axis=0, return_counts=True)
    return np.array(values), counts.max()


def share_reached(values, target, quantile):
    """Return the number of evaluations by which `quantile` of the runs (seeds, budget) have reached the target."""
    reached = np.maximum.accumulate(values, axis=1) >= target
    first = np.where(reached.any(axis=1), reached.argmax(axis=1) + 1, np.inf)
    count = np.sort(first)[int(np.ceil(quantile * len(first))) - 1]
    return f"{count:.0f}" if np.isfinite(count) else "-"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--problems", nargs="+", default=list(BUDGETS), choices=list(BUDGETS))
    parser.add_argument("--methods", nargs="+", default=None)
    arguments = parser.parse_args()
    print(f"{arguments.seeds} seeds")
    print(f"{'problem':13} {'method':24} {'best (se)':>22} {'to 1 %':>7} {'90 %':>5} {'same':>5} {'CPU s a run':>12}")
    for name in arguments.problems:
        initial, budget = BUDGETS[name]
        problem = problem_named(name)
        target = problem.optimum.value - 0.01 * abs(problem.optimum.value)
        for method, maker in makers(name).items():
            if arguments.methods and method not in arguments.methods:
                continue
            runs, same = [], 0
            started = time.process_time()
            with threadpool_limits(1):
                for seed in range(arguments.seeds):
                    design = qmc.LatinHypercube(problem.box.dimension, rng=np.random.default_rng([seed, 99]))
                    values, repeated = run(maker, problem, design.random(initial), budget, seed)
                    runs.append(values)
                    same = max(same, repeated)
            seconds = (time.process_time() - started) / arguments.seeds
            best = np.array(runs).max(axis=1)
            error = best.std(ddof=1) / np.sqrt(len(best)) if len(best) > 1 else np.nan
            print(
                f"{name:13} {method:24} {best.mean():12.5f} ({error:.5f}) "
                f"{share_reached(np.array(runs), target, 0.5):>7} {share_reached(np.array(runs), target, 0.9):>5} "
                f"{same:5d} {seconds:12.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()

"""Why a run ends above 1 % of regret: `python -m benchmarks.regret_causes --count 120 --dimensions 2 3`.

Runs of the default on the training set of `benchmarks.generated_family`, with the same initial designs. Each run that
ends above 1 % has one cause, the first of these that is true:

    answer   a trial within 1 % was made, and another one was recommended
    climb    none was, but a climb of the true outcome from one of the twelve best trials ends within 1 %
    search   no trial is on the right hill, and the model does not exclude it: z <= 3
    model    no trial is on the right hill, and the model is sure that it is none: z > 3

with z the standard deviations by which the outcome promised at the true best place lies below the truth. Regrets, the
promise of a further trial (`Optimizer.promise`) and the distance of the nearest trial from the best place, in box
widths, are printed run by run, with a summary by cause. Noise that varies is left out from three variables on: its
runs take ten times the time.
"""

import argparse
from collections import defaultdict

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.generated_landscapes import BUDGETS, TRAINING, landscape

CAUSES = ("found", "answer", "climb", "search", "model")
CLIMBS, SURE = 12, 3.0


def traced(seed):
    """Return what became of a run on the landscape of a seed."""
    problem = landscape(seed)
    d = problem.dimension
    budget = BUDGETS[d]
    n_initial = min(sh.Optimizer.default_n_initial(problem.box), budget // 2)
    initial = list(qmc.LatinHypercube(d, rng=np.random.default_rng([seed, 0, 98])).random(n_initial))
    optimizer = sh.Optimizer(problem.box, n_initial=n_initial, seed=0, input_noise=problem.noise)
    X = []
    half = None
    for i in range(budget):
        X.append(np.clip(initial.pop(0) if initial else optimizer.ask(), 0.0, 1.0))
        optimizer.tell(X[-1], problem(X[-1]))
        if i + 1 == budget // 2:
            half = optimizer.recommend().x
    best = problem.best()

    def regret(points):
        return 100.0 * (best.value - problem.expectation(np.atleast_2d(points))) / best.scale

    tried = regret(X)
    tops = [_climbed(problem, X[i]) for i in np.argsort(tried)[:CLIMBS]]
    mean, std = optimizer.predict(best.x[None], under_noise=True)
    row = {
        "seed": seed,
        "d": d,
        "shape": problem.shape,
        "noise": problem.kind,
        "half": float(regret(half)[0]),
        "full": float(regret(optimizer.recommend().x)[0]),
        "tried": float(tried.min()),
        "climb": float(regret(tops).min()),
        "z": float((best.value - mean[0]) / std[0]),
        "promise": 100.0 * optimizer.promise() / best.scale,
        "nearest": float(np.linalg.norm(np.array(X) - best.x, axis=1).min()),
    }
    return row | {"cause": cause(row)}


def cause(row):
    """Return the cause of a run's regret, "found" where it is within 1 %."""
    if row["full"] <= 1.0:
        return "found"
    if row["tried"] <= 1.0:
        return "answer"
    if row["climb"] <= 1.0:
        return "climb"
    return "search" if row["z"] <= SURE else "model"


def _climbed(problem, start):
    d = problem.dimension
    return minimize(lambda u: -problem.expectation(u[None])[0], start, bounds=[(0.0, 1.0)] * d).x


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="first training seed")
    parser.add_argument("--count", type=int, default=40, help="training seeds looked at")
    parser.add_argument("--dimensions", type=int, nargs="+", default=[2, 3])
    parser.add_argument("--seeds", type=int, nargs="+", help="just these, test seeds too; the others are not looked at")
    arguments = parser.parse_args()
    rows = []
    print(" seed  d  shape    noise        cause     half   full  tried  climb      z  promise  nearest")
    for seed in arguments.seeds or TRAINING[arguments.first : arguments.first + arguments.count]:
        problem = landscape(seed)
        slow = problem.kind == "varying" and problem.dimension > 2
        if not arguments.seeds and (slow or problem.dimension not in arguments.dimensions):
            continue
        with threadpool_limits(1):
            row = traced(seed)
        rows.append(row)
        print(
            f"{seed:5d} {row['d']:2d}  {row['shape']:8} {row['noise']:12} {row['cause']:7} {row['half']:6.2f} "
            f"{row['full']:6.2f} {row['tried']:6.2f} {row['climb']:6.2f} {row['z']:6.1f} {row['promise']:8.2f} "
            f"{row['nearest']:8.2f}",
            flush=True,
        )
    by_cause = defaultdict(list)
    for row in rows:
        by_cause[row["cause"]].append(row["full"])
    total = sum(row["full"] for row in rows)
    for name in CAUSES:
        if name in by_cause:
            print(f"{name}: {len(by_cause[name])} runs, {100 * sum(by_cause[name]) / total:.0f} % of all regret")


if __name__ == "__main__":
    main()

"""Robust regret on a family of landscapes drawn by seed: `python -m benchmarks.generated_family --count 20`.

    python -m benchmarks.generated_family --count 60 --methods default tgp plain --classes ridges anisotropic
    python -m benchmarks.generated_family --set test --count 200 --out family.csv
    python -m benchmarks.generated_family --set kinds --first 336 --count 140 --methods default plain

One to eight variables; hills, needles, cliffs, ridges; isotropic, anisotropic (some inputs exact), correlated, uniform
and varying noise: see `benchmarks.generated_landscapes`. Constants are chosen on the training set only; the test set
is for the one judgment at the end. The set `kinds` has other functions, see `benchmarks.fourteen_kinds`. Every method
gets the same initial design, problem by problem. Regret is what the answer's outcome under the noise lacks to the best
one, in per cent of the best minus the mean over the box; within 1 % counts as found. Printed are, at half and full
budget, the share found and the mean regret with standard errors over problems, the paired difference of the final
regret from the first method, and CPU seconds a run; for all problems, and by shape, noise and number of variables. Of
methods that state a mean it is printed how many of its 95 % intervals hold, also of answers so near the border that at
least 30 % of their executions leave the box.
"""

import argparse
import csv
import sys
import time

import numpy as np
from joblib import Parallel, delayed
from joblib.externals.loky.process_executor import TerminatedWorkerError
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.fourteen_kinds import KINDS, of_kind
from benchmarks.generated_landscapes import BUDGETS, NOISES, SHAPES, TEST, TRAINING, landscape
from surehold.campaigns.methods import perturbations_of
from surehold.campaigns.peers import installed_peers

OURS = {
    "default": {},
    "tgp": {"surrogate": "tgp"},
    "uei-thesis": {"criterion": "uei", "preset": "thesis"},
    "plain": None,
    "local-global": {"surrogate": "local_global"},
    "gp": {"surrogate": "gp"},
}
TOLD = {"botorch-robust": "botorch"}  # peers told of the input noise
#: set -> (what draws a problem, its seeds)
SETS = {"training": (landscape, TRAINING), "test": (landscape, TEST), "kinds": (of_kind, range(10_000))}
LEAVING = 0.3  # share of executions
GROUPS = {"1-2 variables": (1, 2), "3-4 variables": (3, 4), "5-6 variables": (5, 6), "7-8 variables": (7, 8)}


def run(seed, run_seed, method, budget_share=1.0, of="training"):
    """Return a row: the problem's kind, regrets [%] at half and full budget, and how what is stated holds.

    `holds` says whether the 95 % interval of the mean does, `leaving` how many executions leave the box along one
    variable; both are empty for a method that states none. `of` names a set that has the seed.
    """
    problem = SETS[of][0](seed)
    d = problem.dimension
    budget = max(int(budget_share * BUDGETS[d]), 10)
    n_initial = min(sh.Optimizer.default_n_initial(problem.box), budget // 2)
    initial = qmc.LatinHypercube(d, rng=np.random.default_rng([seed, run_seed, 98])).random(n_initial)
    started = time.process_time()
    with threadpool_limits(1):
        answers, stated = _answers(problem, method, initial, budget, run_seed)
    seconds = time.process_time() - started
    best = problem.best()
    outcomes = problem.expectation(np.array(answers))
    half, full = 100.0 * (best.value - outcomes) / best.scale
    holds = leaving = ""
    if stated is not None:
        low, high = (stated.expectation.quantile(level) for level in (0.025, 0.975))
        holds, leaving = int(low <= outcomes[1] <= high), max(stated.outside.values(), default=0.0)
    return {
        "seed": seed,
        "run": run_seed,
        "method": method,
        "d": d,
        "shape": problem.shape,
        "noise": problem.kind,
        "half": float(half),
        "full": float(full),
        "seconds": seconds,
        "holds": holds,
        "leaving": leaving,
    }


def _answers(problem, method, initial, budget, seed):
    """Return the answers after half and all of the trials, and the last recommendation, None of a method without."""
    waiting, answers, X, y, stated = list(initial), [], [], [], None
    if method in OURS:
        settings = OURS[method]
        noise = {} if settings is None else {"input_noise": problem.noise}
        optimizer = sh.Optimizer(problem.box, n_initial=len(initial), seed=seed, **noise, **(settings or {}))
    else:
        told = (
            {"perturbations": perturbations_of(_everywhere(problem), problem.dimension, seed)} if method in TOLD else {}
        )
        maker = installed_peers()[TOLD.get(method, method)]
        optimizer, waiting = maker(problem.dimension, initial, seed, **told), []
    for i in range(budget):
        u = np.clip(waiting.pop(0) if waiting else optimizer.ask(), 0.0, 1.0)
        X.append(u)
        y.append(problem(u))
        optimizer.tell(u, y[-1])
        if i + 1 not in (budget // 2, budget):
            continue
        if method not in OURS:
            answers.append(optimizer.answer())
        elif settings is None:
            answers.append(X[int(np.argmax(y))])
        else:
            stated = optimizer.recommend()
            answers.append(stated.x)
    return answers, stated


def _everywhere(problem):
    """Return the noise, and where it varies that in the middle of the box."""
    if not problem.noise.varies:
        return problem.noise
    return sh.InputNoise(covariance=problem.noise.unit_covariance(problem.box, np.full(problem.dimension, 0.5)))


def summary(rows, reference=None):
    """Return one line of text about rows of one method; `reference` are those of the first on the same runs."""
    parts = []
    for name in ("half", "full"):
        regret = np.array([row[name] for row in rows])
        found = regret <= 1.0
        root = np.sqrt(len(rows))
        parts.append(
            f"{100 * found.mean():5.0f} ({100 * found.std() / root:4.1f}) "
            f"{regret.mean():7.2f} ({regret.std(ddof=1) / root if len(rows) > 1 else np.nan:5.2f})"
        )
    paired = ""
    if reference is not None and len(rows) > 1:
        gap = np.array([row["full"] for row in rows]) - np.array([row["full"] for row in reference])
        paired = f"{gap.mean():+7.2f} ({gap.std(ddof=1) / np.sqrt(len(gap)):5.2f})"
    return f"{len(rows):4d}  {parts[0]}  {parts[1]}  {paired:16} {np.mean([row['seconds'] for row in rows]):6.1f}"


def classes_of(rows):
    """Return {class: rows}, all first."""
    found = {"all": rows}
    found |= {shape: [row for row in rows if row["shape"] == shape] for shape in (*SHAPES, *KINDS)}
    found |= {noise: [row for row in rows if row["noise"] == noise] for noise in NOISES}
    found |= {name: [row for row in rows if row["d"] in group] for name, group in GROUPS.items()}
    return {name: members for name, members in found.items() if members}


def chosen_seeds(family, first, count, classes):
    """Return seeds of a set, of problems whose shape, noise and group are among the classes (any where none is)."""
    seeds, wanted = [], set(classes)
    for seed in family[first:]:
        if len(seeds) == count:
            break
        problem = landscape(seed)
        group = next(name for name, members in GROUPS.items() if problem.dimension in members)
        named = [wanted & set(kinds) for kinds in (SHAPES, NOISES, GROUPS)]
        mine = (problem.shape, problem.kind, group)
        if all(not names or own in names for names, own in zip(named, mine, strict=True)):
            seeds.append(seed)
    return seeds


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", choices=tuple(SETS), default="training")
    parser.add_argument("--first", type=int, default=0, help="number of the first problem in the set")
    parser.add_argument("--count", type=int, default=20, help="problems")
    parser.add_argument("--runs", type=int, default=1, help="runs a problem")
    parser.add_argument(
        "--classes", nargs="+", default=[], choices=(*SHAPES, *NOISES, *GROUPS), help="of training and test"
    )
    parser.add_argument("--methods", nargs="+", default=list(OURS), choices=(*OURS, *installed_peers(), *TOLD))
    parser.add_argument("--budget", type=float, default=1.0, help="share of the usual number of trials")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", default="", help="file for the rows, as CSV")
    arguments = parser.parse_args()
    for method in arguments.methods:
        if TOLD.get(method, method) not in (*OURS, *installed_peers()):
            parser.error(f"{method} is not installed; pip install '.[peers]', or leave it out of --methods")
    family = SETS[arguments.set][1]
    if arguments.set == "kinds":
        seeds = list(family[arguments.first : arguments.first + arguments.count])
    else:
        seeds = chosen_seeds(family, arguments.first, arguments.count, arguments.classes)
    tasks = [(s, r, m) for s in seeds for r in range(arguments.runs) for m in arguments.methods]
    rows = []
    jobs = (delayed(run)(*task, arguments.budget, arguments.set) for task in tasks)
    try:
        for row in Parallel(n_jobs=arguments.processes, return_as="generator")(jobs):
            rows.append(row)
            told = f"{row['shape']}, {row['noise']}, d = {row['d']}"
            print(
                f"[{len(rows)}/{len(tasks)}] {row['seed']} {told}, {row['method']}: {row['half']:.2f} % at half, "
                f"{row['full']:.2f} % at the end, {row['seconds']:.0f} s",
                file=sys.stderr,
                flush=True,
            )
    except (KeyboardInterrupt, TerminatedWorkerError):  # keep what was done
        print(f"interrupted after {len(rows)} of {len(tasks)} runs", file=sys.stderr)
    if arguments.out and rows:
        with open(arguments.out, "w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    print(f"{arguments.set} set, {len(seeds)} problems, {arguments.runs} run(s) each; regret in % of best - mean")
    print(
        f"{'class':14} {'method':14}    n  {'half: found %':>12} {'regret %':>15}  {'full: found %':>12} "
        f"{'regret %':>15}  {'- first':16} {'CPU s':>6}"
    )
    for name, members in classes_of(rows).items():
        by_method = {m: [row for row in members if row["method"] == m] for m in arguments.methods}
        reference = {(row["seed"], row["run"]): row for row in by_method[arguments.methods[0]]}
        for method, own in by_method.items():
            same = [reference.get((row["seed"], row["run"])) for row in own]
            comparable = method != arguments.methods[0] and own and all(same)
            if own:
                print(f"{name:14} {method:14} {summary(own, same if comparable else None)}")
    for method in arguments.methods:
        stated = [row for row in rows if row["method"] == method and row["holds"] != ""]
        if stated:
            print(f"{method}: 95 % intervals of the mean that hold: {_held(stated)}")


def _held(rows):
    """Return in words how many intervals hold, and of answers near the border."""
    near = [row for row in rows if row["leaving"] >= LEAVING]
    parts = [f"{sum(row['holds'] for row in members)} of {len(members)}" for members in (rows, near)]
    return f"{parts[0]}; where {LEAVING:.0%} of the executions and more leave the box, {parts[1]}"


if __name__ == "__main__":
    main()

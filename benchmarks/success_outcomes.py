"""Trials that only succeed or fail: the true probability of what is recommended, calibration, and the time of an ask.

`python -m benchmarks.success_outcomes --rows FILE [--seeds 20] [--trials 40] [--problems rkhs,gm,nes-polynomial]
[--methods success,beta,values,tpe,random]`. A row is written for each run: what is stopped goes on where it was.

A function of a shipped problem, standardized over its box, becomes a probability, p(x) = Phi(2.5 z(x)). Methods:
success (`outcome="success"`), beta (the same with `surrogate="beta_process"`), values (a Gaussian process with inferred
noise told zeros and ones), tpe (Optuna's, which recommends its first success), random (random inputs, recommended by
the success model).
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from scipy.special import ndtr

import surehold as sh
from surehold.problems.named import named_function

BUDGETS = (20, 40, 80)


def probability_of(name):
    """Return the box of a problem and p: (q, d) -> (q,)."""
    problem = named_function(name)
    box = problem.box
    points = box.from_unit(np.random.default_rng(0).random((4096, box.dimension)))
    values = np.array([problem(x) for x in points])
    return box, lambda x: float(ndtr(2.5 * (problem(x) - values.mean()) / values.std()))


def surehold_run(method, box, p, seed, budgets):
    """Return the probability at the recommended input after each budget, and (predicted, happened) of each ask."""
    settings = {"outcome": "success"} if method != "values" else {"noise": "inferred"}
    settings |= {"surrogate": "beta_process"} if method == "beta" else {}
    optimizer, rng, found, calibration = sh.Optimizer(box, seed=seed, **settings), np.random.default_rng(seed), [], []
    for t in range(budgets[-1]):
        x = box.from_unit(rng.random(box.dimension)) if method == "random" else optimizer.ask()
        happened = bool(rng.random() < p(x))
        if method in ("success", "beta") and t >= optimizer.n_initial:
            calibration.append((float(optimizer.predict(x[None])[0][0]), happened))
        if method == "values":
            optimizer.tell(x, float(happened))
        else:
            optimizer.tell(x, success=happened)
        if t + 1 in budgets:
            found.append(p(optimizer.recommend().x))
    return found, calibration


def tpe_run(box, p, seed, budgets):
    """Return the probability at the recommended input after each budget."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    rng, found = np.random.default_rng(seed), []
    study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=seed))
    for t in range(budgets[-1]):
        trial = study.ask()
        x = np.array([trial.suggest_float(n, a, b) for n, a, b in zip(box.names, box.lower, box.upper, strict=True)])
        study.tell(trial, float(rng.random() < p(x)))
        if t + 1 in budgets:
            found.append(p(np.array([study.best_params[n] for n in box.names])))
    return found


def ask_seconds(method, n, d=3):
    """Return CPU seconds of one ask with n trials, learning included, of "success", "beta" or "plain" (of values)."""
    X = np.random.default_rng(0).random((n, d))
    box = sh.Box({f"x{i}": (0.0, 1.0) for i in range(d)})
    z = 1.0 - 4.0 * ((X - 0.5) ** 2).sum(axis=1)
    settings = {} if method == "plain" else {"outcome": "success"}
    settings |= {"surrogate": "beta_process"} if method == "beta" else {}
    y = z if method == "plain" else (np.random.default_rng(1).random(n) < ndtr(2.0 * z)).astype(float)
    taken = []
    for seed in range(6 if n <= 100 else 3):  # the first compiles
        optimizer = sh.Optimizer(box, seed=seed, **settings)
        optimizer.restore(X, y)
        started = time.process_time()
        optimizer.ask()
        taken.append(time.process_time() - started)
    return np.median(taken[1:])


def main():
    """Print all tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, default=None, help="file of finished runs; made or continued")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--no-time", action="store_true", help="leave the time of an ask out")
    parser.add_argument("--sizes", default="100", help="numbers of trials of which the time of an ask is measured")
    parser.add_argument("--methods", default="success,beta,values,tpe,random")
    parser.add_argument("--problems", default="rkhs,gm,nes-polynomial")
    arguments = parser.parse_args()
    if arguments.problems and arguments.rows is None:
        parser.error("give --rows FILE for the runs")
    methods = arguments.methods.split(",")
    for n in () if arguments.no_time else map(int, arguments.sizes.split(",")):
        for method in [m for m in (*methods, "plain") if m in ("success", "beta", "plain")]:
            print(f"ask at n = {n}, d = 3: {method} {ask_seconds(method, n):.3f} s CPU", flush=True)
    budgets = tuple(b for b in BUDGETS if b <= arguments.trials)
    rows = stored(arguments.rows)
    problems = list(filter(None, arguments.problems.split(",")))
    for name in problems:
        box, p = probability_of(name)
        for seed in range(arguments.seeds):
            for method in methods:
                if (name, seed, method) in rows:
                    continue
                if method == "tpe":
                    found, calibration = tpe_run(box, p, seed, budgets), []
                else:
                    found, calibration = surehold_run(method, box, p, seed, budgets)
                asked = [[round(predicted, 4), int(happened)] for predicted, happened in calibration]
                row = {"problem": name, "seed": seed, "method": method, "found": found, "asked": asked}
                rows[name, seed, method] = row
                with arguments.rows.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    for name in problems:
        table_of(name, [row for row in rows.values() if row["problem"] == name], budgets)
    calibration_of(rows.values())


def stored(path):
    """Return the rows of a file by problem, seed and method."""
    rows = map(json.loads, path.read_text().splitlines() if path is not None and path.exists() else ())
    return {(row["problem"], row["seed"], row["method"]): row for row in rows}


def table_of(name, rows, budgets):
    """Print what each method recommends, and what "success" recommends less that, paired by seed."""
    found = {}
    for row in rows:
        found.setdefault(row["method"], {})[row["seed"]] = row["found"]
    for method, mine in found.items():
        seeds = sorted(set(mine) & set(found.get("success", mine)))
        table = np.array([mine[seed] for seed in seeds])
        less = np.array([found["success"][seed] for seed in seeds]) - table if "success" in found else 0.0 * table
        both = f"{cells(table)}   success less this: {cells(less)}"
        print(f"{name:16s} {method:8s} after {budgets}: {both}  ({len(seeds)} seeds)")


def cells(table):
    error = table.std(axis=0, ddof=1) / np.sqrt(len(table))
    return "  ".join(f"{m:+.3f} ({e:.3f})" for m, e in zip(table.mean(axis=0), error, strict=True))


def calibration_of(rows):
    """Print predicted and happened shares of the trials after the initial design, by tenths of the prediction.

    Rows that are kept in the repository have what was found only.
    """
    pairs = {}
    for row in rows:
        pairs.setdefault(row["method"], []).extend(row.get("asked", []))
    for method, told in pairs.items():
        predicted, happened = np.array(told, dtype=float).reshape(-1, 2).T
        for k in range(10):
            inside = (predicted >= k / 10) & (predicted < (k + 1) / 10)
            if inside.sum() > 1:
                means = f"predicted {predicted[inside].mean():.3f}: happened {happened[inside].mean():.3f}"
                print(f"{method:8s} {means} of {inside.sum()}")


if __name__ == "__main__":
    main()

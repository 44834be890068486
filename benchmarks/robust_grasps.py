"""What grasps are worth when the hand strays: `python -m benchmarks.robust_grasps --rows grasps.jsonl --seeds 10`.

Mug and bottle, in the two position offsets (100 trials, 40 of them initial) and in all seven variables (150 trials, 30
of them initial), with input noise of 3 % of the box in every variable. Trials reach what is commanded and give the
default quality. Plain optimization answers with its highest observed trial, the others with their recommendation; every
answer is queried 1,000 times more and rated by epsilon, the same perturbations for all of them, and none of these is
part of the budget. Every finished run is a line of the rows' file: a benchmark that is stopped goes on where it was
(give another file for another program).

"guess" and "BO, guess" are told, besides, what is known of good grasps before any trial (`GraspProblem.guess`: the palm
square to the object at the default standoff and posture), which two of three initial trials keep.

Printed are means over seeds with standard errors: of the re-queries' mean, lowest value, standard deviation and the
mean of their worst tenth; the difference of the means from "robust", paired on common seeds; and CPU seconds a run.

With `--trace` the three lowest runs of "robust" on each problem are made again. Printed are the answer's mean, that of
the best trial (of the fifteen highest, and of the fifteen that the model believes best), and what the model says at the
answer of the best run: the truth, by how many standard deviations the model lies below it, and how far the nearest
trial is away, in box widths, as the largest difference in one variable.

With `--reference` it is also printed what can be found without a model and without counting trials: the best 300 of
16,384 places are executed 30 times with the noise, and random steps that become smaller climb from the best twelve.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from surehold.campaigns.single_run import versions

NOISE = sh.InputNoise.unit(0.03)
SEVEN = ("dx", "dy", "dz", "rx", "ry", "rz", "s1")
PROBLEMS = {
    "mug 2-D": ("mug", ("dx", "dy"), 100, 40),
    "bottle 2-D": ("bottle", ("dx", "dy"), 100, 40),
    "mug 7-D": ("mug", SEVEN, 150, 30),
    "bottle 7-D": ("bottle", SEVEN, 150, 30),
}
METHODS = {
    "robust": {"input_noise": NOISE},
    "guess": {"input_noise": NOISE, "guess": True},
    "BO": {},
    "BO, guess": {"guess": True},
    "UEI, thesis": {"input_noise": NOISE, "criterion": "uei", "preset": "thesis-grasp"},
    "UEI": {"input_noise": NOISE, "criterion": "uei"},
    "cvar": {"input_noise": NOISE, "risk": "cvar"},
}
REQUERIES = 1000
TAIL = 0.1
PLACES, EXECUTED, CLIMBS, STEPS = 2**14, 300, 12, 200
SCORES = ("mean", "worst", "std", "tenth")


def searched(problem, n_trials, n_initial, seed, settings):
    """Return the optimizer after all trials."""
    settings = settings | ({"guess": problem.guess} if settings.get("guess") else {})
    optimizer = sh.Optimizer(problem.box, n_initial=n_initial, seed=seed, **settings)
    for _ in range(n_trials):
        x = optimizer.ask()
        optimizer.tell(x, problem(x))
    return optimizer


def run(problem, rated, n_trials, n_initial, seed, settings):
    """Return the row of one run: the answer (d,) and what its re-queries of `rated` gave."""
    started = time.process_time()
    optimizer = searched(problem, n_trials, n_initial, seed, settings)
    x = optimizer.recommend().x if "input_noise" in settings else optimizer.X[int(np.argmax(optimizer.y))]
    seconds = time.process_time() - started
    score = sh.problems.robust_score(rated, x, NOISE, n=REQUERIES, seed=12345)
    if score.n_failed:
        raise RuntimeError(f"{score.n_failed} re-queries of {x.tolist()} failed")
    return {
        "x": x.tolist(),
        "observed": float(optimizer.y.max()),
        "mean": score.mean,
        "worst": score.worst,
        "std": score.std,
        "tenth": float(np.sort(score.values)[: round(TAIL * REQUERIES)].mean()),
        "cpu": seconds,
    }


def finished(path):
    """Return the rows of a file by (problem, method, seed)."""
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [json.loads(line) for line in lines]
    return {(row["problem"], row["method"], row["seed"]): row for row in rows}


def summary(values):
    error = np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    return f"{np.mean(values):.4f} ({error:.4f})"


def report(rows, problems, methods):
    sources = {row["source"] for row in rows.values()}
    if len(sources) > 1:
        print(f"These rows come from {len(sources)} states of the program: {', '.join(sorted(sources))}")
    head = "".join(f"{name:>17}" for name in ("mean", "worst of 1,000", "std", "worst tenth", "minus robust"))
    print(f"{'problem':11} {'method':12} seeds {head}  CPU s")
    for name in problems:
        for method in methods:
            own = {seed: row for (p, m, seed), row in rows.items() if (p, m) == (name, method)}
            if not own:
                continue
            pairs = [seed for seed in own if (name, "robust", seed) in rows]
            gaps = [own[seed]["mean"] - rows[name, "robust", seed]["mean"] for seed in pairs]
            cells = [summary([row[score] for row in own.values()]) for score in SCORES]
            cells.append(summary(gaps) if gaps and method != "robust" else "")
            seconds = np.mean([row["cpu"] for row in own.values()])
            print(f"{name:11} {method:12} {len(own):5d} {''.join(f'{cell:>17}' for cell in cells)}  {seconds:5.1f}")


def trace(problem, rated, n_trials, n_initial, rows):
    """Print why the three lowest of the rows (those of "robust" on a problem) are low."""

    def worth(of, x):
        return sh.problems.robust_score(of, x, NOISE, n=300, seed=7).mean

    low, high = sorted(rows, key=lambda row: row["mean"])[:3], max(rows, key=lambda row: row["mean"])
    best = np.array(high["x"])
    truth = worth(problem, best)
    for row in low:
        optimizer = searched(problem, n_trials, n_initial, row["seed"], METHODS["robust"])
        believed = optimizer.predict(optimizer.X, under_noise=True)[0]
        tops = {*np.argsort(-optimizer.y)[:15].tolist(), *np.argsort(-believed)[:15].tolist()}
        tried = max(worth(rated, optimizer.X[i]) for i in tops)
        mean, std = optimizer.predict(best[None], under_noise=True)
        gaps = np.abs(problem.box.to_unit(optimizer.X) - problem.box.to_unit(best)).max(axis=1)
        print(
            f"seed {row['seed']}: answer {row['mean']:.3f}, best trial {tried:.3f}; at the answer of seed "
            f"{high['seed']} {truth:.3f}, {(truth - mean[0]) / std[0]:.1f} deviations above the model, nearest trial "
            f"{gaps.min():.2f} away",
            flush=True,
        )


def reference(rated):
    """Return the highest mean of 1,000 executions that is found: a lower bound of what there is."""
    box, d = rated.box, rated.box.dimension

    def worth(u, n):
        return sh.problems.robust_score(rated, box.from_unit(u), NOISE, n=n, seed=1).mean

    places = qmc.Sobol(d, rng=0).random(PLACES)
    places = places[np.argsort(-rated(box.from_unit(places)))[:EXECUTED]]
    starts = places[np.argsort([-worth(u, 30) for u in places])[:CLIMBS]]
    rng, found = np.random.default_rng(0), []
    for u in starts:
        best = worth(u, 100)
        for step in range(STEPS):
            tried = np.clip(u + 0.1 * 0.98**step * rng.standard_normal(d), 0.0, 1.0)
            if (value := worth(tried, 100)) > best:
                u, best = tried, value
        found.append(sh.problems.robust_score(rated, box.from_unit(u), NOISE, n=REQUERIES, seed=12345).mean)
    return max(found)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=Path, required=True, help="file of finished runs; made or continued")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--problems", nargs="+", default=list(PROBLEMS), choices=list(PROBLEMS))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--reference", action="store_true", help="search without a model as well: minutes")
    parser.add_argument("--trace", action="store_true", help="say why the lowest runs are low")
    arguments = parser.parse_args()
    rows, source = finished(arguments.rows), versions()["source"]
    built = {}
    for name in arguments.problems:
        obj, variables, *_ = PROBLEMS[name]
        told, rated = (sh.problems.GraspProblem(obj, variables=variables, quality=q) for q in ("", "epsilon"))
        built[name] = told, rated
    for seed in range(arguments.seeds):
        for name, (problem, rated) in built.items():
            for method in arguments.methods:
                if (name, method, seed) in rows:
                    continue
                with threadpool_limits(1):
                    made = run(problem, rated, *PROBLEMS[name][2:], seed, METHODS[method])
                row = {"problem": name, "method": method, "seed": seed, **made, "source": source}
                rows[name, method, seed] = row
                with arguments.rows.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    report(rows, arguments.problems, arguments.methods)
    for name in arguments.problems if arguments.reference else ():
        print(f"{name}: {reference(built[name][1]):.4f} is found without a model", flush=True)
    for name in arguments.problems if arguments.trace else ():
        print(name)
        with threadpool_limits(1):
            trace(
                *built[name],
                *PROBLEMS[name][2:],
                [row for (p, m, _), row in rows.items() if (p, m) == (name, "robust")],
            )


if __name__ == "__main__":
    main()

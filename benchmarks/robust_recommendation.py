"""What the recommended input is worth under input noise: `python -m benchmarks.robust_recommendation [part ...]`.

Parts: `thesis` (RKHS and GM with the thesis' settings, 30 seeds), `gm` (GM with the defaults, plain against robust, 20
seeds), `mug` (the default grasp problem, plain against robust, 10 seeds). Plain optimization answers with its highest
observed trial, robust optimization with its recommendation. Means over seeds with standard errors; differences are
paired on common seeds. The functions' values under noise are closed-form; the grasps' are means of 1,000 re-queries
that are no part of the budget, the same perturbations for all answers.
"""

import time

import numpy as np

import surehold as sh
from benchmarks.arguments import chosen


def summary(values):
    values = np.asarray(values)
    return f"{values.mean():.5f} ({values.std(ddof=1) / np.sqrt(len(values)):.5f})"


def run(problem, n_trials, n_initial, seed, noise, **settings):
    started = time.process_time()
    result = sh.maximize(problem, problem.box, n_trials, n_initial=n_initial, seed=seed, input_noise=noise, **settings)
    return result, time.process_time() - started


def thesis(seeds=30):
    for name, preset, n, initial, sigma in (
        ("rkhs", "thesis-rkhs", 50, 5, 0.01),
        ("gm", "thesis-gm-noise", 120, 30, 0.1),
    ):
        problem = sh.problems.synthetic_function(name)
        noise = sh.InputNoise.unit(sigma)
        rows = {"BO": [], "UBO": []}
        seconds = {"BO": [], "UBO": []}
        for seed in range(seeds):
            for method in rows:
                result, cpu = run(problem, n, initial, seed, noise if method == "UBO" else None, preset=preset)
                x = result.recommendation.x if method == "UBO" else result.X[result.best_index]
                score = sh.problems.robust_score(problem, x, noise, n=100, seed=seed)
                rows[method].append((problem.expectation(x, noise), score.worst, score.std))
                seconds[method].append(cpu)
        for method, values in rows.items():
            mean, worst, std = np.array(values).T
            print(
                f"{preset:16} {n} trials {seeds} seeds {method:4} mean {summary(mean)}  worst of 100 {summary(worst)}  "
                f"std of 100 {summary(std)}  CPU s a run {np.mean(seconds[method]):.2f}",
                flush=True,
            )
        difference = np.array(rows["UBO"])[:, 0] - np.array(rows["BO"])[:, 0]
        print(f"{preset:16} UBO - BO, paired: {summary(difference)}", flush=True)


def gm(seeds=20):
    problem, noise = sh.problems.synthetic_function("gm"), sh.InputNoise.unit(0.1)
    plain, robust, peak = [], [], []
    for seed in range(seeds):
        result, _ = run(problem, 140, 30, seed, None)
        peak.append(result.y.max())
        plain.append(problem.expectation(result.X[result.best_index], noise))
        result, _ = run(problem, 140, 30, seed, noise)
        robust.append(problem.expectation(result.recommendation.x, noise))
    print(f"GM, defaults, 140 trials, {seeds} seeds: plain BO observes {summary(peak)}, worth {summary(plain)}")
    print(f"  recommended: worth {summary(robust)}, lowest {min(robust):.5f}; best possible 0.09693", flush=True)


def mug(seeds=10):
    problem, noise = sh.problems.GraspProblem("mug"), sh.InputNoise.unit(0.03)
    rows = []
    for seed in range(seeds):
        plain, _ = run(problem, 100, 40, seed, None)
        robust, _ = run(problem, 100, 40, seed, noise)
        scores = [
            sh.problems.robust_score(problem, x, noise, n=1000, seed=12345)
            for x in (plain.X[plain.best_index], robust.recommendation.x)
        ]
        rows.append([value for score in scores for value in (score.mean, score.worst, score.std)])
    table = np.array(rows)
    print(f"mug, defaults, 100 trials, {seeds} seeds, 1,000 re-queries each")
    for label, column in (("best observed of plain BO", 0), ("recommended", 3)):
        parts = [f"{name} {summary(table[:, column + i])}" for i, name in enumerate(("mean", "worst", "std"))]
        print(f"  {label:26} {'  '.join(parts)}")
    print(f"  recommended - plain, paired: {summary(table[:, 3] - table[:, 0])}", flush=True)


if __name__ == "__main__":
    parts = {"thesis": thesis, "gm": gm, "mug": mug}
    for part in chosen(__doc__, parts, name="part"):
        parts[part]()

"""How well the model knows a grasp: `python -m benchmarks.model_error --objects mug bottle --seeds 0 1 2`.

The trials are those of `surehold grasp OBJECT` with its defaults (two variables, input noise 0.03, 40 initial of 100
trials); every surrogate learns from the same ones, with what it has by default. Judged are its predictions at 512
uniformly drawn poses that were not tried: root mean square error in standard deviations of the true values there (a
constant, their mean, has 1), the share of true values inside the model's 95 % intervals (mean +- 1.96 standard
deviations), and the mean log density (a constant with the right variance has -1.42, after scaling the truth to
deviation 1). The last lines are the summary by surrogate over objects and seeds.
"""

import argparse
from collections import defaultdict

import numpy as np
from joblib import Parallel, delayed

import surehold as sh

OBJECTS = ("mug", "bottle", "glass", "drill")
SURROGATES = ("gp", "two_scales", "tgp", "local_global")
POSES = 512


def trials_of(obj, seed, n_trials=100, n_initial=40):
    """Return the problem and an optimizer that has made the trials of `surehold grasp`."""
    problem = sh.problems.GraspProblem(obj)
    noise = sh.InputNoise.unit(0.03)
    result = sh.maximize(problem, problem.box, n_trials, n_initial=n_initial, seed=seed, input_noise=noise)
    return problem, result.optimizer


def fresh(problem, seed):
    """Return poses (512, 2) in the box's units, and their qualities (512,)."""
    u = np.random.default_rng([seed, 96]).random((POSES, problem.box.dimension))
    x = problem.box.from_unit(u)
    return x, np.asarray(problem(x))


def judged(mean, std, truth):
    """Return the error in deviations of the truth, the coverage of 95 % intervals and the mean log density."""
    scale = truth.std()
    error = np.sqrt(np.mean((mean - truth) ** 2)) / scale
    covered = np.mean(np.abs(mean - truth) <= 1.959964 * std)
    s = np.maximum(std / scale, 1e-6)
    density = np.mean(-0.5 * ((mean - truth) / scale / s) ** 2 - np.log(s) - 0.5 * np.log(2.0 * np.pi))
    return float(error), float(covered), float(density)


def run(obj, seed, surrogates):
    """Return {surrogate: (error, coverage, log density)} after the trials of one run."""
    problem, optimizer = trials_of(obj, seed)
    x, truth = fresh(problem, seed)
    found = {}
    for name in surrogates:
        model = sh.Optimizer(problem.box, input_noise=optimizer.input_noise, surrogate=name, seed=seed)
        model.restore(optimizer.X, optimizer.y)
        found[name] = judged(*model.predict(x), truth)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", nargs="+", default=list(OBJECTS), choices=OBJECTS)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(10)))
    parser.add_argument("--surrogates", nargs="+", default=["two_scales", "gp", "tgp"], choices=SURROGATES)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    cases = [(obj, seed) for obj in arguments.objects for seed in arguments.seeds]
    print(f"{'object':8} {'seed':>4} {'surrogate':13} {'error':>7} {'covers':>7} {'log density':>12}")
    done = Parallel(n_jobs=arguments.processes, return_as="generator")(
        delayed(run)(obj, seed, arguments.surrogates) for obj, seed in cases
    )
    every = defaultdict(list)
    for (obj, seed), found in zip(cases, done, strict=True):
        for name, (error, covered, density) in found.items():
            every[name].append((error, covered, density))
            print(f"{obj:8} {seed:4d} {name:13} {error:7.3f} {covered:7.3f} {density:12.2f}", flush=True)
    for name, rows in every.items():
        error, covered, density = np.array(rows).T
        print(
            f"{name}: error median {np.median(error):.3f}, largest {error.max():.3f}; 95 % intervals cover "
            f"{covered.min():.3f} to {covered.max():.3f}, mean {covered.mean():.3f}; log density {density.mean():.2f}; "
            f"{len(rows)} runs"
        )


if __name__ == "__main__":
    main()

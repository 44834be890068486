"""Changes of the search that are no part of it, beside it: `python -m benchmarks.search_variants --count 40`.

On the training set of `benchmarks.generated_family`, in three to six variables, noise that varies left out; the same
initial designs for all.

    default    as it is
    exploit    every third trial goes where the outcome under the noise is believed best, unless it has been tried
    tree       every other trial is chosen by a tree that is told the same trials; three answers: that of the default,
               that of the model with the smaller left-out error, and the trial that is best by the mean of both

Printed are the mean final regret [%] with its standard error, its paired difference from the default, and how many runs
come within 1 % that did not before, and the other way round. For `--spread SEED ...` hyperparameters are learnt from
trials at least so far apart, after a run of the default: by how many standard deviations the model, which predicts
from all trials, is too low at the best place.
"""

import argparse
import sys

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.generated_family import chosen_seeds
from benchmarks.generated_landscapes import BUDGETS, TRAINING, landscape
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.optimization.surrogates.named import surrogate_named
from surehold.optimization.surrogates.protocol import mixture

CLASSES = ("3-4 variables", "5-6 variables", "isotropic", "anisotropic", "correlated", "uniform")
APART = (0.0, 0.1, 0.15, 0.2)  # in sqrt(d) box widths
TRIED = 1e-3  # box widths times sqrt(d), within which a place has been tried


def begun(seed, *surrogates):
    """Return the landscape of a seed, the rest of its initial design, and optimizers that know of the noise."""
    problem = landscape(seed)
    d = problem.dimension
    n_initial = min(sh.Optimizer.default_n_initial(problem.box), BUDGETS[d] // 2)
    design = qmc.LatinHypercube(d, rng=np.random.default_rng([seed, 0, 98])).random(n_initial)
    settings = {"n_initial": n_initial, "seed": 0, "input_noise": problem.noise}
    return problem, list(design), [sh.Optimizer(problem.box, surrogate=name, **settings) for name in surrogates]


def made(problem, design, optimizers, exploit=False):
    """Return the inputs (n, d) of all trials, told to all optimizers, which ask in turns."""
    X = np.empty((0, problem.dimension))
    for i in range(BUDGETS[problem.dimension]):
        asking = optimizers[i % len(optimizers)]
        x = design.pop(0) if design else asking.ask()
        if exploit and i % 3 == 1 and len(asking.pending):
            best = asking.recommend("box").x
            if np.linalg.norm(X - best, axis=1).min() > TRIED * np.sqrt(len(best)):
                asking.forget(x)
                x = best
        x = np.clip(x, 0.0, 1.0)
        X = np.vstack([X, x])
        for optimizer in optimizers:
            optimizer.tell(x, problem(x))
    return X


def regret(problem, x):
    best = problem.best()
    return 100.0 * float(best.value - problem.expectation(np.atleast_2d(x))[0]) / best.scale


def compared(seed):
    """Return {variant: final regret [%]}."""
    problem, design, optimizers = begun(seed, "two_scales")
    made(problem, design, optimizers)
    found = {"default": optimizers[0].recommend().x}
    problem, design, optimizers = begun(seed, "two_scales")
    made(problem, design, optimizers, exploit=True)
    found["exploit"] = optimizers[0].recommend().x
    problem, design, optimizers = begun(seed, "two_scales", "tgp")
    X = made(problem, design, optimizers)
    answers = [optimizer.recommend().x for optimizer in optimizers]
    errors = [optimizer.diagnosis().error for optimizer in optimizers]
    believed = np.mean([optimizer.predict(X, under_noise=True)[0] for optimizer in optimizers], axis=0)
    found |= {
        "tree, default's": answers[0],
        "tree, left out": answers[int(np.argmin(errors))],
        "tree, mean": X[np.argmax(believed)],
    }
    return {name: regret(problem, x) for name, x in found.items()}


def spread(X, least):
    """Return the rows of X (n, d), in their order, that are at least so far from all chosen before."""
    rows = []
    for i, x in enumerate(X):
        if not rows or np.linalg.norm(X[rows] - x, axis=1).min() >= least:
            rows.append(i)
    return rows


def missed(seed):
    """Print how far below the truth at the best place a model is that has learnt from spread trials."""
    problem, design, optimizers = begun(seed, "two_scales")
    X = made(problem, design, optimizers)
    y, best = problem(X), problem.best().x[None]
    for apart in APART:
        rows = spread(X, apart * np.sqrt(problem.dimension))
        process = surrogate_named("two_scales", input_deviations=np.zeros(problem.dimension))
        learnt = process.condition_on_all(X[rows], y[rows], np.random.default_rng(0))
        every = learnt.evidence._replace(
            X=X, y=learnt.outputs.apply(y), noise=np.zeros(len(y)), offsets=np.array([0, len(y)])
        )
        known = GaussianProcessPosterior(every, learnt.hyperparameters.theta, learnt.outputs, 0)
        mean, variance = mixture(known.moments(best))
        short = float(problem(best)[0] - mean[0])
        told = f"{len(rows)} of {len(X)} trials at least {apart} apart"
        print(f"seed {seed}: {told}: {short:.2f}, {short / variance[0] ** 0.5:.1f} deviations")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40, help="problems")
    parser.add_argument("--spread", type=int, nargs="+", default=[], help="seeds; nothing else is run then")
    arguments = parser.parse_args()
    with threadpool_limits(1):
        for seed in arguments.spread:
            missed(seed)
        if arguments.spread:
            return
        rows = []
        for seed in chosen_seeds(TRAINING, 0, arguments.count, CLASSES):
            rows.append(compared(seed))
            print(f"{seed}: " + ", ".join(f"{name} {value:.2f}" for name, value in rows[-1].items()), file=sys.stderr)
    first = np.array([row["default"] for row in rows])
    for name in rows[0]:
        mine = np.array([row[name] for row in rows])
        (mean, error), (gap, of_gap) = ((v.mean(), v.std(ddof=1) / np.sqrt(len(v))) for v in (mine, mine - first))
        won, lost = np.sum((mine <= 1.0) & (first > 1.0)), np.sum((mine > 1.0) & (first <= 1.0))
        print(f"{name:16} {mean:6.2f} ({error:.2f})  {gap:+6.2f} ({of_gap:.2f})  won {won}, lost {lost}")


if __name__ == "__main__":
    main()

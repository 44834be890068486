"""Trials asked for four at a time: what should the model believe of those under way? `python -m benchmarks.batches`.

Every batch is asked for before any of its trials is told. Compared, on common seeds and the thesis' budgets:
    one by one           no batches: what parallel trials cost
    believed             the mean is taken for granted, the incumbent rises to it (what surehold does)
    variance only        the mean is taken for granted, the incumbent stays
    drawn                each particle takes a draw of its own for granted, the incumbent rises to it
    penalty              nothing is taken for granted; improvement fades out around trials under way, over a tenth of a
                         length-scale (in the manner of Gonzalez et al. 2016)
Printed are mean and standard error of the best value, its paired difference from "believed", the median number of
trials to come within 1 % of the maximum, and the smallest distance between two trials of a batch.
"""

import argparse
from contextlib import ExitStack
from unittest.mock import patch

import numpy as np
from scipy.spatial.distance import pdist
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.best_observed import BUDGETS, problem_named, share_reached
from surehold.optimization.acquisition.scales import Acquisition
from surehold.optimization.strategy.ranking import Ranking
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior

BATCH = 4


def no_rise(self, posterior, pending, scale):
    return -np.inf


def drawn(self, X):
    believed = self.sample(X[None], np.random.default_rng(len(X)).standard_normal((1, len(X))))[:, 0, 0]
    extended = self.with_pending_mean(X)
    return GaussianProcessPosterior(
        extended.evidence,
        extended.hyperparameters.theta,
        extended.outputs,
        0,
        np.concatenate([self._Y, self.outputs.apply(believed)], axis=1),
    )


def kept(self, X):
    self.under_way = X
    return self


def fading(self, U, gradient):
    value, slope = self.evaluate_without_penalty(U, gradient)
    X = getattr(self._posterior, "under_way", None)
    if X is None or len(X) == 0:
        return value, slope
    scale = 0.1 * np.median(self._posterior.length_scales, axis=0)
    steps = (U[:, None, :] - X) / scale
    near = np.minimum(np.exp(-0.5 * np.square(steps).sum(axis=2)), 1.0 - 1e-12)  # (q, p)
    change = ((near / (1.0 - near))[:, :, None] * steps / scale).sum(axis=1)
    return value + np.log1p(-near).sum(axis=1), slope + change if gradient else slope


def patches(method):
    process = GaussianProcessPosterior
    if method == "variance only":
        return [patch.object(Ranking, "believed", no_rise)]
    if method == "drawn":
        own = process.with_pending
        return [
            patch.object(process, "with_pending_mean", own, create=True),
            patch.object(process, "with_pending", drawn),
        ]
    if method == "penalty":
        own = Acquisition._evaluate
        return [
            patch.object(process, "with_pending", kept),
            patch.object(Ranking, "believed", no_rise),
            patch.object(Acquisition, "evaluate_without_penalty", own, create=True),
            patch.object(Acquisition, "_evaluate", fading),
        ]
    return []


METHODS = ("believed", "variance only", "drawn", "penalty", "one by one")


def run(problem, method, initial, budget, seed):
    """Return the values (budget,) and the smallest distance between two trials of a batch."""
    design = qmc.LatinHypercube(problem.box.dimension, rng=np.random.default_rng([seed, 99])).random(initial)
    optimizer = sh.Optimizer(sh.Box.unit(problem.box.dimension), n_initial=initial, seed=seed)
    values = [float(problem(problem.box.from_unit(u))) for u in design]
    for u, value in zip(design, values, strict=True):
        optimizer.tell(u, value)
    size = 1 if method == "one by one" else BATCH
    nearest = np.inf
    while len(values) < budget:
        batch = optimizer.ask(min(size, budget - len(values)))
        if len(batch) > 1:
            nearest = min(nearest, pdist(batch).min())
        for u in batch:
            values.append(float(problem(problem.box.from_unit(u))))
            optimizer.tell(u, values[-1])
    return np.array(values), nearest


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--problems", nargs="+", default=["rkhs", "gf", "gm"], choices=list(BUDGETS))
    arguments = parser.parse_args()
    print(f"{arguments.seeds} seeds, batches of {BATCH}")
    for name in arguments.problems:
        problem, (initial, budget) = problem_named(name), BUDGETS[name]
        reference = None
        for method in METHODS:
            with ExitStack() as stack, threadpool_limits(1):
                for change in patches(method):
                    stack.enter_context(change)
                runs = [run(problem, method, initial, budget, seed) for seed in range(arguments.seeds)]
            values = np.array([r[0] for r in runs])
            best = values.max(axis=1)
            reference = best if reference is None else reference
            difference = best - reference
            root = np.sqrt(len(best))
            target = problem.optimum.value - 0.01 * abs(problem.optimum.value)
            print(
                f"{name:6} {method:15} {best.mean():9.5f} ({best.std(ddof=1) / root:.5f})  "
                f"{difference.mean():+9.5f} ({difference.std(ddof=1) / root:.5f})  to 1 %: "
                f"{share_reached(values, target, 0.5):>4} {share_reached(values, target, 0.9):>4}  "
                f"nearest {min(r[1] for r in runs):.1e}",
                flush=True,
            )


if __name__ == "__main__":
    main()

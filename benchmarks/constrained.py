"""Optimization under outcome constraints: regret of the best truly feasible answer, and infeasible answers.

    python -m benchmarks.constrained --seeds 10 [--methods surehold optuna botorch] [--problems gramacy ...]

Problems, all minimized, each with constraints c(x) <= 0:
    gardner-1, gardner-2   Gardner et al. 2014, simulations 1 and 2 (one feasible island; a tiny feasible region)
    gramacy                Gramacy et al. 2016, the toy problem with two constraints
    vessel                 pressure vessel design, Coello and Montes 2002, with continuous variables: three constraints,
                           the fourth (length at most 240) is the box's
Optima are found here by SLSQP from many starts, on the function itself.

Every method is told the same and answers once: surehold by `recommend`, Optuna 5 (TPE with `constraints_func`) by its
best feasible trial, BoTorch (log EI with constraints, `SingleTaskGP` on standardized values, the same initial design as
surehold) by its best feasible trial. Where nothing feasible was tried, the answer is the trial that misses least, and
counts as infeasible. Regret is that of feasible answers, as a share of the objective's range over the box (mean of 4096
quasi-random points to the optimum).
"""

import argparse
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import surehold as sh

Point = NDArray[np.float64]


class Problem(NamedTuple):
    """A function to minimize and what has to stay at or below 0."""

    box: sh.Box
    f: Callable[[Point], float]
    constraints: tuple[Callable[[Point], float], ...]
    trials: int


def _vessel() -> Problem:
    def cost(x: Point) -> float:
        shell, head, radius, length = x
        return float(
            0.6224 * shell * radius * length
            + 1.7781 * head * radius**2
            + 3.1661 * shell**2 * length
            + 19.84 * shell**2 * radius
        )

    box = sh.Box(
        {"shell": (0.0625, 6.1875), "head": (0.0625, 6.1875), "radius": (10.0, 200.0), "length": (10.0, 240.0)}
    )
    return Problem(
        box,
        cost,
        (
            lambda x: float(0.0193 * x[2] - x[0]),
            lambda x: float(0.00954 * x[2] - x[1]),
            lambda x: float(1296000.0 - np.pi * x[2] ** 2 * x[3] - 4.0 / 3.0 * np.pi * x[2] ** 3) / 1e6,
        ),
        80,
    )


PROBLEMS: dict[str, Callable[[], Problem]] = {
    "gardner-1": lambda: Problem(
        sh.Box({"x": (0.0, 6.0), "y": (0.0, 6.0)}),
        lambda x: float(np.cos(2.0 * x[0]) * np.cos(x[1]) + np.sin(x[0])),
        (lambda x: float(np.cos(x[0]) * np.cos(x[1]) - np.sin(x[0]) * np.sin(x[1]) - 0.5),),
        40,
    ),
    "gardner-2": lambda: Problem(
        sh.Box({"x": (0.0, 6.0), "y": (0.0, 6.0)}),
        lambda x: float(np.sin(x[0]) + x[1]),
        (lambda x: float(np.sin(x[0]) * np.sin(x[1]) + 0.95),),
        40,
    ),
    "gramacy": lambda: Problem(
        sh.Box({"x": (0.0, 1.0), "y": (0.0, 1.0)}),
        lambda x: float(x[0] + x[1]),
        (
            lambda x: float(1.5 - x[0] - 2.0 * x[1] - 0.5 * np.sin(2.0 * np.pi * (x[0] ** 2 - 2.0 * x[1]))),
            lambda x: float(x[0] ** 2 + x[1] ** 2 - 1.5),
        ),
        40,
    ),
    "vessel": _vessel,
}


class Trial(NamedTuple):
    """What one trial told."""

    x: Point
    y: float
    c: Point


def evaluate(problem: Problem, x: Point) -> Trial:
    return Trial(np.asarray(x), problem.f(x), np.array([c(x) for c in problem.constraints]))


def optimum(problem: Problem) -> tuple[float, float]:
    """Return the least feasible value, and the objective's range by which regrets are divided."""
    from scipy.optimize import minimize
    from scipy.stats import qmc

    box = problem.box
    starts = box.from_unit(qmc.Sobol(box.dimension, rng=0).random(4096))
    values = np.array([problem.f(x) for x in starts])
    missed = np.array([max(c(x) for c in problem.constraints) for x in starts])
    best = np.inf
    order = [*np.argsort(np.where(missed <= 0.0, values, np.inf))[:40], *np.argsort(missed)[:20]]
    limits = [{"type": "ineq", "fun": (lambda u, c=c: -c(box.from_unit(u)))} for c in problem.constraints]
    scale = float(np.abs(values).mean())
    for x in starts[order]:
        found = minimize(
            lambda u: problem.f(box.from_unit(u)) / scale,
            box.to_unit(x),
            method="SLSQP",
            bounds=[(0.0, 1.0)] * box.dimension,
            constraints=limits,
            options={"maxiter": 200, "ftol": 1e-12},
        )
        at = evaluate(problem, box.from_unit(np.clip(found.x, 0.0, 1.0)))
        if at.c.max() <= 1e-6 and at.y < best:
            best = at.y
    return best, float(values.mean()) - best


def best_trial(trials: list[Trial]) -> Trial:
    feasible = [trial for trial in trials if trial.c.max() <= 0.0]
    return min(feasible, key=lambda trial: trial.y) if feasible else min(trials, key=lambda trial: trial.c.max())


def surehold(problem: Problem, seed: int, **settings: Any) -> Trial:
    names = [f"c{i}" for i in range(len(problem.constraints))]
    optimizer = sh.Optimizer(
        problem.box, direction="minimize", constraints=dict.fromkeys(names, (None, 0.0)), seed=seed, **settings
    )
    for _ in range(problem.trials):
        trial = evaluate(problem, optimizer.ask())
        optimizer.tell(trial.x, trial.y, constraints=dict(zip(names, trial.c.tolist(), strict=True)))
    return evaluate(problem, optimizer.recommend().x)


def penalty(problem: Problem, seed: int) -> Trial:
    """What a user does without constraints: an infeasible trial counts as failed."""
    optimizer = sh.Optimizer(problem.box, direction="minimize", seed=seed)
    trials = []
    for _ in range(problem.trials):
        trial = evaluate(problem, optimizer.ask())
        trials.append(trial)
        bad = trial.c.max() > 0.0
        optimizer.tell(trial.x, None if bad else trial.y, failed=bad)
    return best_trial(trials)


def optuna(problem: Problem, seed: int) -> Trial:
    import optuna as library

    library.logging.set_verbosity(library.logging.ERROR)
    import warnings

    warnings.simplefilter("ignore")
    sampler = library.samplers.TPESampler(seed=seed, constraints_func=lambda trial: trial.user_attrs["c"])
    study = library.create_study(direction="minimize", sampler=sampler)
    trials = []

    def objective(trial: Any) -> float:
        box = problem.box
        x = [trial.suggest_float(n, lo, up) for n, lo, up in zip(box.names, box.lower, box.upper, strict=True)]
        told = evaluate(problem, np.array(x))
        trials.append(told)
        trial.set_user_attr("c", told.c.tolist())
        return told.y

    study.optimize(objective, n_trials=problem.trials)
    return best_trial(trials)


def botorch(problem: Problem, seed: int) -> Trial:
    import warnings

    import torch
    from botorch.acquisition.analytic import LogConstrainedExpectedImprovement
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import ModelListGP, SingleTaskGP
    from botorch.models.transforms import Standardize
    from botorch.optim import optimize_acqf
    from gpytorch.mlls import SumMarginalLogLikelihood

    warnings.simplefilter("ignore")
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    box, d = problem.box, problem.box.dimension
    design = sh.Optimizer(box, seed=seed)
    trials = [evaluate(problem, design.ask()) for _ in range(design.n_initial)]
    bounds = torch.stack([torch.zeros(d), torch.ones(d)]).double()
    while len(trials) < problem.trials:
        X = torch.tensor(np.array([box.to_unit(t.x) for t in trials]))
        outputs = np.array([[-t.y, *t.c] for t in trials])
        noise = torch.full((len(trials), 1), 1e-8).double()
        models = []
        for column in outputs.T:
            Y = torch.tensor(column[:, None])
            models.append(SingleTaskGP(X, Y, noise * Y.var(), outcome_transform=Standardize(1)))
        model = ModelListGP(*models)
        fit_gpytorch_mll(SumMarginalLogLikelihood(model.likelihood, model))
        feasible = [-t.y for t in trials if t.c.max() <= 0.0]
        acquisition = LogConstrainedExpectedImprovement(
            model,
            best_f=max(feasible) if feasible else float(outputs[:, 0].min()),
            objective_index=0,
            constraints={i + 1: (None, 0.0) for i in range(len(problem.constraints))},
        )
        x, _ = optimize_acqf(acquisition, bounds, q=1, num_restarts=6, raw_samples=256)
        trials.append(evaluate(problem, box.from_unit(np.clip(x.detach().numpy()[0], 0.0, 1.0))))
    return best_trial(trials)


METHODS: dict[str, Callable[[Problem, int], Trial]] = {
    "surehold": surehold,
    "failed": penalty,
    "optuna": optuna,
    "botorch": botorch,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=[*METHODS])
    parser.add_argument("--problems", nargs="+", choices=PROBLEMS, default=[*PROBLEMS])
    arguments = parser.parse_args()
    print(f"{'problem':10} {'method':9} infeasible  regret: median  mean +- s.e.      largest   s/run")
    for name in arguments.problems:
        problem = PROBLEMS[name]()
        best, width = optimum(problem)
        for method in arguments.methods:
            started = time.perf_counter()
            seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
            answers = [METHODS[method](problem, seed) for seed in seeds]
            seconds = (time.perf_counter() - started) / len(answers)
            regrets = np.array([(t.y - best) / width for t in answers if t.c.max() <= 1e-9])
            infeasible = len(answers) - len(regrets)
            if len(regrets) == 0:
                regrets = np.array([np.nan])
            error = regrets.std(ddof=1) / len(regrets) ** 0.5 if len(regrets) > 1 else np.nan
            print(
                f"{name:10} {method:9} {infeasible:3d}/{len(answers):<3d}     {np.median(regrets):9.2e}  "
                f"{regrets.mean():.2e} +- {error:.1e}  {regrets.max():.2e}  {seconds:6.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()

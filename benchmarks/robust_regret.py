"""Robust regret beside other methods: `python -m benchmarks.robust_regret --problems needle-2 many --seeds 10`.

The robust value of an answer is g(x) = E f(x + noise), known in closed form (a coordinate that would leave the box
keeps its noise-free value); the robust regret is what it lacks to the best one. Every method gets the same initial
design, seed by seed; its answer is looked at after every fifth trial. Printed are mean and standard error of the final
regret, in per cent of the best value, its paired difference from the first method, the number of trials from which the
regret stays below 1 % (median and 90th percentile; "-" where that share of the runs never does), how often one run
proposed one point, the share of trials in the corners (5 % of every side), and CPU seconds a run.
"""

import argparse
import time

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from surehold.campaigns.peers import installed_peers
from surehold.optimization.strategy import expected_improvement
from surehold.problems.named import robust_problem
from surehold.problems.robust import ROBUST, RobustProblem

THESIS = ("rkhs 0.01", "rkhs 0.02", "gm 0.1", "gm 0.05", "gm 0.02", "gm 0.01")
BUDGETS = {1: 50, 2: 60, 3: 80, 5: 120, 7: 150}
EVERY = 5
METHODS = {
    "default": {},
    "BO, best observed": None,
    "UEI, thesis": {"criterion": "uei", "preset": "thesis"},
    "UEI": {"criterion": "uei"},
    "robust EI": {"criterion": "robust_ei"},
    "robust UCB": {"criterion": "robust_ucb"},
    "robust PI": {"criterion": "robust_pi"},
    "robust Thompson": {"criterion": "robust_thompson"},
    "default, keep": {"border": "keep"},
    "no where to look": {},
    "tgp": {"surrogate": "tgp"},
    "tgp, UEI": {"surrogate": "tgp", "criterion": "uei"},
    "local-global": {"surrogate": "local_global"},
    "gp": {"surrogate": "gp"},
    "local-global, UEI": {"surrogate": "local_global", "criterion": "uei"},
    "local-global Thompson": {"surrogate": "local_global", "criterion": "robust_thompson"},
    "cvar": {"risk": "cvar"},
    "mean-std": {"risk": "mean-std"},
}


def problem_named(name):
    """Return a problem of the harder family, or a function of the thesis and its noise: "rkhs 0.01", "gm 0.1"."""
    if name in ROBUST:
        return robust_problem(name)
    function, deviation = name.split()
    return RobustProblem(sh.problems.synthetic_function(function), sh.InputNoise.unit(float(deviation)))


class Ours:
    """surehold with some settings; its answer is the recommendation."""

    def __init__(self, problem, initial, seed, settings):
        noise = {} if settings is None else {"input_noise": problem.noise}
        spread = problem.observation_noise or "none"
        own = {"noise": spread} if spread != "none" and "preset" not in (settings or {}) else {}
        self.optimizer = sh.Optimizer(
            problem.function.box, n_initial=len(initial), seed=seed, **noise, **own, **(settings or {})
        )
        self._initial = list(problem.function.box.from_unit(initial))

    def ask(self):
        return self._initial.pop(0) if self._initial else self.optimizer.ask()

    def tell(self, x, y):
        self.optimizer.tell(x, y)

    def answer(self, X, y):
        return self.optimizer.recommend().x


class Peer:
    """Another library; its answer is the best observed trial, or its own."""

    def __init__(self, problem, initial, seed, maker):
        self._box = problem.function.box
        self._peer = maker(self._box.dimension, initial, seed)

    def ask(self):
        return self._box.from_unit(np.clip(self._peer.ask(), 0.0, 1.0))

    def tell(self, x, y):
        self._peer.tell(self._box.to_unit(x), y)

    def answer(self, X, y):
        return X[int(np.argmax(y))]


def run(problem, method, budget, seed):
    """Return answers (budget / EVERY, d) and trials (budget, d)."""
    function = problem.function
    d = function.box.dimension
    initial = qmc.LatinHypercube(d, rng=np.random.default_rng([seed, 98])).random(5 * d)
    peers = installed_peers()
    optimizer = (
        Peer(problem, initial, seed, peers[method])
        if method in peers
        else Ours(problem, initial, seed, METHODS[method])
    )
    rng = np.random.default_rng([seed, 97])
    X, y, answers = [], [], []
    for i in range(budget):
        X.append(np.clip(optimizer.ask(), function.box.lower, function.box.upper))
        y.append(float(function(X[-1])) + problem.observation_noise * rng.standard_normal())
        optimizer.tell(X[-1], y[-1])
        if (i + 1) % EVERY == 0:
            observed = METHODS.get(method, {}) is None
            answers.append(X[int(np.argmax(y))] if observed else optimizer.answer(X, y))
    return np.array(answers), function.box.to_unit(np.array(X))


def trials_to(regret, target, quantile):
    """Return the trials from which `quantile` of the runs (seeds, looks) stay below the target."""
    below = regret <= target
    stays = np.flip(np.minimum.accumulate(np.flip(below, axis=1), axis=1), axis=1)
    first = np.where(stays.any(axis=1), EVERY * (stays.argmax(axis=1) + 1), np.inf)
    count = np.sort(first)[int(np.ceil(quantile * len(first))) - 1]
    return f"{count:.0f}" if np.isfinite(count) else "-"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--problems", nargs="+", default=[*THESIS, *ROBUST])
    parser.add_argument("--methods", nargs="+", default=[*METHODS, *installed_peers()])
    arguments = parser.parse_args()
    print(f"{arguments.seeds} seeds; regret in % of the best robust value")
    print(
        f"{'problem':15} {'method':22} {'regret':>17} {'minus the first':>19} {'to 1 %':>7} {'90 %':>5} {'same':>5} "
        "corners CPU s"
    )
    for name in arguments.problems:
        problem = problem_named(name)
        best = sh.problems.robust_optimum(problem.function, problem.noise).value
        reference = None
        for method in arguments.methods:
            start = time.process_time()
            own = expected_improvement.where_to_look
            if method == "no where to look":
                expected_improvement.where_to_look = lambda posterior, u, *perturbations: u[None, :]
            with threadpool_limits(1):
                runs = [
                    run(problem, method, BUDGETS[problem.function.box.dimension], seed)
                    for seed in range(arguments.seeds)
                ]
            expected_improvement.where_to_look = own
            seconds = (time.process_time() - start) / arguments.seeds
            values = np.array([np.asarray(problem.function.expectation(answers, problem.noise)) for answers, _ in runs])
            regret = 100.0 * (best - values) / best
            last = regret[:, -1]
            reference = last if reference is None else reference
            difference, root = last - reference, np.sqrt(len(last))
            same = max(np.unique(np.round(X, 6), axis=0, return_counts=True)[1].max() for _, X in runs)
            corners = np.mean([np.all((X < 0.05) | (X > 0.95), axis=1).mean() for _, X in runs])
            print(
                f"{name:15} {method:22} {last.mean():8.3f} ({last.std(ddof=1) / root:6.3f}) "
                f"{difference.mean():+9.3f} ({difference.std(ddof=1) / root:6.3f}) {trials_to(regret, 1.0, 0.5):>7} "
                f"{trials_to(regret, 1.0, 0.9):>5} {same:5d} {corners:7.2f} {seconds:5.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()

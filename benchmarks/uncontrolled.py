"""Uncontrolled variables: regret of the answer, averaged over them, against Monte Carlo truth.

    python -m benchmarks.uncontrolled --seeds 10

Problems, both minimized
    branin-1     Branin on [-5, 10] x [0, 15], after Williams, Santner and Notz 2000: its first input is uniform; 30
                 trials
    branin-2     its second input is uniform. As it is a square in that one, the best setting is that of the mean
    hartmann-6   Hartmann's function of six; inputs 5 and 6 are normal around 0.5 with deviation 0.2, cut to [0, 1]; 80
Methods
    commanded    a simulator: the trial says at which condition
    measured     a robot: conditions are drawn, and told
    fixed        what one does without: conditions are kept at their mean while exploring
    averaged     plain optimization of 4 draws at a time averaged, a quarter of the commands
Truth: 2**13 quasi-random conditions. Regret is divided by the range from the mean over the box to the optimum of the
averaged function, which SciPy finds (DIRECT, then Nelder and Mead).
"""

import argparse
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats
from scipy.stats import qmc

import surehold as sh

Array = NDArray[np.float64]

_A = np.array(
    [[10, 3, 17, 3.5, 1.7, 8], [0.05, 10, 17, 0.1, 8, 14], [3, 3.5, 1.7, 10, 17, 8], [17, 8, 0.05, 10, 0.1, 14]]
)
_P = 1e-4 * np.array(
    [
        [1312, 1696, 5569, 124, 8283, 5886],
        [2329, 4135, 8307, 3736, 1004, 9991],
        [2348, 1451, 3522, 2883, 3047, 6650],
        [4047, 8828, 8732, 5743, 1091, 381],
    ]
)


def branin(x: Array) -> Array:
    a, b = x[..., 0], x[..., 1]
    curve = b - 5.1 / (4.0 * np.pi**2) * a * a + 5.0 / np.pi * a - 6.0
    return curve**2 + 10.0 * (1.0 - 1.0 / (8.0 * np.pi)) * np.cos(a) + 10.0


def hartmann(x: Array) -> Array:
    inner = np.einsum("kj,...kj->...k", _A, (x[..., None, :] - _P) ** 2)
    return -np.exp(-inner) @ np.array([1.0, 1.2, 3.0, 3.2])


class Problem(NamedTuple):
    f: Callable[[Array], Array]
    bounds: dict[str, tuple[float, float]]
    uncontrolled: dict[str, object]
    trials: int


_NORMAL = stats.truncnorm(-2.5, 2.5, 0.5, 0.2)
PROBLEMS = {
    "branin-1": Problem(
        lambda x: branin(x[..., ::-1]), {"b": (0.0, 15.0), "a": (-5.0, 10.0)}, {"a": stats.uniform(-5.0, 15.0)}, 30
    ),
    "branin-2": Problem(branin, {"a": (-5.0, 10.0), "b": (0.0, 15.0)}, {"b": stats.uniform(0.0, 15.0)}, 30),
    "hartmann-6": Problem(hartmann, {f"x{i}": (0.0, 1.0) for i in range(1, 7)}, {"x5": _NORMAL, "x6": _NORMAL}, 80),
}


class Truth:
    """The function averaged over its conditions."""

    def __init__(self, problem: Problem):
        self.problem = problem
        levels = qmc.Sobol(len(problem.uncontrolled), rng=0).random_base2(13)
        self.w = np.stack([d.ppf(u) for d, u in zip(problem.uncontrolled.values(), levels.T, strict=True)], axis=1)
        free = [bounds for name, bounds in problem.bounds.items() if name not in problem.uncontrolled]
        self.lower, self.upper = np.array(free).T
        mean = np.mean(
            [self(x, 64) for x in qmc.scale(qmc.Sobol(len(free), rng=1).random(512), self.lower, self.upper)]
        )
        found = optimize.direct(lambda x: self(x, 256), list(map(tuple, free)), maxfun=4000)
        found = optimize.minimize(self, found.x, method="Nelder-Mead", bounds=free, options={"xatol": 1e-6})
        self.best, self.width = float(found.fun), float(mean - found.fun)

    def __call__(self, x: Array, n: int | None = None) -> float:
        w = self.w[:n]
        return float(self.problem.f(np.concatenate([np.tile(x, (len(w), 1)), w], axis=1)).mean())


def run(problem: Problem, method: str, seed: int) -> Array:
    """Return the controlled part of the answer."""
    c = len(problem.bounds) - len(problem.uncontrolled)
    rng = np.random.default_rng([seed, 7])
    distributions = list(problem.uncontrolled.values())

    def draw() -> Array:
        return np.array([d.rvs(random_state=rng) for d in distributions])

    if method in ("fixed", "averaged"):
        box = sh.Box({name: bounds for name, bounds in problem.bounds.items() if name not in problem.uncontrolled})
        noise = "inferred" if method == "averaged" else None
        optimizer = sh.Optimizer(box, direction="minimize", seed=seed, noise=noise)
        for _ in range(problem.trials // (4 if method == "averaged" else 1)):
            x = optimizer.ask()
            at = [[d.mean() for d in distributions]] if method == "fixed" else [draw() for _ in range(4)]
            optimizer.tell(x, float(np.mean([problem.f(np.append(x, w)) for w in at])))
        return optimizer.recommend().x
    box = sh.Box(problem.bounds, uncontrolled=problem.uncontrolled)
    optimizer = sh.Optimizer(box, direction="minimize", seed=seed, conditions=method)
    for _ in range(problem.trials):
        x = optimizer.ask()
        if method == "measured":
            actual = np.append(x[:c], draw())
            optimizer.tell(x, float(problem.f(actual)), reached=actual)
        else:
            optimizer.tell(x, float(problem.f(x)))
    return optimizer.recommend().x[:c]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--problems", nargs="+", choices=PROBLEMS, default=[*PROBLEMS])
    arguments = parser.parse_args()
    print(f"{'problem':11} {'method':10} regret: median  mean +- s.e.        largest")
    for name in arguments.problems:
        truth = Truth(PROBLEMS[name])
        for method in ("commanded", "measured", "fixed", "averaged"):
            seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
            answers = [run(truth.problem, method, seed) for seed in seeds]
            regrets = (np.array([truth(x) for x in answers]) - truth.best) / truth.width
            error = regrets.std(ddof=1) / len(regrets) ** 0.5
            print(
                f"{name:11} {method:10} {np.median(regrets):14.2e}  {regrets.mean():.2e} +- {error:.1e}"
                f"  {regrets.max():.2e}",
                flush=True,
            )


if __name__ == "__main__":
    main()

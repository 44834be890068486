"""What a guess of some variables gains and costs: `python -m benchmarks.guess --count 60 --rows FILE`.

Landscapes of training seeds (`benchmarks.generated_landscapes`) in four and more variables, one run each with every
guess; half of the variables, drawn by the seed, are guessed:

    none      no guess
    near      the best place's values, strayed by a standard deviation of .1 box widths
    anywhere  values drawn from the whole box: a guess that is wrong

Printed are the mean regret [%] at half and at full budget with its standard error over landscapes, the share within
1 %, and the paired difference from the runs without a guess.
"""

import argparse
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.generated_landscapes import BUDGETS, landscape
from benchmarks.kept_runs import keep, kept
from benchmarks.search_variants import regret

GUESSES = ("none", "near", "anywhere")
LEAST_VARIABLES = 4
STRAYED = 0.1


def guessed(problem, kind, seed):
    """Return the guess {name: value} of a kind; None without one."""
    rng = np.random.default_rng([seed, 41])
    d = problem.dimension
    chosen = np.sort(rng.permutation(d)[: d // 2])
    near = np.clip(problem.best().x[chosen] + STRAYED * rng.standard_normal(len(chosen)), 0.0, 1.0)
    values = {"none": None, "near": near, "anywhere": rng.random(len(chosen))}[kind]
    return None if values is None else {problem.box.names[i]: value for i, value in zip(chosen, values, strict=True)}


def regrets(problem, kind, seed):
    """Return the regret [%] of the recommendation after half and after all of the trials."""
    guess, budget = guessed(problem, kind, seed), BUDGETS[problem.dimension]
    optimizer = sh.Optimizer(problem.box, input_noise=problem.noise, guess=guess, seed=seed)
    found = []
    for number in range(1, budget + 1):
        x = optimizer.ask()
        optimizer.tell(x, problem(x))
        if number in (budget // 2, budget):
            found.append(regret(problem, optimizer.recommend().x))
    return found


def with_error(values):
    return f"{np.mean(values):7.2f} ({np.std(values, ddof=1) / np.sqrt(len(values)):.2f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=700, help="first training seed")
    parser.add_argument("--count", type=int, default=60, help="seeds, those of fewer variables included")
    parser.add_argument("--rows", type=Path, help="file of finished runs; made or continued")
    arguments = parser.parse_args()
    made, found = kept(arguments.rows), {kind: [] for kind in GUESSES}
    for seed in range(arguments.first, arguments.first + arguments.count):
        problem = landscape(seed)
        if problem.dimension < LEAST_VARIABLES:
            continue
        for kind in GUESSES:
            if (seed, kind) not in made:
                with threadpool_limits(1):
                    made[seed, kind] = regrets(problem, kind, seed)
                keep(arguments.rows, (seed, kind), made[seed, kind])
            found[kind].append(made[seed, kind])
    print(f"{len(found['none'])} landscapes, seeds {arguments.first} to {arguments.first + arguments.count - 1}")
    print(f"{'guess':10} {'half':>15} {'full':>15} {'within 1 %':>12} {'minus none, half':>18} {'full':>15}")
    without = np.array(found["none"])
    for kind, rows in found.items():
        values = np.array(rows)
        gaps = ["" if kind == "none" else with_error(gap) for gap in (values - without).T]
        half, full = map(with_error, values.T)
        print(f"{kind:10} {half:>15} {full:>15} {np.mean(values[:, 1] < 1.0):12.0%} {gaps[0]:>18} {gaps[1]:>15}")


if __name__ == "__main__":
    main()

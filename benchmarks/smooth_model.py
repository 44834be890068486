"""What the smooth one of the default's three models gains: `python -m benchmarks.smooth_model landscapes`.

    landscapes  training seeds of `benchmarks.generated_landscapes`, one to eight variables, all kinds of noise; final
                regret [%] of all, by number of variables and by shape. `--rows FILE` keeps the runs, and those that it
                holds are not made again; with `--count 0` all of them are printed
    robust      functions of `benchmarks.robust_regret` (`--names`), seeds 200 to 229; final regret [%]
    smooth      functions of `benchmarks.smooth_regret` (`--names`) without noise, seeds 10 to 29; logarithms of the
                regret at half and full budget
    time        no search: CPU milliseconds of an ask with its learning, after 50 and 140 trials in two variables and
                150 in seven, with input noise and without; medians of 9, the two in turns

Of each problem a run of the default, and one whose model has no particles of the squared-exponential process, with the
same initial design. Printed are means with standard errors, the paired difference and, of regrets in per cent, runs
within 1 %, the difference of the logarithm (base 10; regrets below 0.01 % count as that), and how many runs come within
1 % with the smooth model that do not without it, and the other way round.
"""

import argparse
import json
import time
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

import numpy as np
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks import robust_regret, smooth_regret
from benchmarks.generated_landscapes import BUDGETS, SHAPES, TRAINING, landscape
from benchmarks.search_variants import begun, regret
from surehold.optimization.surrogates.gaussian_process import hyperparameters
from surehold.optimization.surrogates.gaussian_process.kernels import kernel_number

VARIANTS = ("without", "default")
GROUPS = {"all": (1, 8), "1-3 variables": (1, 3), "4-6 variables": (4, 6), "7-8 variables": (7, 8)}
LEAST = 0.01
SMOOTH = kernel_number("squared_exponential")
#: subject -> (first seed, number of seeds)
SEEDS = {"landscapes": (330, 117), "robust": (200, 30), "smooth": (10, 20), "time": (0, 9)}
NAMES = {
    "robust": ["needle-3", "many", "gm 0.02", "gm 0.01", "ridge"],
    "smooth": [name for name in smooth_regret.FUNCTIONS if not name.endswith("-wide")],
}


@contextmanager
def searching(variant):
    """Run the body with the default's model as it is or, for "without", without learning the smooth process at all."""
    learns, weighs = hyperparameters.mode, hyperparameters.log_evidence_and_root

    def mode(evidence):
        return (evidence.prior_mean, 0) if evidence.kernel == SMOOTH else learns(evidence)

    def log_evidence_and_root(evidence, center):
        return (np.nan, np.eye(center.size)) if evidence.kernel == SMOOTH else weighs(evidence, center)

    if variant == "default":
        yield
    else:
        with mock.patch.multiple(hyperparameters, mode=mode, log_evidence_and_root=log_evidence_and_root):
            yield


def on_landscape(seed):
    """Return the final regret [%] on the landscape of a seed."""
    problem, design, (optimizer,) = begun(seed, "two_scales")
    for _ in range(BUDGETS[problem.dimension]):
        x = np.clip(design.pop(0) if design else optimizer.ask(), 0.0, 1.0)
        optimizer.tell(x, problem(x))
    return regret(problem, optimizer.recommend().x)


def on_robust(name, seed):
    """Return the final robust regret [%] of a function of `benchmarks.robust_regret`."""
    problem = robust_regret.problem_named(name)
    best = sh.problems.robust_optimum(problem.function, problem.noise).value
    answers, _ = robust_regret.run(problem, "default", robust_regret.BUDGETS[problem.function.box.dimension], seed)
    return 100.0 * float(best - problem.function.expectation(np.asarray(answers)[-1:], problem.noise)[0]) / best


def ask_seconds(n, d, noise, seed):
    """Return CPU seconds of an ask after n trials in d variables."""
    rng = np.random.default_rng([seed, n, d])
    optimizer = sh.Optimizer(sh.Box.unit(d), n_initial=1, seed=seed, input_noise=noise)
    for x in rng.random((n, d)):
        optimizer.tell(x, float(np.sin(6.0 * x[0]) + x.sum() ** 2))
    started = time.process_time()
    optimizer.ask()
    return time.process_time() - started


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("subject", choices=list(SEEDS))
    parser.add_argument("--first", type=int, help="first seed, or its number in the set")
    parser.add_argument("--count", type=int, help="seeds")
    parser.add_argument("--names", nargs="+", help="functions, of robust and smooth")
    parser.add_argument("--rows", type=Path, help="file of the runs on landscapes, a line each")
    arguments = parser.parse_args()
    subject = arguments.subject
    first, count = (
        usual if given is None else given
        for usual, given in zip(SEEDS[subject], (arguments.first, arguments.count), strict=True)
    )
    with threadpool_limits(1):
        if subject == "time":
            _print_times(range(first, first + count))
        elif subject == "landscapes":
            _print_landscapes(TRAINING[first : first + count], arguments.rows)
        else:
            for name in arguments.names or NAMES[subject]:
                _print_function(subject, name, range(first, first + count))


def _print_times(seeds):
    for n, d in ((50, 2), (140, 2), (150, 7)):
        for noise, title in ((None, "without noise"), (sh.InputNoise.unit(0.03), "under noise")):
            taken = {variant: [] for variant in VARIANTS}
            for seed in (0, *seeds):  # the first one compiles
                for variant in VARIANTS:
                    with searching(variant):
                        taken[variant].append(ask_seconds(n, d, noise, seed))
            before, now = (1000.0 * np.median(taken[variant][1:]) for variant in VARIANTS)
            print(f"({n}, {d}) {title:13}  without {before:.1f} ms, with {now:.1f} ms, {now / before:.2f} times")


def _print_landscapes(seeds, file):
    known = {}
    if file is not None and file.exists():
        known = {(seed, variant): found for seed, variant, found in map(json.loads, file.open())}
    for seed in seeds:
        for variant in VARIANTS:
            if (seed, variant) not in known:
                with searching(variant):
                    known[seed, variant] = on_landscape(seed)
                if file is not None:
                    with file.open("a") as kept:
                        print(json.dumps([seed, variant, known[seed, variant]]), file=kept)
    for name, members in _groups(seeds or sorted({seed for seed, _ in known})).items():
        if len(members) > 1:
            _print_regrets(name, *(np.array([known[seed, variant] for seed in members]) for variant in VARIANTS))


def _print_function(subject, name, seeds):
    found = []
    for variant in VARIANTS:
        with searching(variant):
            if subject == "robust":
                found.append(np.array([on_robust(name, seed) for seed in seeds]))
            else:
                found.append(np.array([smooth_regret.run(name, "default", seed)[:2] for seed in seeds]))
    if subject == "robust":
        _print_regrets(name, *found)
        return
    for budget, before, now in zip(("half", "full"), found[0].T, found[1].T, strict=True):
        print(f"{name:18} {budget}  without {_told(before)}; with {_told(now)}; difference {_told(now - before)}")


def _groups(seeds):
    """Return the seeds of each group."""
    drawn = {seed: landscape(seed) for seed in seeds}
    groups = {name: [s for s in seeds if low <= drawn[s].dimension <= high] for name, (low, high) in GROUPS.items()}
    return groups | {shape: [s for s in seeds if drawn[s].shape == shape] for shape in SHAPES}


def _print_regrets(name, before, now):
    logarithm = np.log10(np.maximum(now, LEAST) / np.maximum(before, LEAST))
    found, once = now <= 1.0, before <= 1.0
    print(
        f"{name:14} {len(now):4}  without {_told(before)}, {once.sum()} within 1 %; with {_told(now)}, {found.sum()};"
        f" difference {_told(now - before)}, of logarithms {_told(logarithm)};"
        f" won {np.sum(found & ~once)}, lost {np.sum(once & ~found)}",
        flush=True,
    )


def _told(values):
    return f"{values.mean():+.3f} ({values.std(ddof=1) / len(values) ** 0.5:.3f})"


if __name__ == "__main__":
    main()

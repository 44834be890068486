"""What one of the default's parts gains: `python -m benchmarks.default_parts landscapes --without sums`.

    landscapes  training seeds of `benchmarks.generated_landscapes`, one to eight variables, all kinds of noise; final
                regret [%] of all, by number of variables and by shape. `--rows FILE` keeps the runs, and those that it
                holds are not made again; with `--count 0` all of them are printed
    separable   seeds of `benchmarks.separable_functions`, four to eight variables, with noise or none; regret [%] at
                half and full budget, `--rows` likewise. `--variables 2 3` draws functions of as many, and leaves out
                landscapes of more or fewer
    robust      functions of `benchmarks.robust_regret` (`--names`), seeds 200 to 229; final regret [%]
    smooth      functions of `benchmarks.smooth_regret` (`--names`) without noise, seeds 10 to 29; logarithms of the
                regret at half and full budget
    time        no search: CPU milliseconds of an ask with its learning, and of the next one without, after 50 and 140
                trials in two variables and 150 in seven, of a sum and of what is none, with input noise and without;
                medians of 9, the two in turns

Of each problem a run of the default, and one without the part that is named: the model `smooth`, a squared-exponential
process, or `sums` of processes of one variable, whose particles it then lacks, the `odds` against the smooth model, the
`least` length-scale of it, or in the search the `exchange` of single variables; with the same initial design. Printed
are means with standard errors, the paired difference and, of regrets in per cent, runs within 1 %, the difference of
the logarithm (base 10; regrets below 0.01 % count as that), and how many runs come within 1 % with the part that do not
without it, and the other way round.
"""

import argparse
import time
from contextlib import contextmanager, nullcontext
from functools import partial
from itertools import product
from pathlib import Path
from unittest import mock

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks import robust_regret, smooth_regret
from benchmarks.generated_landscapes import BUDGETS, SHAPES, landscape
from benchmarks.kept_runs import keep, kept
from benchmarks.search_variants import begun, regret
from benchmarks.separable_functions import separable
from surehold.optimization.maximizer import multistart
from surehold.optimization.surrogates.gaussian_process import hyperparameters
from surehold.optimization.surrogates.gaussian_process.kernels import kernel_number

VARIANTS = ("without", "default")
GROUPS = {"all": (1, 8), "1-3 variables": (1, 3), "4-6 variables": (4, 6), "7-8 variables": (7, 8)}
LEAST = 0.01
SMOOTH = kernel_number("squared_exponential")
#: subject -> (first seed, number of seeds)
SEEDS = {"landscapes": (330, 117), "separable": (30, 60), "robust": (200, 30), "smooth": (10, 20), "time": (0, 9)}
NAMES = {
    "robust": ["needle-3", "many", "gm 0.02", "gm 0.01", "ridge"],
    "smooth": [name for name in smooth_regret.FUNCTIONS if not name.endswith("-wide")],
}
#: what an ask is timed on
TIMED = {
    "sum": lambda x: np.cos(8.0 * x).sum() + x.sum(),
    "no sum": lambda x: np.sin(6.0 * x[0]) + x.sum() ** 2,
}
SEPARABLE = {
    "all": lambda problem: True,
    "sums": lambda problem: problem.form == "sum",
    "products": lambda problem: problem.form == "product",
    "exact": lambda problem: problem.noise is None,
    "under noise": lambda problem: problem.noise is not None,
}


@contextmanager
def searching(variant, part):
    """Run the body with the default as it is or, for "without", without the part that is named."""
    learns, weighs = hyperparameters.mode, hyperparameters.log_evidence_and_root

    def mode(evidence):
        return (evidence.prior_mean, 0) if evidence.kernel == SMOOTH else learns(evidence)

    def log_evidence_and_root(evidence, center):
        return (np.nan, np.eye(center.size)) if evidence.kernel == SMOOTH else weighs(evidence, center)

    absent = {
        "smooth": mock.patch.multiple(hyperparameters, mode=mode, log_evidence_and_root=log_evidence_and_root),
        "sums": mock.patch.object(hyperparameters, "ADDITIVE_UP_TO", 0),
        "odds": mock.patch.object(hyperparameters, "SMOOTH_ODDS", 0.0),
        "least": mock.patch.object(hyperparameters, "SMOOTH_LEAST", 1e-300),
        "exchange": mock.patch.object(multistart, "FEW_VARIABLES", np.inf),
    }
    with absent[part] if variant == "without" else nullcontext():
        yield


def on_landscape(seed):
    """Return the final regret [%] on the landscape of a seed."""
    problem, design, (optimizer,) = begun(seed, "two_scales")
    for _ in range(BUDGETS[problem.dimension]):
        x = np.clip(design.pop(0) if design else optimizer.ask(), 0.0, 1.0)
        optimizer.tell(x, problem(x))
    return regret(problem, optimizer.recommend().x)


def on_separable(seed, variables):
    """Return the regrets [%] at half and full budget on the function of a seed, of that many variables."""
    problem = separable(seed, *variables)
    n_initial = sh.Optimizer.default_n_initial(problem.box)
    design = qmc.LatinHypercube(problem.dimension, rng=np.random.default_rng([seed, 0, 98])).random(n_initial)
    optimizer = sh.Optimizer(problem.box, n_initial=n_initial, seed=0, input_noise=problem.noise)
    answers = []
    for i in range(problem.budget):
        x = np.clip(design[i] if i < n_initial else optimizer.ask(), 0.0, 1.0)
        optimizer.tell(x, problem(x))
        if i + 1 in (problem.budget // 2, problem.budget):
            answers.append(optimizer.recommend().x)
    best, scale = problem.best()
    return (100.0 * (best - problem.expectation(np.array(answers))) / scale).tolist()


def on_robust(name, seed):
    """Return the final robust regret [%] of a function of `benchmarks.robust_regret`."""
    problem = robust_regret.problem_named(name)
    best = sh.problems.robust_optimum(problem.function, problem.noise).value
    answers, _ = robust_regret.run(problem, "default", robust_regret.BUDGETS[problem.function.box.dimension], seed)
    return 100.0 * float(best - problem.function.expectation(np.asarray(answers)[-1:], problem.noise)[0]) / best


def ask_seconds(function, n, d, noise, seed):
    """Return CPU seconds of an ask after n trials in d variables, and of the next one, which learns nothing anew."""
    rng = np.random.default_rng([seed, n, d])
    optimizer = sh.Optimizer(sh.Box.unit(d), n_initial=1, seed=seed, input_noise=noise)
    for x in rng.random((n, d)):
        optimizer.tell(x, float(function(x)))
    times = []
    for _ in range(2):
        started = time.process_time()
        x = optimizer.ask()
        times.append(time.process_time() - started)
        optimizer.tell(x, float(function(x)))
    return times


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("subject", choices=list(SEEDS))
    parts = ("smooth", "sums", "odds", "least", "exchange")
    parser.add_argument("--without", choices=parts, default="sums", help="what the one run lacks")
    parser.add_argument("--first", type=int, help="first seed, or its number in the set")
    parser.add_argument("--count", type=int, help="seeds")
    parser.add_argument(
        "--variables", type=int, nargs=2, metavar=("FEWEST", "MOST"), help="of landscapes or separable functions"
    )
    parser.add_argument("--names", nargs="+", help="functions, of robust and smooth")
    parser.add_argument("--rows", type=Path, help="file of the runs on landscapes or separable functions, a line each")
    arguments = parser.parse_args()
    subject, part = arguments.subject, arguments.without
    first, count = (
        usual if given is None else given
        for usual, given in zip(SEEDS[subject], (arguments.first, arguments.count), strict=True)
    )
    seeds = range(first, first + count)
    with threadpool_limits(1):
        if subject == "time":
            _print_times(part, seeds)
        elif subject == "landscapes":
            low, high = arguments.variables or GROUPS["all"]
            drawn = [seed for seed in seeds if low <= landscape(seed).dimension <= high]
            found = _kept(on_landscape, part, drawn, arguments.rows)
            for name, members in _groups(sorted(found)).items():
                if len(members) > 1:
                    _print_regrets(name, *np.array([found[seed] for seed in members]).T)
        elif subject == "separable":
            variables = arguments.variables or (4, 8)
            found = _kept(partial(on_separable, variables=variables), part, seeds, arguments.rows)
            for name, chosen in SEPARABLE.items():
                members = [seed for seed in sorted(found) if chosen(separable(seed, *variables))]
                pairs = np.array([found[seed] for seed in members])  # (n, 2, 2)
                if len(members) > 1:
                    _print_regrets(f"{name}, half", *pairs[:, :, 0].T)
                    _print_regrets(f"{name}, full", *pairs[:, :, 1].T)
        else:
            for name in arguments.names or NAMES[subject]:
                _print_function(subject, part, name, seeds)


def _print_times(part, seeds):
    noises = ((None, "without noise"), (sh.InputNoise.unit(0.03), "under noise"))
    for (kind, function), (n, d), (noise, title) in product(TIMED.items(), ((50, 2), (140, 2), (150, 7)), noises):
        taken = {variant: [] for variant in VARIANTS}
        for seed in (0, *seeds):  # the first one compiles
            for variant in VARIANTS:
                with searching(variant, part):
                    taken[variant].append(ask_seconds(function, n, d, noise, seed))
        before, now = (1000.0 * np.median(taken[variant][1:], axis=0) for variant in VARIANTS)
        for ask, b, a in zip(("learning", "next"), before, now, strict=True):
            print(f"{kind} ({n}, {d}) {title:13} {ask:8}  without {b:.1f} ms, with {a:.1f} ms, {a / b:.2f} times")


def _kept(run, part, seeds, file):
    """Return {seed: what the run of each variant found}, those of a file included."""
    known = kept(file)
    for seed in seeds:
        for variant in VARIANTS:
            if (seed, variant) not in known:
                with searching(variant, part):
                    known[seed, variant] = run(seed)
                keep(file, (seed, variant), known[seed, variant])
    wanted = seeds or {seed for seed, _ in known if all((seed, variant) in known for variant in VARIANTS)}
    return {seed: [known[seed, variant] for variant in VARIANTS] for seed in wanted}


def _print_function(subject, part, name, seeds):
    found = []
    for variant in VARIANTS:
        with searching(variant, part):
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
        f"{name:18} {len(now):4}  without {_told(before)}, {once.sum()} within 1 %; with {_told(now)}, {found.sum()};"
        f" difference {_told(now - before)}, of logarithms {_told(logarithm)};"
        f" won {np.sum(found & ~once)}, lost {np.sum(once & ~found)}",
        flush=True,
    )


def _told(values):
    return f"{values.mean():+.3f} ({values.std(ddof=1) / len(values) ** 0.5:.3f})"


if __name__ == "__main__":
    main()

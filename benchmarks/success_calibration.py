"""Do stated probabilities of success come true? `python -m benchmarks.success_calibration [--seeds 100] [--trials 40]`.

One run a seed and row: trials succeed or fail; then the stated probabilities are compared with the true ones at 256
points of a Sobol sequence (`anywhere`), at each trial that the optimizer chose, before it was told (`next trial`), and
at the recommended input (`answer`). Rows:

    random      p(x) = Phi(f(x)), f of two variables drawn from the prior that the model assumes, hyperparameters too;
                trials at random inputs, six times as many runs
    asked       the same, trials that the optimizer asks for
    counted     as asked, by `surrogate="beta_process"`
    published   as asked, rkhs, gm and nes-polynomial in turn, p(x) = Phi(2.5 z(x)) of the standardized function

Printed: for each tenth of the stated probability its mean, the mean true probability, and their difference in standard
errors, those of sums over seeds: points of one run are not independent.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.special import ndtr
from scipy.stats import qmc

import surehold as sh
from benchmarks.success_outcomes import probability_of
from surehold.defaults import (
    LENGTH_SCALE_DEVIATION,
    LENGTH_SCALE_MEDIAN,
    SUCCESS_MEAN_VARIANCE,
    SUCCESS_SIGNAL_PRIOR,
)

ROWS = ("random", "asked", "counted", "published")
PUBLISHED = ("rkhs", "gm", "nes-polynomial")
WHERE = ("anywhere", "next trial", "answer")


def probability(row, seed, rng):
    """Return the box and p: (d,) -> probability of success there."""
    if row == "published":
        return probability_of(PUBLISHED[seed % len(PUBLISHED)])
    mean, deviation = (
        np.sqrt(SUCCESS_MEAN_VARIANCE) * rng.standard_normal(),
        np.exp(0.5 * rng.normal(*SUCCESS_SIGNAL_PRIOR)),
    )
    scales = LENGTH_SCALE_MEDIAN * np.sqrt(2.0) * np.exp(LENGTH_SCALE_DEVIATION * rng.standard_normal(2))
    # random Fourier features of a Matern-5/2 kernel
    frequencies = rng.standard_normal((2000, 2)) / scales * np.sqrt(5.0 / rng.chisquare(5.0, (2000, 1)))
    phases, amplitudes = rng.uniform(0.0, 2.0 * np.pi, 2000), rng.standard_normal(2000) * deviation / np.sqrt(1000.0)
    box = sh.Box({"x0": (0.0, 1.0), "x1": (0.0, 1.0)})
    return box, lambda x: float(ndtr(mean + np.cos(frequencies @ x + phases) @ amplitudes))


def one(row, seed, trials):
    """Return rows (where, stated, true) of one run."""
    rng = np.random.default_rng([7, seed])
    box, p = probability(row, seed, rng)
    settings = {"surrogate": "beta_process"} if row == "counted" else {}
    optimizer, found = sh.Optimizer(box, outcome="success", seed=seed, **settings), []
    for t in range(trials):
        x = box.from_unit(rng.random(box.dimension)) if row == "random" else optimizer.ask()
        true = p(x)
        if row != "random" and t >= optimizer.n_initial:
            found.append((1, optimizer.predict(x[None])[0][0], true))
        optimizer.tell(x, success=bool(rng.random() < true))
    queries = box.from_unit(qmc.Sobol(box.dimension, rng=rng).random(256))
    found += [(0, stated, p(x)) for x, stated in zip(queries, optimizer.predict(queries)[0], strict=True)]
    best = optimizer.recommend()
    return [*found, (2, best.mean, p(best.x))]


def table(stated, true, seeds):
    """Yield for each tenth: its number, mean stated, mean true, standard error of their difference, count."""
    tenth = np.minimum((10.0 * stated).astype(int), 9)
    for k in range(10):
        inside = tenth == k
        n = int(inside.sum())
        if len(np.unique(seeds[inside])) < 10:
            continue
        off = true[inside] - stated[inside]
        sums = np.bincount(seeds[inside], off - off.mean())
        yield k, stated[inside].mean(), true[inside].mean(), np.sqrt(np.square(sums).sum()) / n, n


def main():
    """Print all tables, after each row of runs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--rows", nargs="*", default=list(ROWS), choices=ROWS)
    parser.add_argument("--keep", type=Path, help="a file .npz for all (row, seed, where, stated, true)")
    arguments = parser.parse_args()
    kept = {}
    for row in arguments.rows:
        runs = [
            np.array(one(row, seed, arguments.trials)) for seed in range(arguments.seeds * (1 + 5 * (row == "random")))
        ]
        seeds = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
        kept[row] = np.column_stack([seeds, np.concatenate(runs)])
        if arguments.keep:
            np.savez_compressed(arguments.keep, **kept)
        for w, where in enumerate(WHERE):
            if not np.any(kept[row][:, 1] == w):
                continue
            seeds, _, stated, true = kept[row][kept[row][:, 1] == w].T
            for k, said, is_so, error, n in table(stated, true, seeds.astype(int)):
                off = (is_so - said) / error
                figures = f"stated {said:.3f} true {is_so:.3f}  {off:+.1f} se ({error:.3f}) of {n}"
                print(f"{row:9} {where:10} .{k}-  {figures}")
            mean, error = (true - stated).mean(), (true - stated).std(ddof=1) / np.sqrt(len(true))
            print(
                f"{row:9} {where:10} all  true - stated {mean:+.4f} ({error:.4f} if all were independent)", flush=True
            )


if __name__ == "__main__":
    main()

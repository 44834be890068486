"""What the correction of risk measures brings a search: `python -m benchmarks.risk_regret --count 60`.

Searches of the random smooth functions of `benchmarks.rule_regret` in one to three variables whose risk measure is not
the mean, with known noise: the default, and the same without the correction of the measure by more perturbations (its
few alone choose trials and answer). Printed are, by risk measure, the mean final regret [% of the best value less the
mean over the box] with its standard error, its paired difference, how many runs come within 1 %, only with the
correction (won) and only without it (lost), CPU seconds a run, and with the correction how many trials lie within .001
box widths of an earlier one.
"""

import argparse
import sys
from itertools import islice
from time import process_time
from unittest.mock import patch

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import qmc

import surehold as sh
from benchmarks.rule_regret import EXACT, best_by, measure, smooth
from surehold.optimization.strategy.ranking import Ranking

BUDGETS = {1: 30, 2: 50, 3: 70}
AGAIN = 1e-3  # box widths


def searched(seed):
    """Return the answer (d,) of a search of the smooth function of a seed, CPU seconds, and trials made again."""
    function, box, noise, risk = smooth(seed)
    optimizer = sh.Optimizer(box, input_noise=noise, risk=risk, seed=seed)
    began = process_time()
    for _ in range(BUDGETS[box.dimension]):
        x = optimizer.ask()
        optimizer.tell(x, float(function(np.atleast_2d(x))[0]))
    X = optimizer.X
    again = sum(np.abs(X[:i] - X[i]).max(axis=1).min() < AGAIN for i in range(1, len(X)))
    return optimizer.recommend().x, process_time() - began, again


def compared(seed):
    """Return the risk measure's name, both regrets [%], both times [s], and how many trials were made again."""
    *_, box, _, risk = problem = smooth(seed)
    exactly = measure(*problem, EXACT)
    answers = [searched(seed)]
    with patch.object(Ranking, "correction", lambda self, posterior: None):
        answers.append(searched(seed))
    found = np.array([x for x, _, _ in answers])
    places = np.concatenate([found, best_by(*problem, EXACT, found)[None]])
    values = np.concatenate([exactly(x) for x in places])
    scale = values.max() - exactly(qmc.Sobol(box.dimension, rng=0).random(2**8)).mean()
    print(".", end="", file=sys.stderr, flush=True)
    return risk.name, 100.0 * (values.max() - values[:2]) / scale, [answer[1] for answer in answers], answers[0][2]


def averse(count):
    """Return the first seeds whose risk measure is not the mean."""
    seeds = (seed for seed in range(10**9) if smooth(seed)[3].name != "mean")
    return list(islice(seeds, count))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="functions")
    rows = Parallel(n_jobs=2)(delayed(compared)(seed) for seed in averse(parser.parse_args().count))
    print(file=sys.stderr)
    for name in ("mean-variance", "var", "cvar", ""):
        those = [row for row in rows if name in ("", row[0])]
        if len(those) < 2:
            continue
        regrets, seconds, again = (np.array([row[k] for row in those]) for k in (1, 2, 3))
        error = regrets.std(axis=0, ddof=1) / np.sqrt(len(regrets))
        gap = regrets[:, 0] - regrets[:, 1]
        within = regrets <= 1.0
        means = (
            f"corrected {regrets[:, 0].mean():.2f} ({error[0]:.2f}), not {regrets[:, 1].mean():.2f} ({error[1]:.2f})"
        )
        paired = f"{gap.mean():+.2f} ({gap.std(ddof=1) / np.sqrt(len(gap)):.2f})"
        won, lost = ((within[:, k] & ~within[:, 1 - k]).sum() for k in (0, 1))
        print(f"{name or 'all':14}{len(gap):4}  {means}, {paired}; within 1 %:", *within.sum(axis=0), end="")
        took = " s, ".join(f"{mean:.1f}" for mean in seconds.mean(axis=0))
        print(f", won {won}, lost {lost}; {took} s; again {again.mean():.1f}")


if __name__ == "__main__":
    main()

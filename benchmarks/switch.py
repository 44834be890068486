"""Whether answering from trials near by costs quality: `python -m benchmarks.switch [--seeds 4] [--starts 300 600]`.

From `defaults.MANY` trials on a query is answered from those near it. For every problem, start and seed the same Latin
hypercube of `start` trials is told to two optimizers, one that takes all trials together and one that takes those near
by, each asks and tells 40 times more, and recommends. Printed are the mean regrets of the answers with standard
errors, the paired difference of their logarithms to base 10 (above 0: those near by are worse), and CPU seconds an ask.
"""

import argparse
import time

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from surehold.optimization.surrogates.gaussian_process import model
from surehold.problems.high_dimensional import rosenbrock
from surehold.problems.named import robust_problem

ASKS = 40
SEEDS = 4
STARTS = (300, 600)
ALL, NEAR = 10**6, 100  # values of MANY


def rosenbrock_6():
    """Return box, noise, function and regret of Rosenbrock's valley in 6 variables, reached exactly."""
    box = sh.Box.unit(6)
    return box, None, (lambda u: float(rosenbrock(4.0 * u[None] - 2.0)[0])), lambda x, f: -f(x)


def needle_3():
    """Return the same of a narrow and a broad hill in 3 variables, under their own input noise."""
    problem = robust_problem("needle-3")
    f, best = problem.function, sh.problems.robust_optimum(problem.function, problem.noise).value
    return f.box, problem.noise, (lambda x: float(f(x))), lambda x, _: best - problem.value(x[None])[0]


PROBLEMS = {"Rosenbrock, 6 variables": rosenbrock_6, "needle, 3 variables, input noise": needle_3}


def run(name: str, start: int, seed: int, many: int) -> tuple[float, float]:
    """Return the regret of the answer and the mean CPU seconds of an ask."""
    box, noise, f, regret = PROBLEMS[name]()
    model.MANY = many
    optimizer = sh.Optimizer(box, input_noise=noise, seed=seed, n_initial=1)
    tried = box.from_unit(qmc.LatinHypercube(box.dimension, rng=seed).random(start))
    optimizer.restore(tried, [f(x) for x in tried])
    began = time.process_time()
    for _ in range(ASKS):
        x = optimizer.ask()
        optimizer.tell(x, f(x))
    seconds = (time.process_time() - began) / ASKS
    return max(float(regret(optimizer.recommend().x, f)), 1e-12), seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--starts", type=int, nargs="+", default=STARTS)
    options = parser.parse_args()
    with threadpool_limits(1):
        for name in PROBLEMS:
            for start in options.starts:
                found = np.array([[run(name, start, s, many) for many in (ALL, NEAR)] for s in range(options.seeds)])
                regrets, seconds = found[:, :, 0], found[:, :, 1].mean(axis=0)
                error = np.sqrt(options.seeds)
                means, spreads = regrets.mean(axis=0), regrets.std(axis=0, ddof=1) / error
                together, near = (f"{m:.2e} +- {s:.0e}" for m, s in zip(means, spreads, strict=True))
                lost = np.log10(regrets[:, 1] / regrets[:, 0])
                decades = f"{lost.mean():+.2f} +- {lost.std(ddof=1) / error:.2f} decades"
                times = f"{seconds[0]:.3f}, {seconds[1]:.3f} s"
                print(f"{name}, n = {start}: together {together}, near by {near}; {decades}; {times}", flush=True)


if __name__ == "__main__":
    main()

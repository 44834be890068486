"""How often does safe mode break its limits? `python -m benchmarks.safe_mode [--seeds 40] [--safety 0.95]`.

Random responses and random limited outputs of one and two variables (`benchmarks.calibration`), each of standard
deviation 1; the limit is the output's 70 % quantile over the box, and the three first points are the inputs of a net at
which it is lowest. Another problem is a straight response whose limited output is 1 + 4 x^2, at most 3, from .1, .2 and
.3. Printed are, of the trials after the first ones, 12 (of the straight one 9), the share that breaks the limit with
its standard error over runs, the largest miss, and the mean of the best response that keeps the limit. Allowed is
1 - safety.

    default       as it is
    rough models  without particles of the squared-exponential process (`benchmarks.default_parts`)
"""

import argparse

import numpy as np
from scipy.stats import qmc

import surehold as sh
from benchmarks.calibration import random_function
from benchmarks.default_parts import searching

TRIALS = {"straight": 9, "one variable": 12, "two variables": 12}


def problem(name, seed):
    """Return response and limited output of points (q, d), the limit, and the first points (3, d)."""
    if name == "straight":
        return lambda X: X[:, 0], lambda X: 1.0 + 4.0 * X[:, 0] ** 2, 3.0, np.array([[0.1], [0.2], [0.3]])
    d = 1 if name == "one variable" else 2
    rng = np.random.default_rng([seed, d, 41])
    response, output = random_function(d, rng), random_function(d, rng)
    net = qmc.Sobol(d, rng=np.random.default_rng(0)).random(1024)
    values = output(net)
    return response, output, float(np.quantile(values, 0.7)), net[np.argsort(values)[:3]]


def run(name, seed, safety):
    """Return by how much trials after the first ones miss the limit, (t,), and the best response that keeps it."""
    response, output, limit, first = problem(name, seed)
    box = sh.Box.unit(first.shape[1])
    points = [dict(zip(box.names, point.tolist(), strict=True)) for point in first]
    limits = {"output": (None, limit)}
    optimizer = sh.Optimizer(box, seed=seed, constraints=limits, safety=safety, initial_points=points)
    X = []
    for _ in range(len(first) + TRIALS[name]):
        X.append(optimizer.ask())
        point = X[-1][None, :]
        optimizer.tell(X[-1], float(response(point)[0]), constraints={"output": float(output(point)[0])})
    missed = output(np.array(X)) - limit
    return missed[len(first) :], response(np.array(X))[missed <= 0.0].max()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--safety", type=float, default=0.95)
    arguments = parser.parse_args()
    for name in TRIALS:
        for variant, title in (("without", "rough models"), ("default", "default")):
            with searching(variant, "smooth"):
                runs = [run(name, seed, arguments.safety) for seed in range(arguments.seeds)]
            missed = np.array([of for of, _ in runs])
            shares = np.mean(missed > 0.0, axis=1)
            print(
                f"{name:14} {title:13} broken {shares.mean():.4f} ({shares.std(ddof=1) / len(runs) ** 0.5:.4f})"
                f" of {1.0 - arguments.safety:.2f}, by at most {max(missed.max(), 0.0):.3f};"
                f" best {np.mean([best for _, best in runs]):.4f}",
                flush=True,
            )


if __name__ == "__main__":
    main()

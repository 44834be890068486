"""Input noise that is not normal, given as samples: does it pay to say so? `python -m benchmarks.sampled_noise`.

Problems (maximized, 30 trials with input noise, one variable of the noise's shape each; the other is normal)
    skewed      errors are exponential, to one side only: an object is pushed away, never pulled near
    bimodal     errors are -e or +e, with a small spread: a finger slips to one side or the other
Each on GM and on random functions of two variables (sums of random Fourier features of a Matern-5/2 kernel,
length-scale 0.2 sqrt 2). Methods:
    samples     `InputNoise.samples` of 500 measured errors
    normal      normal noise of the same covariance (and no mean), what one has without them
    none        plain optimization
Reported: the true expected outcome under the noise (4,096 fresh errors) at the recommended input, as a share of the
range from the mean over the box to the optimum of that outcome (a grid, then Nelder and Mead); mean and standard error
over seeds, and the paired difference of samples from normal.
"""

import argparse

import numpy as np
from scipy import optimize

import surehold as sh
from surehold.problems.named import named_function

BOX = sh.Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
METHODS = ("samples", "normal", "none")
WIDTH = 0.08


def errors(shape, n, rng):
    """Return n errors (n, 2) in box widths."""
    other = 0.02 * rng.standard_normal(n)
    if shape == "skewed":
        return np.column_stack([rng.exponential(WIDTH, n), other])
    return np.column_stack([WIDTH * np.sign(rng.random(n) - 0.5) + 0.01 * rng.standard_normal(n), other])


def function(kind, seed):
    """Return f: points (q, 2) of the unit square -> (q,)."""
    if kind == "gm":
        problem = named_function("gm")
        return lambda U: problem(problem.box.from_unit(U))
    rng = np.random.default_rng([11, seed])
    frequencies = rng.standard_normal((1000, 2)) / (0.2 * 2.0**0.5) * np.sqrt(5.0 / rng.chisquare(5.0, (1000, 1)))
    phases, amplitudes = rng.uniform(0.0, 2.0 * np.pi, 1000), rng.standard_normal(1000)
    return lambda U: np.cos(U @ frequencies.T + phases) @ amplitudes * np.sqrt(2.0 / 1000)


def one(kind, shape, seed, trials):
    """Return the share of each method."""
    rng = np.random.default_rng([13, seed])
    f, fresh, measured = function(kind, seed), errors(shape, 4096, rng), errors(shape, 500, rng)
    few = fresh[:512]

    def outcome(u, by=fresh):
        return float(f(u + by).mean())

    axis = np.linspace(0.0, 1.0, 31)
    grid = np.array([[a, b] for a in axis for b in axis])
    values = np.array([outcome(u, few) for u in grid])
    starts = grid[np.argsort(-values)[:3]]
    bounds = [(0.0, 1.0)] * 2
    found = [optimize.minimize(lambda u: -outcome(u), u, method="Nelder-Mead", bounds=bounds) for u in starts]
    best, middle = -min(float(end.fun) for end in found), values.mean()
    covariance = np.cov(measured.T)
    noises = {"samples": sh.InputNoise.samples(measured), "normal": sh.InputNoise(covariance=covariance), "none": None}
    shares = []
    for method in METHODS:
        result = sh.maximize(lambda x: float(f(x[None])[0]), BOX, trials, input_noise=noises[method], seed=seed)
        shares.append((outcome(result.recommendation.x) - middle) / (best - middle))
    return shares


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--trials", type=int, default=30)
    arguments = parser.parse_args()
    for kind in ("gm", "random"):
        for shape in ("skewed", "bimodal"):
            shares = np.array([one(kind, shape, seed, arguments.trials) for seed in range(arguments.seeds)])
            gain = shares[:, 0] - shares[:, 1]
            mean, error = (part(np.column_stack([shares, gain])) for part in (lambda v: v.mean(axis=0), _error))
            names = (*METHODS, "samples - normal")
            cells = "  ".join(f"{n} {m:.3f} ({e:.3f})" for n, m, e in zip(names, mean, error, strict=True))
            print(f"{kind:7}{shape:8} {cells}", flush=True)


def _error(values):
    return values.std(axis=0, ddof=1) / np.sqrt(len(values))


if __name__ == "__main__":
    main()

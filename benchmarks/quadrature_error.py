"""How well each quadrature averages the model over the input noise: `python -m benchmarks.quadrature_error`.

On every problem the model is the one that the default optimizer has after its budget, thinned to a few particles. Its
mean at x + noise is averaged by every quadrature and by 2^20 quasi-random points, at the best observed trials and at
places drawn from the box. Printed for each quadrature, over seeds and places:
    points      points that it takes
    rms, max    its error, in % of the range of the observed values
    worth       plain random points that have the same root-mean-square error; above `points` it beats them
    lost        what the tried input that it ranks first lacks to the best one, in % of that range (by 2^12 points)
"closed form" belongs to another model of the same trials, one with the squared-exponential kernel; its error is that of
the reference.
"""

import argparse

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.robust_regret import BUDGETS, problem_named
from surehold.errors import InputError
from surehold.optimization.noise import quadratures
from surehold.optimization.noise.kinds import root_of
from surehold.optimization.surrogates.gaussian_process.closed_form import closed_form
from surehold.optimization.surrogates.gaussian_process.kernels import cross_correlation
from surehold.problems.robust import ROBUST, RobustProblem

GRASPS = {
    "mug": ("dx", "dy"),
    "bottle": ("dx", "dy"),
    "mug 7-D": ("dx", "dy", "dz", "rx", "ry", "rz", "s1"),
}
PROBLEMS = ["rkhs 0.01", "rkhs 0.02", "gm 0.1", "gm 0.05", *ROBUST, *GRASPS]
RULES = {
    "none: x itself": lambda S: quadratures.exact(len(S)),
    "unscented, k = 0": lambda S: quadratures.sigma_points(S, 0.0),
    "unscented, k = 1": quadratures.sigma_points,
    "unscented, k = 3 - d": lambda S: quadratures.sigma_points(S, 3.0 - len(S)),
    "scaled unscented": quadratures.scaled_sigma_points,
    "central difference": quadratures.central_difference_points,
    "Gauss-Hermite, 3": quadratures.gauss_hermite,
    "Gauss-Hermite, 5": lambda S: quadratures.gauss_hermite(S, 5),
    **{f"quasi-Monte Carlo, {2**e}": (lambda S, e=e: quadratures.quasi_monte_carlo(S, e)) for e in range(3, 9)},
}
PARTICLES = 2
OBSERVED, DRAWN = 3, 3
MOST = 256  # points of a rule that is tried
CHUNK = 2**15


def grasp_problem(name):
    function = sh.problems.GraspProblem(name.split()[0], variables=GRASPS[name])
    return RobustProblem(function, sh.InputNoise.unit(0.03))


class Model:
    """The mean of a Gaussian process, and nothing else of it: cheap enough for a million points."""

    def __init__(self, posterior):
        self._posterior = posterior

    def __call__(self, points):
        """Return the mean (q,) at points (q, d)."""
        posterior, parts = self._posterior, []
        evidence, parameters = posterior.evidence, posterior.hyperparameters
        for start in range(0, len(points), CHUNK):
            part = np.ascontiguousarray(points[start : start + CHUNK])
            K = np.empty((len(evidence.X), len(part)))
            mean = np.zeros(len(part))
            for inverse_l, s2, alpha in zip(parameters.inverse_l, parameters.s2, posterior.factors.alpha, strict=True):
                cross_correlation(evidence.kernel, evidence.X, part, inverse_l, K)
                mean += alpha @ (s2 * K + evidence.mean_variance)
            parts.append(mean / len(parameters.s2))
        return posterior.outputs.shift + posterior.outputs.scale * np.concatenate(parts)


def trials_of(problem, seed):
    """Return the trials U (n, d) in the unit cube and their values of a run of the default optimizer."""
    box = problem.function.box
    noise = problem.observation_noise or "none"
    optimizer = sh.Optimizer(box, input_noise=problem.noise, noise=noise, seed=seed)
    rng = np.random.default_rng([seed, 97])
    for _ in range(BUDGETS[box.dimension]):
        x = optimizer.ask()
        optimizer.tell(x, float(problem.function(x)) + problem.observation_noise * rng.standard_normal())
    return box.to_unit(optimizer.X), optimizer.y, optimizer.posterior.thinned(PARTICLES)


def rules_for(covariance):
    """Return the quadratures (offsets, weights) by name that exist for this noise and are not too large."""
    rules = {}
    for name, rule in RULES.items():
        try:
            found = rule(covariance)
        except InputError:  # too many points in many variables
            continue
        if len(found.weights) <= MOST:
            rules[name] = found
    return rules


def averages(model, U, rule):
    """Return the averages (q,) of the model around U (q, d)."""
    around = U[:, None, :] + rule.offsets
    return model(around.reshape(-1, U.shape[1])).reshape(len(U), -1) @ rule.weights


def measured(problem, seed):
    """Return {rule: (points, errors (q,), random variances (q,), value lost)} in units of the range of the values."""
    covariance = problem.noise.unit_covariance(problem.function.box)
    d = len(covariance)
    U, y, posterior = trials_of(problem, seed)
    model, unit = Model(posterior), float(np.ptp(y))
    rng = np.random.default_rng([seed, 5])
    places = np.concatenate([U[np.argsort(-y)[:OBSERVED]], rng.random((DRAWN, d))])
    normals = qmc.MultivariateNormalQMC(np.zeros(d), rng=rng).random(2**20) @ root_of(covariance).T
    values = [model(u + normals) for u in places]
    reference, variances = np.array([v.mean() for v in values]), np.array([v.var() for v in values])
    ranked = averages(model, U, quadratures.Quadrature(normals[: 2**12], np.full(2**12, 2.0**-12)))
    found = {}
    for name, rule in rules_for(covariance).items():
        lost = ranked.max() - ranked[np.argmax(averages(model, U, rule))]
        errors = (averages(model, places, rule) - reference) / unit
        found[name] = (len(rule.weights), errors, variances / unit**2, lost / unit)
    smooth = sh.GaussianProcess(kernel="squared_exponential").fit(U, y).posterior.thinned(PARTICLES)
    own = np.array([Model(smooth)(u + normals).mean() for u in places])
    errors = (closed_form(smooth, places, covariance).mean.mean(axis=0) - own) / unit
    found["closed form"] = (0, errors, variances / unit**2, np.nan)
    return found


def line(problem, name, results):
    points, errors, variances, lost = (np.concatenate([np.atleast_1d(part) for part in column]) for column in results)
    square = np.mean(errors**2)
    print(
        f"{problem:15} {name:24} {points.max():6.0f} {1e2 * square**0.5:9.4f} {1e2 * np.abs(errors).max():9.4f} "
        f"{np.mean(variances) / square:12.3g} {1e2 * lost.mean():8.3f}",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--problems", nargs="+", default=PROBLEMS)
    arguments = parser.parse_args()
    print(f"{arguments.seeds} seeds, {OBSERVED} best trials and {DRAWN} places of the box each")
    print(f"{'problem':15} {'quadrature':24} {'points':>6} {'rms %':>9} {'max %':>9} {'worth':>12} {'lost %':>8}")
    everything = {}
    for label in arguments.problems:
        problem = grasp_problem(label) if label in GRASPS else problem_named(label)
        with threadpool_limits(1):
            runs = [measured(problem, seed) for seed in range(arguments.seeds)]
        for name in runs[0]:
            results = [found[name] for found in runs]
            line(label, name, zip(*results, strict=True))
            everything.setdefault(name, []).extend(results)
    for name, results in everything.items():
        line("all", name, zip(*results, strict=True))


if __name__ == "__main__":
    main()

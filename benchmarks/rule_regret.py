"""What a quadrature alone costs, without a model and without trials: `python -m benchmarks.rule_regret [problem ...]`.

    python -m benchmarks.rule_regret nes-polynomial mvar-gmm
    python -m benchmarks.rule_regret --family 100
    python -m benchmarks.rule_regret --smooth 60

The measure of the true function is computed by 32 (the default in four and more variables), 64 (the default in up to
three), 128 and 512 quasi-random perturbations, and maximized; for comparison by 32 and 64 of an unscrambled Sobol
sequence and its mirror image, whose first half has the centers of the cells. Printed is what the place that comes out
lacks to the best one under the noise: on the published robust problems in per cent of the best value; with --family on
so many training seeds of the generated landscapes, with --smooth on so many random smooth functions of one to three
variables (Fourier features, polynomials, cosines; noise of 0.02 to 0.16 of the box; every risk measure), mean and
standard error in per cent of the best value less the mean over the box. No search by a rule can be expected to end
nearer.
"""

import argparse
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed
from numpy.polynomial.chebyshev import chebval
from scipy.optimize import minimize
from scipy.stats import norm, qmc

import surehold as sh
from benchmarks.generated_landscapes import landscape
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.noise.kinds import root_of
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.noise.quadratures import Quadrature
from surehold.problems.named import robust_problem
from surehold.problems.published import PUBLISHED

EXPONENTS = (5, 6, 7, 9)
DRAWN = (-5, -6, 5, 6, 7)  # negative: of the unscrambled sequence
EXACT = 11  # exponent by which places are compared where there is no closed form
NET, CLIMBS, STEPS = 2**12, 5, 60
FEW = 3


def measure(function, box, noise, risk, exponent):
    """Return the function of u (q, d) in the unit cube that is the measure (q,) by 2**|exponent| perturbations."""
    rule = Perturbations.of(noise, box, "quasi_monte_carlo", exponent=abs(exponent))
    if exponent < 0:
        rule = unscrambled(rule, noise, box)

    def value(u):
        reached = rule.around(np.atleast_2d(np.clip(u, 0.0, 1.0)))
        outcomes = function(box.from_unit(reached.reshape(-1, box.dimension))).reshape(reached.shape[:2])
        return risk.measure(outcomes, rule.quadrature.weights)

    return value


def unscrambled(rule, noise, box):
    """Return as many perturbations by the centers of the cells of an unscrambled sequence and their mirror image."""
    half = len(rule.quadrature.weights) // 2
    covariance = np.eye(box.dimension) if noise.varies else noise.unit_covariance(box)
    noisy = np.flatnonzero(np.diag(covariance) > 0.0)
    shares = qmc.Sobol(len(noisy), scramble=False).random(half) + 0.5 / half
    points = 2.0 * shares - 1.0 if noise.bounded else norm.ppf(shares)
    points /= np.sqrt(np.mean(points**2, axis=0))
    offsets = np.zeros((2 * half, box.dimension))
    offsets[:, noisy] = np.concatenate([points, -points]) @ root_of(covariance)[np.ix_(noisy, noisy)].T
    return replace(rule, quadrature=Quadrature(offsets, rule.quadrature.weights))


def best_by(function, box, noise, risk, exponent, starts=None):
    """Return the place (d,) of the unit cube that is best by the measure of `exponent`."""
    value = measure(function, box, noise, risk, exponent)
    net = qmc.Sobol(box.dimension, rng=0).random(NET)
    net = net if starts is None else np.concatenate([net, np.clip(starts, 0.0, 1.0)])
    top = net[np.argsort(-np.concatenate([value(part) for part in np.array_split(net, 32)]))[:CLIMBS]]
    if box.dimension <= FEW:
        how = {"method": "Nelder-Mead", "options": {"xatol": 1e-6, "fatol": 1e-10}}
    else:  # where that takes long
        how = {"method": "L-BFGS-B", "bounds": [(0.0, 1.0)] * box.dimension, "options": {"maxiter": STEPS}}
    climbs = [minimize(lambda u: -value(u)[0], u, **how) for u in top]
    return np.clip(min(climbs, key=lambda climb: climb.fun).x, 0.0, 1.0)


def lost_on(name):
    """Return what each number of perturbations loses on a published problem [% of the best value]."""
    problem = robust_problem(name)
    function, risk = problem.function, Risk(problem.risk, alpha=problem.alpha, beta=problem.beta)
    best = problem.optimum.value
    places = [function.box.from_unit(best_by(function, function.box, problem.noise, risk, e)) for e in EXPONENTS]
    return [100.0 * (best - problem.value(x)[0]) / abs(best) for x in places]


def lost_in_family(seed):
    """Return the number of variables and what each number of perturbations loses on a landscape [% of its scale]."""
    problem = landscape(seed)
    best = problem.best()
    places = [best_by(problem, problem.box, problem.noise, Risk(), e, problem.centers) for e in DRAWN]
    return problem.dimension, 100.0 * (best.value - problem.expectation(np.array(places))) / best.scale


def smooth(seed):
    """Return a smooth function of points (n, d), its box, noise and risk measure, drawn by seed."""
    rng = np.random.default_rng([seed, 77])
    d = int(rng.integers(1, 4))
    kind = ("features", "polynomial", "cosines")[rng.integers(3)]
    noise = sh.InputNoise.unit(float(np.exp(rng.uniform(np.log(0.02), np.log(0.16)))))
    name, beta = ("mean", "mean-variance", "var", "cvar")[rng.integers(4)], float(rng.choice([1.0, 5.0]))
    if kind == "features":  # of a process with the squared-exponential kernel
        directions = rng.standard_normal((120, d)) / (np.exp(rng.uniform(np.log(0.12), np.log(0.5))) * np.sqrt(d))
        phases, heights = rng.uniform(0.0, 2.0 * np.pi, 120), rng.standard_normal(120) / np.sqrt(60.0)
        drawn = lambda x: np.cos(x @ directions.T + phases) @ heights  # noqa: E731
    elif kind == "polynomial":  # in each variable, of Chebyshev polynomials, going on a little outside
        series, mixed = rng.standard_normal((d, int(rng.integers(5, 9)))), 0.5 * rng.standard_normal((d, d))

        def drawn(x):
            t = np.clip(2.0 * x - 1.0, -1.3, 1.3)
            return sum(chebval(t[:, k], series[k]) for k in range(d)) + np.einsum("ni,ij,nj->n", t, mixed, t)
    else:
        speeds, phases, bends = rng.uniform(5.0, 25.0, d), rng.uniform(0.0, 6.0, d), rng.uniform(0.0, 9.0, d)
        drawn = lambda x: np.cos(x * speeds + phases).sum(axis=1) - (x - 0.5) ** 2 @ bends + 0.3 * np.cos(x @ speeds)  # noqa: E731
    return drawn, sh.Box.unit(d), noise, Risk(name, beta=beta) if name == "mean-variance" else Risk(name)


def lost_on_smooth(seed):
    """Return the number of variables and what each number of perturbations loses on a smooth function [%]."""
    problem = smooth(seed)
    exactly = measure(*problem, EXACT)
    places = [best_by(*problem, e) for e in (*DRAWN, EXACT)]
    values = np.concatenate([exactly(u) for u in places])
    mean = exactly(qmc.Sobol(problem[1].dimension, rng=0).random(2**8)).mean()
    return problem[1].dimension, 100.0 * (values.max() - values[:-1]) / (values.max() - mean)


def print_drawn(rows):
    """Print means and standard errors of rows (variables, lost by each of DRAWN)."""
    print(f"{'':28}" + "".join(f"{2 ** abs(e)}{' unscrambled' if e < 0 else ''}".rjust(18) for e in DRAWN))
    for low, high in ((1, 1), (2, 2), (3, 3), (1, 3), (4, 6), (7, 8), (4, 8)):
        lost = np.array([row for d, row in rows if low <= d <= high])
        if len(lost) > 1:
            cells = zip(lost.mean(axis=0), lost.std(axis=0, ddof=1) / np.sqrt(len(lost)), strict=True)
            title = f"{low} to {high} variables, {len(lost)}"
            print(f"{title:28}" + "".join(f"{mean:.3f} ({error:.3f})".rjust(18) for mean, error in cells))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = [name for name, make in PUBLISHED.items() if make().noise is not None and make().risk != "worst"]
    parser.add_argument("problems", nargs="*", metavar="problem", help=f"from {', '.join(known)} (default: all)")
    parser.add_argument("--family", type=int, help="training seeds of the generated landscapes, from 0 on")
    parser.add_argument("--smooth", type=int, help="random smooth functions")
    options = parser.parse_args()
    if unknown := sorted(set(options.problems) - set(known)):
        parser.error(f"there is no problem {unknown[0]!r}; choose from {', '.join(known)}")
    for count, lost in ((options.family, lost_in_family), (options.smooth, lost_on_smooth)):
        if count is not None:
            print_drawn(Parallel(n_jobs=2)(delayed(lost)(seed) for seed in range(count)))
    if options.family is None and options.smooth is None:
        print(f"{'':28}" + "".join(f"{2**e:>16}" for e in EXPONENTS))
        for name in options.problems or known:
            print(f"{name:28}" + "".join(f"{value:16.3f}" for value in lost_on(name)), flush=True)


if __name__ == "__main__":
    main()

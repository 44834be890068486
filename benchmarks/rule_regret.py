"""What a quadrature alone costs, without a model and without trials: `python -m benchmarks.rule_regret [problem ...]`.

    python -m benchmarks.rule_regret "nes-polynomial" "mvar-mixture"
    python -m benchmarks.rule_regret --family 200

The measure of the true function is computed by 32 (the default in four and more variables), 64 (the default in up to
three), 128 and 512 quasi-random perturbations, and maximized. Printed is what the place that comes out lacks to the
best one under the noise, exactly: on the published robust problems in per cent of the best value; with --family on so
many training seeds of the generated landscapes, mean and standard error in per cent of their scale. No search by a rule
can be expected to end nearer.
"""

import argparse

import numpy as np
from joblib import Parallel, delayed
from scipy.optimize import minimize
from scipy.stats import qmc

from benchmarks.generated_landscapes import landscape
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.noise.perturbations import Perturbations
from surehold.problems.named import robust_problem
from surehold.problems.published import PUBLISHED

EXPONENTS = (5, 6, 7, 9)
OF_FAMILY = (5, 6, 7)
NET, CLIMBS, STEPS = 2**12, 5, 60
FEW = 3


def best_by(function, box, noise, risk, exponent, starts=None):
    """Return the place (d,) of the unit cube that is best by 2**exponent perturbations."""
    rule = Perturbations.of(noise, box, "quasi_monte_carlo", exponent=exponent)

    def value(u):
        reached = rule.around(np.atleast_2d(np.clip(u, 0.0, 1.0)))
        outcomes = function(box.from_unit(reached.reshape(-1, box.dimension))).reshape(reached.shape[:2])
        return risk.measure(outcomes, rule.quadrature.weights)

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
    places = [best_by(problem, problem.box, problem.noise, Risk(), e, problem.centers) for e in OF_FAMILY]
    return problem.dimension, 100.0 * (best.value - problem.expectation(np.array(places))) / best.scale


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = [name for name, make in PUBLISHED.items() if make().noise is not None and make().risk != "worst"]
    parser.add_argument("problems", nargs="*", metavar="problem", help=f"from {', '.join(known)} (default: all)")
    parser.add_argument("--family", type=int, help="training seeds of the generated landscapes, from 0 on")
    options = parser.parse_args()
    if unknown := sorted(set(options.problems) - set(known)):
        parser.error(f"there is no problem {unknown[0]!r}; choose from {', '.join(known)}")
    shown = EXPONENTS if options.family is None else OF_FAMILY
    print(f"{'':28}" + "".join(f"{2**e:>16}" for e in shown))
    if options.family is not None:
        rows = Parallel(n_jobs=2)(delayed(lost_in_family)(seed) for seed in range(options.family))
        for low, high in ((1, 1), (2, 2), (3, 3), (1, 3), (4, 6), (7, 8), (4, 8)):
            lost = np.array([row for d, row in rows if low <= d <= high])
            if len(lost) > 1:
                cells = zip(lost.mean(axis=0), lost.std(axis=0, ddof=1) / np.sqrt(len(lost)), strict=True)
                title = f"{low} to {high} variables, {len(lost)}"
                print(f"{title:28}" + "".join(f"{f'{mean:.3f} ({error:.3f})':>16}" for mean, error in cells))
        return
    for name in options.problems or known:
        print(f"{name:28}" + "".join(f"{value:16.3f}" for value in lost_on(name)), flush=True)


if __name__ == "__main__":
    main()

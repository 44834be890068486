"""What a quadrature alone costs on the published robust problems: `python -m benchmarks.rule_regret [problem ...]`.

No model and no trials: the problem's own measure of the true function is computed by 32 (the default), 128 and 512
quasi-random perturbations, and maximized. Printed is what the place that comes out lacks to the best one under the
noise, exactly, in per cent of the best value: no search by this rule can be expected to end nearer.
"""

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from benchmarks.arguments import chosen
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.noise.perturbations import Perturbations
from surehold.problems.named import robust_problem
from surehold.problems.published import PUBLISHED

EXPONENTS = (5, 7, 9)
NET, CLIMBS = 2**12, 5


def best_by(problem, exponent):
    """Return the place (d,) of the unit cube that is best by 2**exponent perturbations."""
    box, risk = problem.function.box, Risk(problem.risk, alpha=problem.alpha, beta=problem.beta)
    rule = Perturbations.of(problem.noise, box, "quasi_monte_carlo", exponent=exponent)

    def value(u):
        reached = rule.around(np.atleast_2d(np.clip(u, 0.0, 1.0)))
        outcomes = problem.function(box.from_unit(reached.reshape(-1, box.dimension))).reshape(reached.shape[:2])
        return risk.measure(outcomes, rule.quadrature.weights)

    net = qmc.Sobol(box.dimension, rng=0).random(NET)
    starts = net[np.argsort(-np.concatenate([value(part) for part in np.array_split(net, 16)]))[:CLIMBS]]
    climbs = [
        minimize(lambda u: -value(u)[0], u, method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-10})
        for u in starts
    ]
    return np.clip(min(climbs, key=lambda climb: climb.fun).x, 0.0, 1.0)


def main():
    names = [name for name, make in PUBLISHED.items() if make().noise is not None and make().risk != "worst"]
    print(f"{'':28}" + "".join(f"{2**e:>12}" for e in EXPONENTS))
    for name in chosen(__doc__, names, name="problem"):
        problem = robust_problem(name)
        places = [problem.function.box.from_unit(best_by(problem, e)) for e in EXPONENTS]
        lost = [100.0 * (problem.optimum.value - problem.value(x)[0]) / abs(problem.optimum.value) for x in places]
        print(f"{name:28}" + "".join(f"{value:12.3f}" for value in lost), flush=True)


if __name__ == "__main__":
    main()

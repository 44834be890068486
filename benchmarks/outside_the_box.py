"""What is got wrong where no trial can be made: `python -m benchmarks.outside_the_box [problem ...]`.

Where the best place is near the border, a part of its perturbed points lies outside of the box. The default is run on
published problems, seeds 100 to 104. Printed are, at the answer of each run: the share of 512 perturbed points outside
of the box, the root mean square of the error of the model's mean inside and outside, in units of the function, and what
the answer is worth by the problem's measure: as the model has it, as it would have it with the true values outside, and
in truth.
"""

import numpy as np
from threadpoolctl import threadpool_limits

import surehold as sh
from benchmarks.arguments import chosen
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.surrogates.protocol import means
from surehold.problems.named import robust_problem

PROBLEMS = ("qing-hartmann-3", "nes-polynomial")
SEEDS = range(100, 105)


def searched(problem, seed):
    """Return the optimizer after all trials of a run with the published budget."""
    optimizer = sh.Optimizer(
        problem.function.box, input_noise=problem.noise, n_initial=problem.initial, seed=seed, risk=problem.measure
    )
    for _ in range(problem.trials):
        x = optimizer.ask()
        optimizer.tell(x, problem.function(x))
    return optimizer


def shown(name, seed):
    problem = robust_problem(name)
    optimizer = searched(problem, seed)
    box, answer = optimizer.box, optimizer.recommend().x
    rule = Perturbations.of(optimizer.input_noise, box, "quasi_monte_carlo", exponent=9)
    points = rule.around(box.to_unit(answer)[None])[0]
    believed = means(optimizer.posterior, points).mean(axis=0)
    true = problem.function(box.from_unit(points))
    outside = np.any((points < 0.0) | (points > 1.0), axis=1)
    inside_error, outside_error = (np.sqrt(np.mean((believed - true)[k] ** 2)) for k in (~outside, outside))
    worth = [problem.measure.of_executions(values) for values in (believed, np.where(outside, true, believed), true)]
    print(
        f"{name}, seed {seed}: {outside.mean():.0%} outside; error inside {inside_error:.2g}, outside "
        f"{outside_error:.2g}; worth {worth[0]:.3f}, with the truth outside {worth[1]:.3f}, in truth {worth[2]:.3f}",
        flush=True,
    )


if __name__ == "__main__":
    with threadpool_limits(1):
        for problem in chosen(__doc__, PROBLEMS, name="problem"):
            for seed in SEEDS:
                shown(problem, seed)

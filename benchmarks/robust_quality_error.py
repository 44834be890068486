"""How exact is the robust quality of a grasp? `python -m benchmarks.robust_quality_error [objects]`.

Six poses that hold, of a Latin hypercube over dx and dy, of each object, disturbed as `robust_quality` does. The error
is that of the mean of n trials, root mean square over twelve seeds, against the mean of 4,000 trials of another seed;
independent draws have the deviation of those 4,000 over sqrt(n). Printed are errors over that of 100 independent
draws, of each object and of all; below 1 is more exact.
"""

import numpy as np
from scipy.stats import qmc

from benchmarks.arguments import chosen
from surehold.grasping import OBJECTS
from surehold.grasping.pose_noise import robust_quality
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems import GraspProblem

POSES, SEEDS, REFERENCE = 6, 12, 4000
NUMBERS = (16, 24, 32, 64, 100)


def squares(name):
    """Return squared errors (poses, 1 + numbers): of 100 independent draws, then of each number of trials."""
    problem = GraspProblem(name, contact="graded")
    points = problem.box.from_unit(qmc.LatinHypercube(2, rng=1).random(50 * POSES))
    rows = []
    for pose in [problem.pose(x) for x in points if problem(x) > 0.0][:POSES]:
        reference = robust_quality(problem.simulator, pose, n=REFERENCE, seed=10**6)
        row = [reference.values.var() / 100.0]
        for n in NUMBERS:
            means = [robust_quality(problem.simulator, pose, n=n, seed=seed).mean for seed in range(SEEDS)]
            row.append(np.mean((np.array(means) - reference.mean) ** 2))
        rows.append(row)
    return np.array(rows)


def main():
    names = chosen(__doc__, list(OBJECTS), OBJECTS)
    print(f"{'object':10}" + "".join(f"{n:>8}" for n in NUMBERS) + "  trials")
    found = {}
    for name in names:
        found[name] = squares(name)
        _print(name, found[name])
    _print("all", np.concatenate(list(found.values())))


def _print(name, rows):
    independent, *errors = np.sqrt(rows.mean(axis=0))
    print(f"{name:10}" + "".join(f"{error / independent:8.2f}" for error in errors), flush=True)


if __name__ == "__main__":
    with single_threaded():
        main()

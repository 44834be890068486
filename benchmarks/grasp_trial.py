"""CPU time of one grasp trial: `python -m benchmarks.grasp_trial [object ...]`.

Prints for each object and contact model the median and 95th percentile of the CPU time of a trial on one core, for all
poses of a Latin hypercube over dx and dy and for those that do not start in collision, and the share of each status.
"""

import time

import numpy as np
from scipy.stats import qmc

from benchmarks.arguments import chosen
from surehold.grasping import CONTACT_MODELS, OBJECTS, STATUSES
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems import GraspProblem

TRIALS = 400


def timed(problem, points):
    seconds, outcomes = [], []
    for x in points:
        start = time.process_time()
        outcomes.append(problem.grasp(x))
        seconds.append(time.process_time() - start)
    return 1e3 * np.array(seconds), outcomes


def main(names):
    print(f"{'object':8} {'contact':8} {'all ms':>13} {'free ms':>13}  status")
    for name in names:
        for contact in CONTACT_MODELS:
            problem = GraspProblem(name, contact=contact)
            problem.warm_up()
            points = problem.box.from_unit(qmc.LatinHypercube(2, rng=0).random(TRIALS))
            timed(problem, points[:20])
            ms, outcomes = timed(problem, points)
            free = np.array([g.status != "initial collision" for g in outcomes])
            share = {s: np.mean([g.status == s for g in outcomes]) for s in STATUSES}
            print(
                f"{name:8} {contact:8} {np.median(ms):6.2f} {np.percentile(ms, 95):6.2f}"
                f" {np.median(ms[free]):6.2f} {np.percentile(ms[free], 95):6.2f}"
                "  " + ", ".join(f"{s} {v:.2f}" for s, v in share.items())
            )


if __name__ == "__main__":
    with single_threaded():
        main(chosen(__doc__, OBJECTS))

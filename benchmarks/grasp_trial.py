"""Time and roughness of one grasp trial: `python benchmarks/grasp_trial.py [object ...]`.

Prints for each object and contact model the median and 95th percentile of the time of a trial on one core (all poses of
a Latin hypercube over dx and dy; and only those that do not start in collision), the share of each status, and the
largest change of the quality per 0.125 mm along dx over its mean, away from collisions.
"""

import sys
import time

import numpy as np
from scipy.stats import qmc

from surehold.grasping import CONTACT_MODELS, OBJECTS, STATUSES
from surehold.optimization.threads import single_threaded
from surehold.problems.grasp import Grasp

TRIALS = 400
STEP = 0.000125


def timed(problem, points):
    seconds, outcomes = [], []
    for x in points:
        start = time.perf_counter()
        outcomes.append(problem.grasp(x))
        seconds.append(time.perf_counter() - start)
    return 1e3 * np.array(seconds), outcomes


def roughness(problem, dy):
    """Largest step of the quality along dx over its mean, among neighbors that both start free of collision."""
    grasps = [problem.grasp((x, dy)) for x in np.arange(problem.box.lower[0], problem.box.upper[0], STEP)]
    quality = np.array([g.quality for g in grasps])
    free = np.array([g.status != "initial collision" for g in grasps])
    held = quality[quality > 0.0]
    both = free[1:] & free[:-1]
    return np.abs(np.diff(quality))[both].max() / held.mean() if held.size > 100 and both.any() else np.nan


def main(names):
    print(f"{'object':8} {'contact':8} {'all ms':>13} {'free ms':>13} {'roughness':>18}  status")
    for name in names:
        for contact in CONTACT_MODELS:
            problem = Grasp(name, contact=contact)
            problem.warm_up()
            points = problem.box.from_unit(qmc.LatinHypercube(2, rng=0).random(TRIALS))
            timed(problem, points[:20])
            ms, outcomes = timed(problem, points)
            free = np.array([g.status != "initial collision" for g in outcomes])
            rough = [roughness(problem, dy) for dy in problem.box.upper[1] * np.array([-0.4, 0.0, 0.4])]
            share = {s: np.mean([g.status == s for g in outcomes]) for s in STATUSES}
            print(
                f"{name:8} {contact:8} {np.median(ms):6.2f} {np.percentile(ms, 95):6.2f}"
                f" {np.median(ms[free]):6.2f} {np.percentile(ms[free], 95):6.2f}"
                f" {' '.join(f'{r:5.3f}' for r in rough):>18}  " + ", ".join(f"{s} {v:.2f}" for s, v in share.items())
            )


if __name__ == "__main__":
    with single_threaded():
        main(sys.argv[1:] or OBJECTS)

"""How often a grasp of some quality is held, by physics: `python -m benchmarks.grasp_dynamics [object ...]`.

For each object grasps of its default problem with dx, dy and dz free, drawn at random among those that start free of
collision and touch with two links or more, until each fifth of the range of qualities has its share; then all are
squeezed, weighed and shaken in MuJoCo. Printed: share of the verdicts in each range of quality, the share held among
the grasps at or above each threshold, the rank correlation of quality with being held, and seconds a check.
"""

import time

import numpy as np
from scipy.stats import spearmanr

from benchmarks.arguments import chosen
from surehold.grasping import OBJECTS
from surehold.grasping.physics.check import GraspChecker
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems import GraspProblem

DRAWN, CHECKED, BINS = 1500, 60, 5


def sample(problem):
    """Grasps spread evenly over the range of quality."""
    rng = np.random.default_rng(0)
    points = problem.box.from_unit(rng.random((DRAWN, problem.box.dimension)))
    grasps = [problem.grasp(x) for x in points]
    grasps = [g for g in grasps if g.status in ("ok", "not closed") and len(g.touching) >= 2]
    quality = np.array([g.quality for g in grasps])
    edges = np.linspace(0.0, quality.max(), BINS + 1)[1:-1]
    kind = np.where(quality == 0.0, -1, np.searchsorted(edges, quality))
    chosen = [i for k in range(-1, BINS) for i in np.flatnonzero(kind == k)[: CHECKED // (BINS + 1)]]
    return [grasps[i] for i in chosen], quality[chosen], kind[chosen]


def main(names):
    for name in names:
        problem = GraspProblem(name, variables=("dx", "dy", "dz"))
        grasps, quality, kind = sample(problem)
        checker = GraspChecker(problem.simulator)
        start = time.process_time()
        checks = checker.checks(grasps)
        seconds = (time.process_time() - start) / len(checks)
        held = np.array([check.verdict == "held" for check in checks])
        rank = spearmanr(quality, held).statistic if len(set(held)) > 1 else np.nan
        print(f"{name}: {len(checks)} grasps, rank correlation {rank:.2f}, {seconds:.2f} s each")
        for k in range(-1, BINS):
            mine = kind == k
            if not mine.any():
                continue
            verdicts = [checks[i].verdict for i in np.flatnonzero(mine)]
            shares = ", ".join(f"{v} {verdicts.count(v)}" for v in ("held", "moved", "slipped", "dropped"))
            low, high = quality[mine].min(), quality[mine].max()
            above = held[quality >= low].mean()
            print(f"  quality {low:.3f} to {high:.3f}: {shares}; at or above held {above:.2f}", flush=True)


if __name__ == "__main__":
    with single_threaded():
        main(chosen(__doc__, OBJECTS))

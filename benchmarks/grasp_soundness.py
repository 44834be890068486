"""Thousands of random trials of every object: `python -m benchmarks.grasp_soundness [trials|closing] [object ...]`.

`trials`: 2,000 random poses of all 24 modes and postures an object, contacts `single` and `graded`: share of each
status, values that are not finite, fallbacks of the measure, whether repetition on two processes gives the same bits,
and trials a minute of CPU time on one process and a minute of the clock on two. `closing`: on 200 random poses the
joint angles of the closed hand beside those of the same closing with coal's exact distances to the mesh (links that
touch, `adaptive`).
"""

import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.arguments import chosen
from surehold.grasping import MODES, OBJECTS, Simulator, default_pose, grasp_batch
from surehold.optimization.numerics.threads import single_threaded

TRIALS, CLOSINGS = 2000, 200


def random_poses(simulator, n, seed):
    rng, half = np.random.default_rng(seed), simulator.object.box_half_extents
    poses = []
    for _ in range(n):
        offsets = rng.uniform(-1.0, 1.0, 6) * [0.09, half.max(), 0.02, 0.8, 0.8, 0.8]
        standoff = float(rng.uniform(0.0, 0.06 + half.max()))
        poses.append(default_pose(simulator.hand, simulator.object, MODES[rng.integers(len(MODES))], standoff, offsets))
    return poses, rng.uniform(-np.pi, np.pi, n)


def trials(names):
    print(f"{'object':8} {'contact':8} {'a minute':>16}  finite same fallbacks  status")
    for name in names:
        for contact in ("single", "graded"):
            simulator = Simulator(obj=name, contact=contact)
            simulator.warm_up()
            poses, s1 = random_poses(simulator, TRIALS, 0)
            grasp_batch(simulator, poses[:200], s1[:200], workers=2)  # the processes start
            batches, minute = [], []
            for workers, clock in ((1, time.process_time), (2, time.perf_counter)):
                start = clock()
                batches.append(grasp_batch(simulator, poses, s1, workers=workers))
                minute.append(60.0 * TRIALS / (clock() - start))
            alone, together = batches
            same = all(np.array_equal(getattr(alone, k), getattr(together, k)) for k in vars(alone))
            shares = ", ".join(f"{k} {v:.3f}" for k, v in alone.shares().items())
            finite = np.isfinite(alone.quality).all()
            print(
                f"{name:8} {contact:8} {minute[0]:7.0f} {minute[1]:8.0f} {finite!s:>7} {same!s:4}"
                f" {alone.fallbacks.sum():9d}  {shares}",
                flush=True,
            )


def closing(names):
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "grasping"))
    from exact_closing import ExactClosing

    print(f"{'object':8} largest difference of a joint angle [rad]: median, 95th percentile, worst; poses")
    for name in names:
        simulator = Simulator(obj=name, contact="single")
        exact, found = ExactClosing(simulator), []
        for pose, s1 in zip(*random_poses(simulator, 20 * CLOSINGS, 1), strict=True):
            grasp = simulator.grasp(pose, float(s1))
            if grasp.status != "initial collision" and grasp.touching:
                found.append(np.abs(grasp.joints - exact.joints(grasp.pose, float(s1))).max())
                if len(found) == CLOSINGS:
                    break
        median, high = np.quantile(found, [0.5, 0.95])
        print(f"{name:8} {median:.5f} {high:.5f} {max(found):.5f}  {len(found)}", flush=True)


if __name__ == "__main__":
    parts = {"trials": trials, "closing": closing}
    told = chosen(__doc__, [*parts, *OBJECTS], name="part or object")
    objects = [name for name in told if name not in parts] or list(OBJECTS)
    with single_threaded():
        for part in [part for part in told if part in parts] or parts:
            parts[part](objects)

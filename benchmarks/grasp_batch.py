"""Graded trials a minute of many poses, robust quality of one grasp: `python -m benchmarks.grasp_batch [object]`.

Poses are those of a Latin hypercube over dx and dy from which the hand starts free, tried by one process and by two;
wall time without the start of the processes. Then the quality of the middle one of the closed grasps under the default
noise of the pose, in one process and in two, with the default number of trials, whose mean is as exact as that of 72
independent ones (`benchmarks.robust_quality_error`).
"""

import time

import numba
import numpy as np
from scipy.stats import qmc

from benchmarks.arguments import chosen
from surehold.grasping import OBJECTS, grasp_batch
from surehold.grasping.object.distance_field import field_distance
from surehold.grasping.pose_noise import robust_quality
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems import GraspProblem

POSES = 2000
LOOKS = 100_000


@numba.njit
def _looks(nodes, frame, points):
    total = 0.0
    for i in range(len(points)):
        total += field_distance(nodes, frame, points[i, 0], points[i, 1], points[i, 2])
    return total


def look(simulator):
    """Return the CPU seconds of one look at the distance field: the least that a touch costs."""
    half = simulator.object.box_half_extents
    points = simulator.object.box_center + np.random.default_rng(0).uniform(-1.5, 1.5, (LOOKS, 3)) * half
    _looks(simulator.field.nodes, simulator.field.frame, points[:1])
    start = time.process_time()
    _looks(simulator.field.nodes, simulator.field.frame, points)
    return (time.process_time() - start) / LOOKS


def rows(name: str = "mug", poses: int = POSES):
    """Yield a name and the wall seconds of a trial or of a robust quality."""
    problem = GraspProblem(name, contact="graded")
    problem.warm_up()
    simulator = problem.simulator
    points = problem.box.from_unit(qmc.LatinHypercube(2, rng=0).random(3 * poses))
    tried = [problem.pose(x) for x in points]
    with single_threaded():
        free = [pose for pose, x in zip(tried, points, strict=True) if problem.grasp(x).penetration == 0.0][:poses]
        batch = grasp_batch(simulator, free[:200])
        held = [pose for pose, quality in zip(free, batch.quality, strict=False) if quality > 0.0]
        grasp = held[len(held) // 2]
        for workers in (1, 2):
            grasp_batch(simulator, free[:200], workers=workers)  # starts the processes
            began = time.perf_counter()
            grasp_batch(simulator, free, workers=workers)
            yield f"graded trial, {name}, free poses, {workers} processes", (time.perf_counter() - began) / len(free)
        for workers in (1, 2):
            seconds = []
            for _ in range(5):
                began = time.perf_counter()
                robust_quality(simulator, grasp, workers=workers)
                seconds.append(time.perf_counter() - began)
            yield f"robust quality, {name}, {workers} processes", float(np.median(seconds))


def main():
    for name, seconds in rows(chosen(__doc__, ["mug"], OBJECTS)[0]):
        rate = f"{60.0 / seconds:12,.0f} a minute" if name.startswith("graded") else ""
        print(f"{name:50} {1e3 * seconds:9.2f} ms{rate}", flush=True)


if __name__ == "__main__":
    main()

"""The short benchmarks in one table, compared with the last one and stored; the long ones run by name.

python -m benchmarks [--quick]     --quick: without peers and without 3,000 trials and more
"""

import sys
import time

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from benchmarks import growth, stored, suggestion_time
from surehold.campaigns.methods import Surehold
from surehold.campaigns.peers import installed_peers
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems import GraspProblem

GRASPS = 200


def suggestions(quick):
    """Yield name and median CPU seconds of an ask, ours and peers'."""
    ours = {"gp": (None, {}), "gp, input noise": (InputNoise.unit(0.05), {})}
    makers = {f"surehold {name}": (lambda d, X, seed, s=s: Surehold(d, X, seed, *s)) for name, s in ours.items()}
    for name, maker in {**makers, **({} if quick else installed_peers())}.items():
        for n, d in suggestion_time.SETTINGS:
            yield f"ask, {name}, n = {n}, d = {d}", suggestion_time.seconds_per_ask(maker, n, d)


def grasps():
    """Yield name and mean CPU seconds of a trial for poses all over the box, by contact model."""
    for contact in ("single", "graded", "patch"):
        problem = GraspProblem("mug", contact=contact)
        problem.warm_up()
        points = problem.box.from_unit(qmc.LatinHypercube(2, rng=0).random(GRASPS))
        problem.grasp(points[0])
        start = time.process_time()
        for x in points:
            problem.grasp(x)
        yield f"grasp, mug, {contact}", (time.process_time() - start) / GRASPS


def main(quick):
    before, seconds = stored.last(), {}
    with threadpool_limits(1):
        yardstick = suggestion_time.yardstick()
        seconds |= dict(suggestions(quick))
        seconds |= dict(grasps())
        for name, (cold, warm, _) in growth.rows((300, 1000) if quick else growth.SIZES):
            seconds |= {f"first ask, {name}": cold, f"ask, default, {name}": warm}
        yardstick = float(np.median([yardstick, suggestion_time.yardstick(), suggestion_time.yardstick()]))
    print(*stored.lines(seconds, yardstick, before), sep="\n")
    print(f"yardstick {1e3 * yardstick:.3f} ms; stored in {stored.store(seconds, yardstick)}")


if __name__ == "__main__":
    main("--quick" in sys.argv[1:])

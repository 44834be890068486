"""Epsilon beside SciPy's Qhull and a linear program: `python -m benchmarks.wrench_quality [time|closure]`.

`closure`: 10,000 random sets of 2 to 12 contacts, cones of 3 to 8 edges, friction 0 to 0.9, with and without torsion:
how often the sign of epsilon and the linear program (HiGHS) disagree about force closure, how many are closed, and for
each 50th set the largest difference of epsilon from the full hull (Qhull, QJ).

`time`: CPU time of epsilon beside Qhull on the same wrenches, in one run, one thread. Sets: contacts spread over a
ball, and soft contacts in five patches with graded weights; friction cones of 8 edges. Columns, CPU milliseconds,
median over the sets: `ours` (`ball_radius`) and its slowest; `whole`, `wrench_quality` with all checks from points
and normals; `round`, the same with exact round cones; Qhull with `QJ Pp` (robust) and with SciPy's default options,
on fewer sets because it is slow; `refused`, how many of these the default options refused. Then the ratio of `QJ Pp`
to `ours`, the largest difference of epsilon, and the sets in closure.
"""

import os
from statistics import median
from time import thread_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from benchmarks.arguments import chosen
from surehold.grasping.wrench.force_closure import force_closure
from surehold.grasping.wrench.friction_cones import contact_wrenches
from surehold.grasping.wrench.hull.inscribed_ball import ball_radius
from surehold.grasping.wrench.wrench_space import wrench_quality


def spread_contacts(rng, c):
    points = rng.normal(size=(c, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals = -points + 0.3 * rng.normal(size=(c, 3))
    return points, normals / np.linalg.norm(normals, axis=1)[:, None], np.ones(c)


def patch_contacts(rng, c):
    patches = 5
    middle = rng.normal(size=(patches, 3))
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    points, normals = [], []
    for n in middle:
        offsets = 0.05 * rng.normal(size=(c // patches, 3))
        offsets -= np.outer(offsets @ n, n)
        tilted = n + 0.05 * rng.normal(size=offsets.shape)
        points.append(offsets - n)
        normals.append(tilted / np.linalg.norm(tilted, axis=1)[:, None])
    return np.concatenate(points), np.concatenate(normals), rng.uniform(0.05, 1.0, patches * (c // patches))


def milliseconds(function, *arguments, **options):
    start = thread_time()
    result = function(*arguments, **options)
    return 1e3 * (thread_time() - start), result


def hull_epsilon(wrenches, options):
    return max(-ConvexHull(wrenches, qhull_options=options).equations[:, -1].max(), 0.0)


def measure(name, contacts, c, sets, hull_sets):
    rng = np.random.default_rng(0)
    ours, whole, rounded, joggled, default, worst, refused, closed = [], [], [], [], [], 0.0, 0, 0
    for k in range(sets):
        points, normals, weights = contacts(rng, c)
        wrenches = contact_wrenches(points, normals, weights=weights)
        time, epsilon = milliseconds(ball_radius, wrenches)
        ours.append(time)
        closed += epsilon > 0.0
        whole.append(milliseconds(wrench_quality, points, normals, weights=weights)[0])
        rounded.append(milliseconds(wrench_quality, points, normals, weights=weights, cones="round")[0])
        if k < hull_sets:
            time, full = milliseconds(hull_epsilon, wrenches, "QJ Pp")
            joggled.append(time)
            worst = max(worst, abs(full - epsilon))
            try:
                default.append(milliseconds(hull_epsilon, wrenches, None)[0])
            except QhullError:
                refused += 1
    ratio = median(joggled) / median(ours)
    plain = f"{median(default):8.1f}" if default else "       -"
    print(
        f"{name:8} {c:4} x 8 {median(ours):8.2f} {max(ours):8.2f} {median(whole):8.2f} {median(rounded):8.2f}"
        f" {median(joggled):8.1f} {plain} {refused:4}/{hull_sets:<3} {ratio:7.0f} {worst:9.1e} {closed:5}/{sets}"
    )


def closure(sets=10_000):
    rng = np.random.default_rng(0)
    disagree, closed, worst, compared = 0, 0, 0.0, 0
    for k in range(sets):
        points, normals, _ = spread_contacts(rng, int(rng.integers(2, 13)))
        wrenches = contact_wrenches(
            points * rng.uniform(0.3, 1.0, 3),
            normals,
            friction=rng.uniform(0.0, 0.9),
            edges=int(rng.integers(3, 9)),
            torsion=rng.choice([0.0, 0.05]),
        )
        epsilon = ball_radius(wrenches)
        disagree += (epsilon > 0.0) != force_closure(wrenches)
        closed += epsilon > 0.0
        if k % 50 == 0 and len(wrenches) > 7:
            worst = max(worst, abs(hull_epsilon(wrenches, "QJ Pp") - epsilon))
            compared += 1
    print(f"{sets} sets: {closed} closed, {disagree} disagree; {compared} beside the full hull differ by {worst:.1e}")


def main():
    ball_radius(contact_wrenches(*spread_contacts(np.random.default_rng(1), 6)[:2]))  # compile
    print(
        f"{'set':8} {'contacts':>8} {'ours':>8} {'slowest':>8} {'whole':>8} {'round':>8} {'QJ Pp':>8} {'default':>8}"
        f" {'refused':>8} {'ratio':>7} {'differs':>9} {'closed':>9}"
    )
    for name, contacts in (("spread", spread_contacts), ("patches", patch_contacts)):
        for c, sets, hull_sets in ((5, 200, 50), (10, 200, 20), (40, 100, 5), (100, 50, 1)):
            measure(name, contacts, c, sets, hull_sets)


if __name__ == "__main__":
    parts = chosen(__doc__, ["time", "closure"], name="part")
    if "closure" in parts:
        closure()
    if "time" in parts:
        main()

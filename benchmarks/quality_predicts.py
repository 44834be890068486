"""Which quality says that a grasp will hold? `python -m benchmarks.quality_predicts --rows FILE [--objects mug ...]`.

For an object, a hand and a facet: random poses (dx, dy, dz free, and more around the best of them) that start free of
collision and touch with two links or more, 200 of them spread evenly over the range of epsilon. Each is then executed
five times with input noise of 3 % of the box, and every execution is squeezed, weighed and shaken in MuJoCo. A grasp
is held under noise if at least half of its executions are "held". Printed is the area under the curve (AUC) of every
quality for that: the chance that of two grasps, one held and one not, the held one has the higher quality; with the
standard error of Hanley and McNeil (1982). "robust" is the mean of epsilon over 30 other draws of the noise, what
surehold optimizes; the other qualities are of the pose itself. Then the threshold: the robust quality below which no
grasp was held, and above which nine of ten were.

`--objects drill@40` asks for a force of 40 N at the fingertips instead of the hand's own. Objects take turns and grasps
come in random order, so that a benchmark that is stopped has a fair sample of all. A row is written for each grasp: it
goes on where it was. `--write FILE` writes the table.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

import surehold as sh
from surehold.grasping import OBJECTS
from surehold.grasping.physics.check import GraspChecker
from surehold.grasping.wrench.quality import Measure
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems import GraspProblem
from surehold.problems.perturbation import perturbed_points

NOISE = sh.InputNoise.unit(0.03)
DRAWN, AROUND, NEAR = 2000, 800, 0.05
BINS = 10
SHAKEN, AVERAGED = 5, 30
QUALITIES = ("epsilon", "volume", "simox", "task", "min_weight", "balance")


def sample(problem, n, seed):
    """Return n inputs (n, d) whose grasps are spread evenly over the range of the quality, in random order."""
    rng = np.random.default_rng(seed)
    unit = rng.random((DRAWN, problem.box.dimension))
    values = np.array([rated(problem, u) for u in unit])
    best = unit[np.argsort(-np.nan_to_num(values, nan=-1.0))[:20]]
    more = np.clip(best[rng.integers(len(best), size=AROUND)] + NEAR * rng.normal(size=(AROUND, unit.shape[1])), 0, 1)
    unit, values = np.vstack([unit, more]), np.append(values, [rated(problem, u) for u in more])
    unit, values = unit[np.isfinite(values)], values[np.isfinite(values)]
    kind = np.where(values == 0.0, -1, np.minimum((BINS * values / values.max()).astype(int), BINS - 1))
    order = rng.permutation(len(values))
    place = np.empty(len(values), dtype=int)
    for k in range(-1, BINS):  # the first of each range, then the second of each, ...
        mine = order[kind[order] == k]
        place[mine] = np.arange(len(mine))
    chosen = order[np.argsort(place[order], kind="stable")][:n]
    return problem.box.from_unit(unit[rng.permutation(chosen)])


def rated(problem, unit):
    grasp = problem.grasp(problem.box.from_unit(unit))
    counts = grasp.status in ("ok", "not closed") and len(grasp.touching) >= 2
    return grasp.quality if counts else np.nan


def row_of(problem, checker, measures, x, number):
    """Return what a grasp is worth by every quality, and how often it is held."""
    grasp = problem.grasp(x)
    contacts = grasp.contacts
    values = {
        name: float(measure.value(contacts.points, contacts.normals, grasp.wrench))
        for name, measure in measures.items()
    }
    strayed = perturbed_points(x, problem.box, NOISE, AVERAGED, seed=1)
    values["robust"] = float(np.mean([max(problem.grasp(point).quality, 0.0) for point in strayed]))
    executed = [grasp, *(problem.grasp(point) for point in perturbed_points(x, problem.box, NOISE, SHAKEN, seed=2))]
    started = time.process_time()
    held = checker.held(executed)
    seconds = (time.process_time() - started) / len(executed)
    return {"number": number, "x": x.tolist(), **values, "held": bool(held[0]), "share": float(held[1:].mean()),
            "seconds": seconds}  # fmt: skip


def auc(values, positive):
    """Return the area under the curve of values (n,) for a condition (n,), and its standard error."""
    n, m = int(positive.sum()), int((~positive).sum())
    if not n or not m:
        return np.nan, np.nan
    a = (rankdata(values)[positive].sum() - n * (n + 1) / 2) / (n * m)
    q, r = a / (2.0 - a), 2.0 * a * a / (1.0 + a)
    return a, np.sqrt((a * (1.0 - a) + (n - 1) * (q - a * a) + (m - 1) * (r - a * a)) / (n * m))


def thresholds(robust, held):
    """Return the robust quality below which none is held, and the lowest above which nine of ten are, or NaN."""
    if not held.any():
        return np.nan, np.nan
    order = np.argsort(-robust)
    share = np.cumsum(held[order]) / np.arange(1, len(held) + 1)
    sure = np.flatnonzero(share >= 0.9)
    return robust[held].min(), robust[order[sure[-1]]] if len(sure) else np.nan


def table(rows):
    """Yield the lines of a Markdown table of all cases."""
    names = ("robust", *QUALITIES)
    yield f"| object, hand, facet, force | grasps | held | {' | '.join(names)} | none held below | 9 of 10 above |"
    yield "|---" * (len(names) + 5) + "|"
    for case, mine in rows.items():
        held = np.array([row["share"] >= 0.5 for row in mine])
        cells = []
        for name in names:
            area, error = auc(np.array([row[name] for row in mine]), held)
            cells.append("–" if np.isnan(area) else f"{area:.3f} ({error:.3f})")
        low, high = thresholds(np.array([row["robust"] for row in mine]), held)
        cells += ["–" if np.isnan(value) else f"{value:.3f}" for value in (low, high)]
        yield f"| {case} | {len(mine)} | {int(held.sum())} | {' | '.join(cells)} |"


def stored(path):
    rows = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        row = json.loads(line)
        rows.setdefault(row.pop("case"), []).append(row)
    return rows


class Case:
    """One object, hand, facet and force, and its grasps."""

    def __init__(self, asked, hand, facet, n):
        name, _, force = asked.partition("@")
        self.problem = GraspProblem(name, facet, ("dx", "dy", "dz"), hand=hand)
        simulator = self.problem.simulator
        self.checker = GraspChecker(simulator, finger_force=float(force) if force else None)
        self.measures = {quality: Measure(quality, self.problem.object, simulator.friction) for quality in QUALITIES}
        self.name = f"{name}, {simulator.hand.name}, {self.problem.facet}, {self.checker.finger_force:g} N"
        self.points = sample(self.problem, n, seed=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=Path, required=True, help="file of finished grasps; made or continued")
    parser.add_argument(
        "--objects", nargs="*", default=list(OBJECTS), help="NAME or NAME@NEWTONS; none: the table only"
    )
    parser.add_argument("--facet", default="")
    parser.add_argument("--hand", default="icub-left")
    parser.add_argument("--grasps", type=int, default=200)
    parser.add_argument("--write", type=Path, default=None, help="file for the table")
    arguments = parser.parse_args()
    rows = stored(arguments.rows)
    cases = [Case(asked, arguments.hand, arguments.facet, arguments.grasps) for asked in arguments.objects]
    for number in range(arguments.grasps):
        for case in cases:
            done = rows.setdefault(case.name, [])
            if number >= len(case.points) or number in {row["number"] for row in done}:
                continue
            row = row_of(case.problem, case.checker, case.measures, case.points[number], number)
            done.append(row)
            with arguments.rows.open("a") as file:
                file.write(json.dumps({"case": case.name, **row}) + "\n")
    lines = list(table(rows))
    print(*lines, sep="\n")
    if rows:
        print(f"{np.mean([row['seconds'] for mine in rows.values() for row in mine]):.3f} CPU seconds a check")
    if arguments.write is not None:
        arguments.write.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    with single_threaded():
        main()

"""Does a quality with a slope everywhere save trials? `python -m benchmarks.signed_quality --rows FILE [--seeds 16]`.

Mug and bottle in all seven variables, 150 trials of which 30 are initial; with `--two` all objects in dx and dy, 100
trials of which 40 are initial, as the command line has it; input noise of 3 % of the box. The optimizer is told
`epsilon`, which is 0 wherever the grasp is not closed, or `signed_epsilon`, which falls there with what is missing, and
without contacts with the distance (after the metric of Veiga and Bernardino 2012). Both begin with the same initial
design of a seed. After a third, two thirds and all of the trials the recommendation is executed 1,000 times with the
noise, the same for both, and rated by `epsilon`, whatever was told. "Half" is the first trial whose epsilon is half of
the highest of all runs on that object, or one more than there are.

With `--scales C ...` the optimizer is told other curves, too: outside of closure -C log(1 + d / C) of the same distance
d, and -d itself for "inf".

Printed are means over seeds with standard errors, differences paired by seed, and how many of the initial poses hold. A
row is written for each run: it goes on where it was.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import surehold as sh
from surehold.grasping import OBJECTS
from surehold.grasping.wrench.quality import OUTSIDE
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems.grasp.options import VARIABLES

EPSILON, SIGNED = "epsilon", "signed_epsilon"
NOISE = sh.InputNoise.unit(0.03)
BUDGETS = {2: (100, 40), 7: (150, 30)}  # trials, and how many of them are initial, by number of variables
EXECUTIONS = 1000


def curved(scale, signed, rated):
    """Return a problem that gives another curve of the same distance outside of closure."""

    def value(x):
        told = signed(x)
        if told >= 0.0 or rated(x) < 0.0:  # epsilon is below 0 only where the hand starts inside the object
            return told
        distance = OUTSIDE * np.expm1(-told / OUTSIDE)
        return -distance if np.isinf(scale) else -scale * np.log1p(distance / scale)

    return value


def run(told, rated, seed):
    """Return the row of one run: robust value of the recommendation at each look, and epsilon of all trials."""
    started, values, robust = time.process_time(), [], []
    trials, initial = BUDGETS[rated.box.dimension]
    optimizer = sh.Optimizer(rated.box, n_initial=initial, seed=seed, input_noise=NOISE)
    for trial in range(1, trials + 1):
        x = optimizer.ask()
        optimizer.tell(x, told(x))
        values.append(rated(x))
        if trial in looks(trials):
            x = optimizer.recommend().x
            robust.append(sh.problems.robust_score(rated, x, NOISE, n=EXECUTIONS, seed=12345).mean)
    return {"epsilon": values, "robust": robust, "seconds": time.process_time() - started}


def looks(trials):
    """Return after how many trials the recommendation is rated."""
    return (trials // 3, 2 * trials // 3, trials)


def summary(values):
    return f"{np.mean(values):.3f} ({np.std(values, ddof=1) / np.sqrt(len(values)):.3f})"


def table(rows, trials, initial):
    """Yield the lines of a Markdown table, and how many of the initial poses hold."""
    yield f"| object | told | seeds | {' | '.join(f'after {look}' for look in looks(trials))} | half |"
    yield "|---" * (len(looks(trials)) + 4) + "|"
    holding = []
    for obj in dict.fromkeys(o for o, _, _ in rows):
        mine = {(told, seed): row for (o, told, seed), row in rows.items() if o == obj}
        names = sorted({told for told, _ in mine}, key=lambda name: (name != EPSILON, name))
        seeds = [seed for told, seed in mine if told == EPSILON and all((name, seed) in mine for name in names)]
        if len(seeds) < 2:
            continue
        half = 0.5 * max(max(row["epsilon"]) for row in mine.values())
        cells = {}
        for name in names:
            taken = [mine[name, seed] for seed in seeds]
            first = [np.argmax(np.append(np.array(row["epsilon"]) >= half, True)) + 1.0 for row in taken]
            cells[name] = np.column_stack([[row["robust"] for row in taken], first])
        cells |= {f"{name}, minus epsilon": cells[name] - cells[EPSILON] for name in names if name != EPSILON}
        for name, numbers in cells.items():
            yield f"| {obj} | {name} | {len(seeds)} | {' | '.join(summary(column) for column in numbers.T)} |"
        first = np.array([mine[EPSILON, seed]["epsilon"][:initial] for seed in seeds])
        holding.append(f"{obj}: {np.count_nonzero(first > 0.0)} of {first.size} initial poses hold")
    yield from holding


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=Path, required=True, help="file of finished runs; made or continued")
    parser.add_argument("--first", type=int, default=10, help="first seed; curves were compared on 0 to 9")
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--objects", nargs="+", choices=OBJECTS)
    parser.add_argument("--two", action="store_true", help="two variables, dx and dy")
    parser.add_argument("--scales", nargs="+", type=float, default=[], help="of other curves, in units of force; inf")
    arguments = parser.parse_args()
    lines = arguments.rows.read_text().splitlines() if arguments.rows.exists() else []
    rows = {(row["object"], row["told"], row["seed"]): row for row in map(json.loads, lines)}
    variables = ("dx", "dy") if arguments.two else tuple(VARIABLES)
    told = {}
    for obj in arguments.objects or (OBJECTS if arguments.two else ("mug", "bottle")):
        rated, signed = (
            sh.problems.GraspProblem(obj, variables=variables, quality=quality) for quality in (EPSILON, SIGNED)
        )
        told |= {(obj, EPSILON): rated, (obj, SIGNED): signed}
        told |= {(obj, f"C = {scale:g}"): curved(scale, signed, rated) for scale in arguments.scales}
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        for (obj, name), problem in told.items():
            if (obj, name, seed) in rows:
                continue
            row = {"object": obj, "told": name, "seed": seed, **run(problem, told[obj, EPSILON], seed)}
            rows[obj, name, seed] = row
            with arguments.rows.open("a") as file:
                file.write(json.dumps(row) + "\n")
    print(*table(rows, *BUDGETS[len(variables)]), sep="\n")


if __name__ == "__main__":
    with single_threaded():
        main()

"""Does a quality with a slope everywhere save trials? `python -m benchmarks.signed_quality --rows FILE [--seeds 16]`.

Mug and bottle in all seven variables, 150 trials of which 30 are initial, input noise of 3 % of the box. The optimizer
is told `epsilon`, which is 0 wherever the grasp is not closed, or `signed_epsilon`, which falls there with what is
missing, and without contacts with the distance (after the metric of Veiga and Bernardino 2012). Both begin with the
same initial design of a seed. After 50, 100 and 150 trials the recommendation is executed 1,000 times with the noise,
the same for both, and rated by `epsilon`, whatever was told. "Half" is the first trial whose epsilon is half of the
highest of all runs on that object, or 151.

Printed are means over seeds with standard errors, and differences paired by seed. A row is written for each run: it
goes on where it was.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import surehold as sh
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems.grasp.options import VARIABLES

OBJECTS, QUALITIES = ("mug", "bottle"), ("epsilon", "signed_epsilon")
NOISE = sh.InputNoise.unit(0.03)
TRIALS, INITIAL, LOOKS, EXECUTIONS = 150, 30, (50, 100, 150), 1000


def run(told, rated, seed):
    """Return the row of one run: robust value of the recommendation at each look, and epsilon of all trials."""
    started, values, robust = time.process_time(), [], []
    optimizer = sh.Optimizer(told.box, n_initial=INITIAL, seed=seed, input_noise=NOISE)
    for trial in range(1, TRIALS + 1):
        x = optimizer.ask()
        optimizer.tell(x, told(x))
        values.append(rated(x))
        if trial in LOOKS:
            x = optimizer.recommend().x
            robust.append(sh.problems.robust_score(rated, x, NOISE, n=EXECUTIONS, seed=12345).mean)
    return {"epsilon": values, "robust": robust, "seconds": time.process_time() - started}


def summary(values):
    return f"{np.mean(values):.3f} ({np.std(values, ddof=1) / np.sqrt(len(values)):.3f})"


def table(rows):
    """Yield the lines of a Markdown table."""
    yield f"| object | told | seeds | {' | '.join(f'after {look}' for look in LOOKS)} | half |"
    yield "|---" * (len(LOOKS) + 4) + "|"
    for obj in OBJECTS:
        mine = {(quality, seed): row for (o, quality, seed), row in rows.items() if o == obj}
        seeds = [seed for quality, seed in mine if quality == QUALITIES[0] and (QUALITIES[1], seed) in mine]
        if len(seeds) < 2:
            continue
        half = 0.5 * max(max(row["epsilon"]) for row in mine.values())
        cells = {}
        for quality in QUALITIES:
            taken = [mine[quality, seed] for seed in seeds]
            first = [np.argmax(np.append(np.array(row["epsilon"]) >= half, True)) + 1.0 for row in taken]
            cells[quality] = np.column_stack([[row["robust"] for row in taken], first])
        cells["signed, minus epsilon"] = cells[QUALITIES[1]] - cells[QUALITIES[0]]
        for name, numbers in cells.items():
            yield f"| {obj} | {name} | {len(seeds)} | {' | '.join(summary(column) for column in numbers.T)} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=Path, required=True, help="file of finished runs; made or continued")
    parser.add_argument("--first", type=int, default=10, help="first seed; slopes were compared on 0 to 9")
    parser.add_argument("--seeds", type=int, default=16)
    arguments = parser.parse_args()
    lines = arguments.rows.read_text().splitlines() if arguments.rows.exists() else []
    rows = {(row["object"], row["told"], row["seed"]): row for row in map(json.loads, lines)}
    problems = {
        (obj, quality): sh.problems.GraspProblem(obj, variables=tuple(VARIABLES), quality=quality)
        for obj in OBJECTS
        for quality in QUALITIES
    }
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        for (obj, quality), told in problems.items():
            if (obj, quality, seed) in rows:
                continue
            row = {"object": obj, "told": quality, "seed": seed, **run(told, problems[obj, QUALITIES[0]], seed)}
            rows[obj, quality, seed] = row
            with arguments.rows.open("a") as file:
                file.write(json.dumps(row) + "\n")
    print(*table(rows), sep="\n")


if __name__ == "__main__":
    with single_threaded():
        main()

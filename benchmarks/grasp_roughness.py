"""Quality along dx in steps of 0.125 mm: `python -m benchmarks.grasp_roughness [object ...] [--figure FILE.svg]`.

Three lines an object (dy at -0.4, 0 and 0.4 of its bound) for the contacts `single`, `patch` and `graded`, among
neighbors that both start free of collision. In percent of the mean quality of the line:
`rough`: largest distance of a point from the middle of its two neighbors. A slope is not rough; a jump by j is j / 2.
`step`: largest change from point to point, slopes included. `jumps`: number of changes above 5 %.
The figure shows the middle line of each object: what Figure 4.7 of the thesis shows, with the three contact models.
"""

import argparse

import numpy as np

from surehold.grasping import CONTACT_MODELS, OBJECTS
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems import GraspProblem

STEP = 0.000125
LINES = (-0.4, 0.0, 0.4)


def line(problem, share):
    """Return dx [m] and quality along it, NaN where the open hand collides."""
    dy = share * problem.box.upper[1]
    dx = np.arange(problem.box.lower[0], problem.box.upper[0], STEP)
    grasps = [problem.grasp((x, dy)) for x in dx]
    return dx, np.array([np.nan if g.status == "initial collision" else g.quality for g in grasps])


def measures(quality):
    if not np.any(quality > 0.0):
        return np.nan, np.nan, 0  # no grasp closes on this line
    mean = quality[quality > 0.0].mean()
    step = np.abs(np.diff(quality)) / mean
    bend = np.abs(quality[:-2] - 2.0 * quality[1:-1] + quality[2:]) / 2.0 / mean
    return 100.0 * np.nanmax(bend), 100.0 * np.nanmax(step), int(np.nansum(step > 0.05))


def main(names, figure):
    drawn = {}
    print(f"{'object':8} {'contact':8} {'rough %':>20} {'step %':>20} {'jumps':>12}")
    for name in names:
        for contact in reversed(CONTACT_MODELS):
            problem = GraspProblem(name, contact=contact)
            problem.warm_up()
            lines = [line(problem, share) for share in LINES]
            rows = [measures(quality) for _, quality in lines]
            drawn[name, contact] = lines[1]
            rough, step, jumps = zip(*rows, strict=True)
            print(
                f"{name:8} {contact:8} {' '.join(f'{r:6.2f}' for r in rough)} {' '.join(f'{s:6.2f}' for s in step)}"
                f" {' '.join(f'{j:3d}' for j in jumps)}",
                flush=True,
            )
    if figure:
        draw(names, drawn, figure)


def draw(names, drawn, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(
        len(names), len(CONTACT_MODELS), squeeze=False, sharey="row", figsize=(11, 3 * len(names))
    )
    for row, name in zip(panels, names, strict=True):
        for panel, contact in zip(row, reversed(CONTACT_MODELS), strict=True):
            dx, quality = drawn[name, contact]
            panel.plot(1e3 * dx, quality, linewidth=0.8)
            panel.set_title(f"{name}, {contact}")
            panel.set_xlabel("dx [mm]")
        row[0].set_ylabel("quality")
    figure.tight_layout()
    figure.savefig(path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("objects", nargs="*", metavar="object", help=", ".join(OBJECTS))
    parser.add_argument("--figure", help="file for the figure, as SVG")
    told = parser.parse_args()
    with single_threaded():
        main(told.objects or list(OBJECTS), told.figure)

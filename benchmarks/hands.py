"""Do hands from public models grasp? `python -m benchmarks.hands --models FOLDER --rows FILE [--write TABLE.md]`.

For a hand and an object: 300 random poses before its usual facet (dx, dy, dz and s1 of `surehold grasp`, with its
bounds), 60 more about the best three; of the three best then, the one whose epsilon is highest on average over 20 draws
of input noise (3 % of each range) is the grasp. It is squeezed, weighed and shaken in MuJoCo, and so are these 20
executions. Where it is not held, it is squeezed 2, 4 and 8 times as hard, too.

FOLDER holds the models: github.com/dexsuite/dex-urdf as `dex-urdf`, github.com/a-price/robotiq_arg85_description under
its own name. Hands whose model or package is not there are left out. A row is written for each pair: it goes on where
it was.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from surehold.errors import InputError
from surehold.grasping import Simulator, default_pose, hand_named
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.synergy import preshape_of
from surehold.grasping.physics.check import GraspChecker
from surehold.grasping.physics.explanation import needed_force
from surehold.grasping.poses import facet_axes
from surehold.optimization.numerics.threads import single_threaded
from surehold.problems.grasp.default_poses import default_facet

DESCRIPTIONS = Path(__file__).parents[1] / "examples" / "hands"
MODELS = {
    "allegro": "dex-urdf/robots/hands/allegro_hand/allegro_hand_right.urdf",
    "leap": "dex-urdf/robots/hands/leap_hand/leap_hand_right.urdf",
    "inspire": "dex-urdf/robots/hands/inspire_hand/inspire_hand_right.urdf",
    "ability": "dex-urdf/robots/hands/ability_hand/ability_hand_right.urdf",
    "svh": "dex-urdf/robots/hands/schunk_hand/schunk_svh_hand_right.urdf",
    "barrett": "dex-urdf/robots/hands/barrett_hand/bhand_model.urdf",
    "robotiq-2f85": "robotiq_arg85_description/robots/robotiq_arg85_description.URDF",
    "shadow": "",
    "panda": "",
    "icub-left": "",
}
NOISE, EXECUTIONS = 0.03, 20
RANDOM, AROUND, BEST = 300, 60, 3


def hand_of(name, models):
    if not MODELS[name]:
        return hand_named(name)
    return load_hand(models / MODELS[name], DESCRIPTIONS / f"{name}.yaml")


def row_of(hand, obj):
    """Return the best grasp found and how it does under noise."""
    simulator = Simulator(hand, obj)
    facet = default_facet(simulator.object)
    along, across, depth = np.abs(facet_axes(facet).T) @ simulator.object.box_half_extents
    near = depth / 3.0
    standoffs = (near, near + 0.040 * (1.0 + depth / 0.050))
    ranges = np.array([(-along - 0.025, along + 0.025), (-across, across), standoffs, preshape_of(hand).s1_useful])

    def grasp(unit):
        dx, dy, standoff, s1 = ranges[:, 0] + unit * np.ptp(ranges, axis=1)
        return simulator.grasp(default_pose(hand, simulator.object, facet, standoff, (dx, dy, 0, 0, 0, 0)), s1)

    rng = np.random.default_rng(0)
    units = rng.random((RANDOM, 4))
    values, seconds = [], []
    for unit in units:
        started = time.process_time()
        values.append(grasp(unit).quality)
        seconds.append(time.process_time() - started)
    values = np.array(values)
    about = units[np.argsort(-values)[:BEST]][rng.integers(BEST, size=AROUND)]
    units = np.vstack([units, np.clip(about + 0.05 * rng.normal(size=about.shape), 0.0, 1.0)])
    values = np.append(values, [grasp(unit).quality for unit in units[RANDOM:]])
    strayed = NOISE * rng.normal(size=(EXECUTIONS, 4))
    executions = [[grasp(unit + stray) for stray in strayed] for unit in units[np.argsort(-values)[:BEST]]]
    robust = [float(np.mean([max(g.quality, 0.0) for g in mine])) for mine in executions]
    best = int(np.argmax(robust))
    chosen = grasp(units[np.argsort(-values)[best]])
    checker = GraspChecker(simulator)
    started = time.process_time()
    verdict = checker.check(chosen).verdict
    held = int(np.sum(checker.held(executions[best])))
    check = (time.process_time() - started) / (EXECUTIONS + 1)
    return {
        "closed": float(np.mean(values > 0.0)),
        "epsilon": chosen.quality,
        "robust": robust[best],
        "verdict": verdict,
        "held": held,
        "needed": None if verdict == "held" else needed_force(checker, chosen),
        "trial": float(np.mean(np.sort(seconds)[:-5])),  # without those that compiled something
        "check": check,
        "force": checker.finger_force,
    }


def table(rows):
    yield "| hand | object | in force closure | epsilon | under noise | force | verdict | held of 20 | trial | check |"
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for row in sorted(rows, key=lambda row: (list(MODELS).index(row["hand"]), row["object"])):
        more = f", with {row['needed']:g} N held" if row["needed"] else ""
        yield (
            f"| {row['hand']} | {row['object']} | {100 * row['closed']:.0f} % | {row['epsilon']:.3f} | "
            f"{row['robust']:.3f} | {row['force']:g} N | {row['verdict']}{more} | "
            f"{row['held']} | {1e3 * row['trial']:.1f} ms | {row['check']:.2f} s |"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", type=Path, required=True)
    parser.add_argument("--rows", type=Path, required=True)
    parser.add_argument("--hands", nargs="*", default=list(MODELS))
    parser.add_argument("--objects", nargs="*", default=["bottle", "mug"])
    parser.add_argument("--write", type=Path, default=None)
    arguments = parser.parse_args()
    rows = [json.loads(line) for line in arguments.rows.read_text().splitlines()] if arguments.rows.exists() else []
    for obj in arguments.objects:
        for name in arguments.hands:
            if any((row["hand"], row["object"]) == (name, obj) for row in rows):
                continue
            try:
                hand = hand_of(name, arguments.models)
            except InputError as error:
                print(f"{name} is left out: {error}", flush=True)
                continue
            rows.append({"hand": name, "object": obj, **row_of(hand, obj)})
            with arguments.rows.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
            print(*list(table(rows[-1:]))[2:], flush=True)
    lines = list(table(rows))
    print(*lines, sep="\n")
    if arguments.write is not None:
        arguments.write.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    with single_threaded():
        main()

"""Record postures of the iCub's hand while it grasps in simulation, for `surehold hand synergy`.

Power, tripod, pinch and lateral grasps close on things of sizes that suit each. Of many poses of the palm the one is
taken in which the most fingers have contact, and of those the one of the highest quality; where the thumb and a finger
do not both have contact nothing is recorded. Each grasp gives three postures: open, half closed and closed.
`python record.py` writes icub_postures.csv beside this file, the same one every time.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from surehold.grasping import GraspObject, Simulator, default_pose, icub_left_hand
from surehold.grasping.hand.model import CLOSED, Preshape
from surehold.grasping.pictures.scene import closing_steps


def thing(name, mesh):
    """Return a trimesh mesh as an object of the density of water."""
    return GraspObject(
        name, np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32), 1000.0 * mesh.volume, mesh.center_mass
    )


def lateral(hand):
    """Return a preshape in which the fingers are curled and the thumb comes down on the side of the index finger."""
    finger = {"knuckle": 0.0, "proximal": 1.0, "middle": 1.0, "distal": 0.7}
    start = np.array([[finger[name.split("_")[1]] for name in hand.joint_names[:4]]] * 5)
    start[4] = [0.4, 0.0, 0.0, 0.0]
    rate = np.zeros_like(start)
    rate[4] = np.array([0.0, 0.8, 1.0, 0.6]) / CLOSED
    none = np.zeros_like(start)
    return Preshape(start, rate, none, (0.0, 0.0), (0.0, 0.0), (0.0,))


def best(simulator, posture, across):
    """Return the grasp in which the most fingers have contact, or None; `across` are offsets dy of the palm [m]."""
    hand, obj = simulator.hand, simulator.object
    depth = float(obj.box_half_extents[0])
    tried = []
    for standoff in np.linspace(0.0, depth + 0.02, 6):
        for dx in (-0.02, -0.01, 0.0, 0.01, 0.02):
            for dy in across:
                pose = default_pose(hand, obj, "right-front", float(standoff), (dx, dy, 0.0, 0.0, 0.0, 0.0))
                grasp = simulator.grasp(pose, posture)
                fingers = {name.partition(" ")[0] for name in grasp.contacts.names} - {"palm"}
                if "thumb" in fingers and len(fingers) > 1:
                    tried.append((len(fingers), grasp.quality, len(tried), grasp))
    return max(tried, key=lambda row: row[:3])[3] if tried else None


def main():
    """Write the recording."""
    hand = icub_left_hand()
    hand = replace(hand, preshapes={**hand.preshapes, "lateral": lateral(hand)})
    cylinder, ball, box = trimesh.creation.cylinder, trimesh.creation.icosphere, trimesh.creation.box
    things = {
        "power": [cylinder(radius=r, height=0.14, sections=48) for r in (0.022, 0.028, 0.034)],
        "tripod": [ball(3, radius=r) for r in (0.018, 0.023, 0.028)],
        "pinch": [box((2 * r, 0.03, 0.03)) for r in (0.008, 0.012, 0.016)],
        "lateral": [box((0.05, 0.05, r)) for r in (0.006, 0.010, 0.014)],
    }
    rows = []
    for kind, meshes in things.items():
        for mesh in meshes:
            simulator = Simulator(hand, thing(kind, mesh), preshape=kind)
            beside = 0.0235 + 0.5 * float(np.ptp(mesh.vertices[:, 2]))  # from the grasp center to a plate at the index
            across = -beside + np.array([0.002, 0.0, -0.004]) if kind == "lateral" else (-0.015, 0.0, 0.015)
            for posture in hand.preshapes[kind].s1_tries[::2]:
                grasp = best(simulator, posture, across)
                if grasp is None:
                    continue
                steps = closing_steps(simulator, grasp)
                rows += [(kind, *steps[k].ravel().tolist()) for k in (0, len(steps) // 2, -1)]
                print(kind, f"{posture:.2f}", grasp.status, f"{grasp.quality:.3f}", ", ".join(grasp.touching))
    with (Path(__file__).parent / "icub_postures.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["grasp", *hand.joint_names])
        writer.writerows([kind, *(f"{angle:.4f}" for angle in angles)] for kind, *angles in rows)


if __name__ == "__main__":
    main()

"""Where a grasp starts from: the distance of the hand and the opposition of the thumb, found by a short search.

For each object and mode the search tries standoffs s from h/3 to h + 20 mm (h the half extent of the object's box
towards the hand) and thumb postures s1, and for each of them a grid of 15 x 7 offsets (dx, dy) over the bounds of
`surehold.problems.GraspProblem`, with graded contacts and a soft touch of 3 mm, that counts what is firmly touched. Of
the pairs that leave a third to two thirds of these poses free of collision it takes the one with the highest mean
quality; without such a pair, of those nearest to that range.
The table holds what was found for the shipped objects, the left iCub hand and its power grasp; what is found for other
hands and for meshes is kept in the cache folder.
`python -m surehold.problems.grasp.default_poses` repeats the search for the shipped objects and prints the table below.
"""

import json
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.synergy import closing_motion, preshape_of
from surehold.grasping.object.distance_field import cache_folder, content_hash
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import OBJECTS, shipped_object
from surehold.grasping.poses import MODES, Pose, default_pose, facet_axes
from surehold.grasping.simulator import Simulator
from surehold.store.atomic import replacing

__all__ = ["GraspDefault", "default_facet", "grasp_default", "search_default"]


class GraspDefault(NamedTuple):
    """The default of a mode."""

    standoff: float  #: distance of the hand's grasp center from the center of the object's box [m]
    s1: float  #: posture variable [rad]


_FORMAT: Final = 1  # part of the name of cached results: a change of the search must not find old ones
_DEPTH: Final = 0.003  # of the soft touch in the search [m]
_FREE_SHARE: Final = (1.0 / 3.0, 2.0 / 3.0)  # of the coarse grid: 30 to 70 % of all poses, with a margin

#: (object, mode) -> standoff [mm], s1 [rad]; printed by this module
_TABLE: Final[dict[tuple[str, str], tuple[float, float]]] = {
    ("mug", "right-front"): (23.7, -0.95),
    ("mug", "right-back"): (23.7, -0.95),
    ("mug", "right-top"): (23.7, -0.20),
    ("mug", "right-bottom"): (23.7, -0.70),
    ("mug", "front-right"): (39.2, -0.95),
    ("mug", "front-left"): (39.2, -0.95),
    ("mug", "front-top"): (52.3, -1.20),
    ("mug", "front-bottom"): (52.3, -1.20),
    ("mug", "left-front"): (23.7, -0.95),
    ("mug", "left-back"): (23.7, -0.95),
    ("mug", "left-top"): (23.7, -1.20),
    ("mug", "left-bottom"): (23.7, -0.20),
    ("mug", "back-right"): (45.7, -0.20),
    ("mug", "back-left"): (52.3, -1.20),
    ("mug", "back-top"): (39.2, -1.20),
    ("mug", "back-bottom"): (39.2, -1.20),
    ("mug", "top-right"): (33.1, -0.20),
    ("mug", "top-front"): (44.5, -0.70),
    ("mug", "top-left"): (33.1, -0.70),
    ("mug", "top-back"): (33.1, -0.45),
    ("mug", "bottom-right"): (33.1, 0.10),
    ("mug", "bottom-front"): (44.5, -1.20),
    ("mug", "bottom-left"): (44.5, -1.20),
    ("mug", "bottom-back"): (38.8, 0.10),
    ("bottle", "right-front"): (8.7, -0.70),
    ("bottle", "front-left"): (8.7, -0.70),
    ("bottle", "left-back"): (8.7, -0.70),
    ("bottle", "back-right"): (8.7, -0.70),
    ("bottle", "right-back"): (8.7, -0.45),
    ("bottle", "back-left"): (8.7, -0.45),
    ("bottle", "left-front"): (8.7, -0.45),
    ("bottle", "front-right"): (8.7, -0.45),
    ("bottle", "right-top"): (17.1, 0.10),
    ("bottle", "front-top"): (17.1, 0.10),
    ("bottle", "left-top"): (17.1, 0.10),
    ("bottle", "back-top"): (17.1, 0.10),
    ("bottle", "right-bottom"): (17.1, 0.10),
    ("bottle", "front-bottom"): (17.1, 0.10),
    ("bottle", "left-bottom"): (17.1, 0.10),
    ("bottle", "back-bottom"): (17.1, 0.10),
    ("bottle", "top-right"): (59.3, -0.95),
    ("bottle", "top-front"): (59.3, -0.95),
    ("bottle", "top-left"): (59.3, -0.95),
    ("bottle", "top-back"): (59.3, -0.95),
    ("bottle", "bottom-right"): (75.6, -1.20),
    ("bottle", "bottom-front"): (75.6, -1.20),
    ("bottle", "bottom-left"): (75.6, -1.20),
    ("bottle", "bottom-back"): (75.6, -1.20),
    ("glass", "right-front"): (16.7, -0.45),
    ("glass", "front-left"): (16.7, -0.45),
    ("glass", "left-back"): (16.7, -0.45),
    ("glass", "back-right"): (16.7, -0.45),
    ("glass", "right-back"): (16.7, -0.45),
    ("glass", "back-left"): (16.7, -0.45),
    ("glass", "left-front"): (16.7, -0.45),
    ("glass", "front-right"): (16.7, -0.45),
    ("glass", "right-top"): (36.1, 0.10),
    ("glass", "front-top"): (36.1, 0.10),
    ("glass", "left-top"): (36.1, 0.10),
    ("glass", "back-top"): (36.1, 0.10),
    ("glass", "right-bottom"): (31.2, 0.10),
    ("glass", "front-bottom"): (31.2, 0.10),
    ("glass", "left-bottom"): (31.2, 0.10),
    ("glass", "back-bottom"): (31.2, 0.10),
    ("glass", "top-right"): (75.2, -1.20),
    ("glass", "top-front"): (75.2, -1.20),
    ("glass", "top-left"): (75.2, -1.20),
    ("glass", "top-back"): (75.2, -1.20),
    ("glass", "bottom-right"): (83.3, -1.20),
    ("glass", "bottom-front"): (83.3, -1.20),
    ("glass", "bottom-left"): (83.3, -1.20),
    ("glass", "bottom-back"): (83.3, -1.20),
    ("drill", "right-front"): (68.7, 0.10),
    ("drill", "right-back"): (31.7, -1.20),
    ("drill", "right-top"): (78.0, -0.20),
    ("drill", "right-bottom"): (78.0, -0.45),
    ("drill", "front-right"): (14.4, -0.45),
    ("drill", "front-left"): (14.4, -0.95),
    ("drill", "front-top"): (14.4, -0.45),
    ("drill", "front-bottom"): (14.4, -0.45),
    ("drill", "left-front"): (78.0, -0.70),
    ("drill", "left-back"): (87.2, -1.20),
    ("drill", "left-top"): (87.2, -1.20),
    ("drill", "left-bottom"): (87.2, 0.10),
    ("drill", "back-right"): (14.4, -0.95),
    ("drill", "back-left"): (14.4, -0.95),
    ("drill", "back-top"): (10.0, -0.20),
    ("drill", "back-bottom"): (14.4, -0.45),
    ("drill", "top-right"): (74.4, 0.10),
    ("drill", "top-front"): (74.4, -0.45),
    ("drill", "top-left"): (74.4, -1.20),
    ("drill", "top-back"): (74.4, -0.45),
    ("drill", "bottom-right"): (74.4, -0.70),
    ("drill", "bottom-front"): (83.3, -0.95),
    ("drill", "bottom-left"): (74.4, -0.95),
    ("drill", "bottom-back"): (83.3, -0.45),
}


def grasp_default(
    simulator: Simulator, mode: str, progress: Callable[[float], None] = lambda share: None
) -> GraspDefault:
    """Return the default of a mode: from the table for a shipped object, else by the search (some seconds).

    What was searched is kept in the cache folder. `progress` is called with the share of a search that is done.
    """
    hand, obj = simulator.hand, simulator.object
    if _is_shipped(obj) and hand.name == "icub-left" and simulator.preshape == "power":
        standoff, s1 = _TABLE[(obj.name, mode)]
        return GraspDefault(standoff * 1e-3, s1)
    numbers = (
        np.round(obj.vertices, 9),
        obj.faces,
        obj.axes,
        np.array([obj.friction if hand.friction is None else hand.friction]),
        *hand.arrays(),
    )
    path = cache_folder() / "defaults" / f"{content_hash(f'{_FORMAT} {simulator.preshape} {mode}', *numbers)}.json"
    known = _load(path)
    if known is None:
        known = search_default(Simulator(hand, obj, preshape=simulator.preshape, depth=_DEPTH), mode, progress)
        with suppress(OSError):  # a folder that cannot be written costs time at the next start and nothing else
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as file:
                file.write(json.dumps(known).encode())
    return known


def default_facet(obj: GraspObject) -> str:
    """Return the mode in which an object is grasped where none is asked for.

    The drill is held at its grip and battery: from the side no grasp is found that holds when the hand is off.
    """
    return "bottom-front" if obj.name == "drill" and _is_shipped(obj) else "right-front"


def _is_shipped(obj: GraspObject) -> bool:
    """Return whether an object has the shape of the shipped one of its name."""
    return obj.name in OBJECTS and np.array_equal(obj.vertices, shipped_object(obj.name).vertices)


def _load(path: Path) -> GraspDefault | None:
    try:
        standoff, s1 = json.loads(path.read_text())
        return GraspDefault(float(standoff), float(s1))
    except (OSError, ValueError, TypeError):
        return None


def search_default(
    simulator: Simulator, mode: str, progress: Callable[[float], None] = lambda share: None
) -> GraspDefault:
    """Search standoff and s1 of a mode as the module says."""
    along, across, depth = np.abs(facet_axes(mode).T) @ simulator.object.box_half_extents
    offsets = [(dx, dy) for dx in (along + 0.025) * _middles(15) for dy in across * _middles(7)]
    candidates: list[tuple[float, GraspDefault, list[Pose]]] = []
    standoffs = np.round(np.linspace(depth / 3.0, depth + 0.020, 10), 4).tolist()
    for step, standoff in enumerate(standoffs):
        poses = [
            default_pose(simulator.hand, simulator.object, mode, standoff, (*offset, 0, 0, 0, 0)) for offset in offsets
        ]
        for s1 in preshape_of(simulator.hand, simulator.preshape).s1_tries:
            opened = closing_motion(simulator.hand, s1, simulator.preshape).joints(0.0)
            free = [pose for pose in poses if simulator.gaps(pose, opened).min() >= 0.0]
            share = len(free) / len(poses)
            outside = max(_FREE_SHARE[0] - share, share - _FREE_SHARE[1], 0.0)
            candidates.append((outside, GraspDefault(standoff, s1), free))
        progress(0.5 * (step + 1) / len(standoffs))
    nearest = min(outside for outside, _, _ in candidates)
    eligible = [(default, free) for outside, default, free in candidates if outside == nearest]
    totals = []
    for step, (default, free) in enumerate(eligible):
        totals.append(sum(simulator.grasp(pose, default.s1).quality for pose in free))
        progress(0.5 + 0.5 * (step + 1) / len(eligible))
    return eligible[int(np.argmax(totals))][0]


def _middles(n: int) -> NDArray[np.float64]:
    """Return the middles of n equal parts of [-1, 1]."""
    return (2.0 * np.arange(n) + 1.0) / n - 1.0


def _main() -> None:
    for name in sys.argv[1:] or OBJECTS:
        simulator = Simulator(obj=name, depth=_DEPTH)
        for mode in MODES:
            found = search_default(simulator, mode)
            print(f'    ("{name}", "{mode}"): ({found.standoff * 1e3:.1f}, {found.s1:.2f}),', flush=True)  # noqa: T201


if __name__ == "__main__":
    _main()

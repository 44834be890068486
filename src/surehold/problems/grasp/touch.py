"""What a trial tells of the shape: where the hand touched, with which normals, and which space it swept free.

A trial of a real hand begins with an approach, along the palm's normal; a hand that meets the object on its way stops
there, and that is a touch too. With `probe` the closing ends at the first touch as well. In simulation the hand feels
the object as far away as `_FELT`; a robot tells points and normals (told_contacts.py).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.closing.contacts import Contacts
from surehold.grasping.grasp import Grasp
from surehold.grasping.hand.kinematics import link_ends
from surehold.grasping.hand.synergy import closing_motion
from surehold.grasping.pictures.scene import closing_steps
from surehold.grasping.poses import Pose
from surehold.grasping.shape.implicit_surface import Observations, spaced
from surehold.grasping.simulator import Simulator
from surehold.problems.grasp.told_contacts import touches

__all__ = ["Touch", "touch_trial"]

Array = NDArray[np.float64]

_FELT: Final = 0.001  # gap at which the skin feels the object [m]
_SPACING: Final = 0.010  # touches in the same cube of this edge count once [m]
_FREE_SPACING: Final = 0.012  # m
_BACK: Final = 0.15  # from where a hand approaches [m]


@dataclass(frozen=True, eq=False)
class Touch:
    """What became of a trial that feels."""

    grasp: Grasp  #: with quality 0 or below where the hand stopped on its way
    observations: Observations  #: of the shape, in the object's frame


def touch_trial(simulator: Simulator, pose: Pose, s1: float | tuple[float, ...], probe: bool = False) -> Touch:
    """Close a hand on the object of a simulator, and feel it; `pose` is relative to the object."""
    motion = closing_motion(simulator.hand, s1, simulator.preshape)
    opened = motion.joints(0.0)
    stop = _approach(simulator, pose, opened)
    grasp = simulator.grasp(simulator.object_pose @ pose, s1)
    if stop is not None or grasp.status == "initial collision":
        where = pose if stop is None else _shifted(pose, -stop)
        felt = _felt(simulator.contacts_at(where, opened), simulator.depth) if stop is not None else Observations()
        swept = [(_shifted(pose, -t), opened) for t in np.arange(stop, _BACK, 0.02)] if stop is not None else []
        return Touch(grasp, felt + Observations(free=_swept(simulator, swept)))
    steps = closing_steps(simulator, grasp)
    if probe:
        # Up to the first step at which a link stands still: it touches there.
        first = next((k for k, joints in enumerate(steps) if _touching(simulator, pose, joints)), len(steps) - 1)
        steps = steps[: first + 1]
    felt = _felt(simulator.contacts_at(pose, steps[-1]), simulator.depth)
    moved = [(pose, joints) for joints in steps[:: max(1, len(steps) // 8)]]
    back = [(_shifted(pose, -t), opened) for t in (0.02, 0.05, 0.09)]
    return Touch(grasp, felt + Observations(free=_swept(simulator, moved + back)))


def _felt(contacts: Contacts, depth: float) -> Observations:
    """Return the contacts whose skin is nearer than `_FELT`, one for each spot. Their normals point into the object."""
    near = np.flatnonzero(contacts.weights > 1.0 - _FELT / depth)
    near = near[np.argsort(-contacts.weights[near], kind="stable")]
    near = near[spaced(contacts.points[near], _SPACING)] if len(near) else near
    return touches(contacts.points[near], -contacts.normals[near])


def _swept(simulator: Simulator, placed: list[tuple[Pose, Array]]) -> Array:
    """Return points (b, 4) on the axes of the links of a hand that is free of the object, and the links' radii."""
    rows = [np.empty((0, 4))]
    hand = simulator.hand
    radii = hand.radii.ravel()
    for pose, joints in placed:
        bases = np.concatenate(
            [pose.rotation @ hand.bases[:, :, :3], pose.apply(hand.bases[:, :, 3])[:, :, None]], axis=2
        )
        ends = link_ends(np.ascontiguousarray(bases), hand.chains, np.ascontiguousarray(joints))
        for share in (0.0, 0.5, 1.0):
            axis = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
            rows.append(np.column_stack([axis, radii])[radii > 0.0])
    every = np.vstack(rows)
    return every[spaced(every[:, :3], _FREE_SPACING)] if len(every) else every


def _approach(simulator: Simulator, pose: Pose, opened: Array) -> float | None:
    """Return how far before its goal an open hand on its way there meets the object [m], or None if it does not.

    The hand moves along its palm's z; a hand that meets the object where it starts tells nothing and counts as free.
    """
    left = _BACK
    while left > 0.0:
        gap = float(simulator.gaps(_shifted(pose, -left), opened).min())
        if gap < 1e-4:
            return left if left < _BACK else None
        left -= max(gap, 1e-4)
    return None


def _touching(simulator: Simulator, pose: Pose, joints: Array) -> bool:
    return float(simulator.gaps(pose, joints).min()) < 3e-4


def _shifted(pose: Pose, along: float) -> Pose:
    """Return the pose moved along its own z [m]."""
    place = np.asarray(pose.position) + along * pose.rotation[:, 2]
    return Pose((float(place[0]), float(place[1]), float(place[2])), pose.quaternion)

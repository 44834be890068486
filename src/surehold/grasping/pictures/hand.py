"""What a picture of a hand alone needs: its bodies while it closes, the axes of its palm and of its joints."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.kinematics import link_frames
from surehold.grasping.hand.model import CLOSED, Hand
from surehold.grasping.hand.synergy import closing_motion
from surehold.grasping.pictures.scene import STEPS, SceneMesh, capsule_mesh, hand_meshes
from surehold.grasping.poses import Pose

__all__ = ["HandScene", "hand_scene"]

_AXIS: Final = 0.35  # length of the palm's axes, of the size of the hand
_ROD: Final = 0.07  # half length of the rod along a joint's axis, of the size of the hand
_AROUND: Final = 24  # corners around an arrow's head


class HandScene(NamedTuple):
    """A hand in its palm frame, while it closes or open."""

    bodies: tuple[SceneMesh, ...]  #: the palm's boxes and the links
    axes: tuple[SceneMesh, ...]  #: arrows "x", "y" and "z" of the palm frame
    joints: tuple[SceneMesh, ...]  #: a rod along the axis of each joint, named as the joint
    grasp_center: SceneMesh  #: a ball


def hand_scene(hand: Hand, preshape: str, opened: bool = False) -> HandScene:
    """Return the scene of a hand that closes in a preshape, or rests `opened`; nothing stops it."""
    motion = closing_motion(hand, 0.0, preshape)
    times = np.zeros(1) if opened else np.linspace(0.0, CLOSED, STEPS)
    steps = np.stack([motion.joints(float(t)) for t in times])  # (k, f, j)
    bodies = hand_meshes(hand, Pose(), steps)
    size = _size(hand, motion.joints(0.0))
    frames = np.stack([link_frames(hand.bases, hand.chains, np.ascontiguousarray(q)) for q in steps])
    rod = capsule_mesh(np.array([0.0, 0.0, -_ROD * size]), np.array([0.0, 0.0, _ROD * size]), 0.007 * size)
    return HandScene(
        tuple(bodies),
        tuple(_arrow(name, axis, _AXIS * size) for name, axis in zip("xyz", np.eye(3), strict=True)),
        tuple(_mesh(name, *rod, frames[:, i]) for i, name in enumerate(hand.joint_names) if name),
        _mesh("grasp center", *_ball(hand.grasp_center, 0.03 * size)),
    )


def _size(hand: Hand, q: NDArray[np.float64]) -> float:
    """Return how far the links of a hand reach from its palm frame's origin [m]."""
    frames = link_frames(hand.bases, hand.chains, np.ascontiguousarray(q))
    return float(np.linalg.norm(frames[hand.radii.ravel() > 0.0, :, 3], axis=1).max())


def _mesh(
    name: str,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    poses: NDArray[np.float64] | None = None,
) -> SceneMesh:
    where = np.eye(3, 4)[None] if poses is None else poses
    return SceneMesh(name, vertices.astype(np.float32), faces, where.astype(np.float32))


def _ball(center: NDArray[np.float64], radius: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    along = np.array([0.0, 0.0, 1e-3 * radius])
    return capsule_mesh(center - along, center + along, radius)


def _arrow(name: str, axis: NDArray[np.float64], length: float) -> SceneMesh:
    """Return an arrow from the origin: a shaft with a cone on it."""
    shaft, faces = capsule_mesh(np.zeros(3), 0.8 * length * axis, 0.025 * length)
    first, second = np.roll(axis, 1), np.roll(axis, 2)
    turn = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    foot = 0.78 * length * axis
    ring = foot + 0.075 * length * (np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second))
    n = len(shaft)
    i = n + np.arange(_AROUND)
    j = n + (np.arange(_AROUND) + 1) % _AROUND
    below, tip = np.full(_AROUND, n + _AROUND), np.full(_AROUND, n + _AROUND + 1)
    cone = np.vstack([np.column_stack([below, j, i]), np.column_stack([i, j, tip])]).astype(np.int32)
    return _mesh(name, np.vstack([shaft, ring, foot[None], length * axis[None]]), np.vstack([faces, cone]))

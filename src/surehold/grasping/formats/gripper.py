"""A hand as files of grasps know it: the frame that is placed, joints by name.

gripper frame   the body that a file names, by the last word of its path, where the hand's model has it; else the body
                of the palm in that model, which is what is written; the palm frame of a built-in hand
root frame      the frame of the model's file; the palm frame of a built-in hand
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.formats.stored import GraspFile, StoredGrasp
from surehold.grasping.grasp import Grasp
from surehold.grasping.hand.model import CLOSED, Hand, Preshape
from surehold.grasping.poses import Pose

__all__ = [
    "check_joints",
    "closing_hand",
    "described_gripper",
    "in_root_frame",
    "joint_order",
    "palm_pose",
    "stored_grasp",
    "unknown_frame",
]

Array = NDArray[np.float64]

SQUEEZE: Final = (0.1, 0.005)  #: how far the fastest joint goes on to squeeze [rad, m]
BEYOND: Final = 1.5  #: a hand of a file closes up to so many times the way that the file says, where nothing stops it


def stored_grasp(hand: Hand, grasp: Grasp, preshape: Preshape, name: str, confidence: float) -> StoredGrasp:
    """Return a grasp as a file of grasps holds it, placed by the gripper frame; confidence is cut to [0, 1]."""
    pose = grasp.pose @ _frame(hand, rooted=False).inverse()
    slides = hand.chains[:, :, 0] > 0.0
    rate = preshape.rate / max(float(np.abs(preshape.rate).max()), 1e-12)
    squeeze = np.clip(grasp.joints + rate * np.where(slides, SQUEEZE[1], SQUEEZE[0]), hand.lower, hand.upper)
    return StoredGrasp(
        name,
        min(max(float(confidence), 0.0), 1.0),
        pose.position,
        pose.quaternion,
        *(_named(hand, joints) for joints in (grasp.joints, grasp.open_joints, squeeze)),
        posture=grasp.s1,
        quality=float(grasp.quality),
    )


def described_gripper(hand: Hand, preshape: Preshape, file: GraspFile) -> GraspFile:
    """Return a file of grasps with what it says of the gripper: frame, model, finger tips, the open limit."""
    rate = preshape.rate.ravel()
    first = int(np.argmax(np.abs(rate) > 1e-9))
    per_finger = hand.radii.shape[1]
    tips = [int(np.flatnonzero(radii > 0.0)[-1]) + f * per_finger for f, radii in enumerate(hand.radii)]
    return replace(
        file,
        gripper_frame=hand.model.body if hand.model else f"{hand.name} palm",
        gripper_file=hand.model.file if hand.model else "",
        finger_colliders=tuple(hand.link_names[tip] for tip in tips),
        open_limit="lower" if rate[first] > 0.0 else "upper",
    )


def in_root_frame(hand: Hand, file: GraspFile) -> GraspFile:
    """Return a file of grasps whose poses place the hand's root frame instead of its gripper frame."""
    onward = _frame(hand, rooted=False) @ _frame(hand, rooted=True).inverse()
    poses = [grasp.pose @ onward for grasp in file.grasps]
    grasps = [
        replace(grasp, position=pose.position, orientation=pose.quaternion)
        for grasp, pose in zip(file.grasps, poses, strict=True)
    ]
    return replace(file, grasps=tuple(grasps), gripper_frame="")


def palm_pose(hand: Hand, file: GraspFile, grasp: StoredGrasp) -> Pose:
    """Return the pose of the palm frame in the object's frame of a grasp of a file.

    A file that names no gripper frame places the root frame; one that names a body of the model places that, and one
    that names anything else the palm's body (`unknown_frame`).

    Raises
    ------
    InputError
        If the file names a body that a finger moves.
    """
    name, model = _frame_name(file), hand.model
    if model is not None and name in model.moved:
        raise InputError(
            f"the file's gripper frame is {name!r}, which a finger of hand '{hand.name}' moves; name a body that moves "
            f"with the palm, such as {model.body!r}."
        )
    if model is not None and name in model.frames:
        return grasp.pose @ Pose.from_matrix(model.frames[name])
    return grasp.pose @ _frame(hand, rooted=not file.gripper_frame)


def unknown_frame(hand: Hand, file: GraspFile) -> str:
    """Return what is to be said of a gripper frame that the hand does not have, "" if it has it or none is named."""
    name = _frame_name(file)
    own = [f"{hand.name} palm"] if hand.model is None else [*hand.model.frames, *hand.model.moved]
    if not name or name in own:
        return ""
    palm = own[0] if hand.model is None else hand.model.body
    return f"The file's gripper frame {name!r} is none of hand {hand.name}; it is taken for {palm!r}."


def _frame_name(file: GraspFile) -> str:
    """Return the name of the gripper frame without the path that Isaac Sim puts before it."""
    return file.gripper_frame.rstrip("/").rpartition("/")[2]


def joint_order(hand: Hand) -> tuple[str, ...]:
    """Return the names of the joints in the order of the hand's model; of a built-in hand, in its own."""
    return hand.model.joints if hand.model else tuple(name for name in hand.joint_names if name)


def closing_hand(hand: Hand, opened: Mapping[str, float], closed: Mapping[str, float]) -> Hand:
    """Return the hand with one preshape that closes from the open to the closed joints of a file, by their names.

    A hand that was stored as it stood on the surface, or a little off it, closes until it touches: up to `BEYOND` times
    the way. Joints that only the model has, and no finger moves, may be named too; those that are not named stay where
    they are open, and a file without open joints begins with those of the hand's first preshape.

    Raises
    ------
    InputError
        If a name is neither of the hand nor of its model, or nothing moves.
    """
    first = next(iter(hand.preshapes.values()))
    start = np.clip(first.start, hand.lower, hand.upper)
    if opened:
        start = _by_name(hand, opened, np.clip(0.0, hand.lower, hand.upper))
    end = _by_name(hand, closed, start)
    if np.allclose(start, end):
        raise InputError(f"the file's joints do not close hand '{hand.name}': open and closed are the same.")
    rate = BEYOND * (end - start) / CLOSED
    none = (0.0, 0.0)
    return replace(hand, preshapes={"file": Preshape(start, rate, np.zeros_like(start), none, none, (0.0,))})


def check_joints(hand: Hand, values: Mapping[str, float]) -> None:
    """Raise InputError if a name of a file's joints is neither of the hand nor of its model, or none is the hand's."""
    known = [name for name in hand.joint_names if name]
    also = hand.model.joints if hand.model else ()
    strange = [name for name in values if name not in known and name not in also]
    if strange or not any(name in values for name in known):
        raise InputError(
            f"the file's joints {_few(strange or list(values))} are none of hand '{hand.name}', which has "
            f"{_few(known)}; give the hand of the file with --hand."
        )


def _by_name(hand: Hand, values: Mapping[str, float], rest: Array) -> Array:
    check_joints(hand, values)
    joints = rest.copy().ravel()
    for i, name in enumerate(hand.joint_names):
        if name in values:
            joints[i] = values[name]
    return np.clip(joints.reshape(rest.shape), hand.lower, hand.upper)


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")


def _named(hand: Hand, joints: Array) -> dict[str, float]:
    """Return joint angles by name: those that no finger moves at rest, in the order of the model."""
    moved = {name: float(q) for name, q in zip(hand.joint_names, joints.ravel(), strict=True) if name}
    if hand.model is None:
        return moved
    return {name: moved.get(name, rest) for name, rest in zip(hand.model.joints, hand.model.rest, strict=True) if name}


def _frame(hand: Hand, rooted: bool) -> Pose:
    """Return the pose of the palm frame in the root frame or in the gripper frame."""
    if hand.model is None:
        return Pose()
    return Pose.from_matrix(hand.model.in_root if rooted else hand.model.in_body)

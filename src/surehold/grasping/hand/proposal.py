"""A description for a hand that nobody has described: what closes, in which direction, and where an object belongs.

    f, j    fingers, joints of a finger      s    unit vector from the opposed finger to the others
    d       unit vector from a finger's base to its tip, open         m    direction in which its tip starts to close

`skeleton.py` says what is palm and finger; the rest is decided by where the tips go:

1. *Meeting.* The posture is sought in which the tips come nearest to each other, with a slight pull to rest. The joints
   of a finger whose axes at rest are parallel to that of its last joint (within 40 degrees) bend it, or slide it; the
   others spread or oppose it. Those of the opposed finger (the thumb) stay where they are when the tips meet, those of
   all other fingers at rest.
2. *Closing directions.* Several joints that have room in one sense only close in that. Of all combinations of the other
   fingers' senses the one is taken on whose way the tips come nearest to their common middle, of equal ones that which
   brings them there from farther away. Closed is the end of the range (of a joint without limits 90 degrees or 50 mm
   on), open is rest, or the other end where a finger slides, has one joint, or rests where it is closed. A gripper of
   several joints opens up to 30 degrees wider.
3. *Opposed finger.* The one without which d and m of the others agree best.
4. *Palm frame.* Where the fingers stand apart in the direction in which they close, as in a gripper, the palm's front
   is where they point and start to: z = d + m of both sides, and x = s; where they slide, z leads from the palm to the
   tips. Else the palm's front is where the others bend to: x = d and z = m. Axes within 15 degrees of those of the
   palm's body are these.
5. *Where an object belongs.* Of a gripper two thirds of the way from the palm to the tips; of a hand before the place
   where the fingers begin, as far from the palm as a third of a finger is long.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import read_model
from surehold.grasping.hand.skeleton import skeleton_of
from surehold.grasping.hand.undescribed import UndescribedHand

__all__ = ["Proposal", "propose_hand"]

Array = NDArray[np.float64]
_SNAP: Final = np.cos(np.radians(15.0))
_GRIPPER: Final = 0.6  # share of closing in the direction in which fingers stand apart
_START: Final = 0.15  # of the way to closed, over which the direction of closing is taken
_LONGEST_NAME: Final = 60


class Proposal(NamedTuple):
    """A description, and what it was made of."""

    config: HandConfig
    ranges: Mapping[str, tuple[float, float]]  #: of the joints that have roles [rad or m]
    #: of every joint of a finger: "bends", "slides", "spreads", "opposes", "follows .." or "rests"; of others "drives"
    roles: Mapping[str, str]
    opposed: str  #: the finger that the others close against
    gripper: bool  #: whether the fingers stand apart in the direction in which they close
    resting: tuple[str, ...]  #: joints below the palm that no finger has and that drive none: they stay at rest


def propose_hand(model: str | Path, palm: str = "") -> Proposal:
    """Return a description of the hand in a model file (.xml of MuJoCo or .urdf), as the module says.

    `palm` names a body below which the hand is looked for, where a model has more than one hand.

    Raises
    ------
    InputError
        If the file cannot be read, or the model has no two fingers that can close.
    """
    mujoco, compiled = read_model(model)
    skeleton = skeleton_of(mujoco, compiled, str(model), palm)
    hand = UndescribedHand(str(model), mujoco, compiled, skeleton)
    meeting, bending = hand.meeting(), hand.bending()
    others = [
        {j: _rounded_within(meeting[j], hand.ranges[j]) for j in joints if j in meeting and not _any(j, bending)}
        for joints in skeleton.fingers.values()
    ]
    opened, closed = hand.closing(bending, {j: v for group in others for j, v in group.items()})
    opposed = _opposed(*_directions(hand, opened, closed))
    opened = {**others[opposed], **opened}
    x, z, center, gripper = _palm_frame(hand, opened, closed, opposed)
    if gripper:
        opened = hand.widened(bending, opened, closed)
    names = list(skeleton.fingers)
    if not gripper and names[opposed].startswith("finger_") and "thumb" not in names:
        names[opposed] = "thumb"
    moved = {j: round(v, 4) for j, v in opened.items() if abs(v - hand.at_rest(j)) > 1e-4}
    preshape = {"open": moved, "closed": {j: round(v, 4) for j, v in closed.items()}}
    description = {
        "name": Path(model).stem[:_LONGEST_NAME],
        "palm": {
            "body": skeleton.palm,
            "x": _rounded(x, 4),
            "z": _rounded(z, 4),
            "grasp_center": _rounded(center, 3),
        },
        "fingers": {name: list(joints) for name, joints in zip(names, skeleton.fingers.values(), strict=True)},
        "preshapes": {"pinch" if gripper and len(names) == 2 else "power": preshape},
    }
    roles = _roles(hand, bending, opposed)
    resting = tuple(joint for joint in skeleton.others if joint not in roles)
    ranges = {joint: hand.ranges[joint] for joint in roles}
    return Proposal(HandConfig.model_validate(description), ranges, roles, names[opposed], gripper, resting)


def _any(joint: str, groups: Sequence[Mapping[str, float]]) -> bool:
    return any(joint in group for group in groups)


def _directions(hand: UndescribedHand, opened: Mapping[str, float], closed: Mapping[str, float]) -> tuple[Array, Array]:
    """Return d and m (f, 3)."""
    q = hand.posture(opened)
    tips, frames = hand.tips.at(q), hand.tips.frames(q)
    soon = {j: v + _START * (closed.get(j, v) - v) for j, v in opened.items()}
    bases = []
    for joints in hand.skeleton.fingers.values():
        first = next((j for j in joints if hand.leader_of(j) in closed), joints[0])
        bases.append(frames[hand.place[first]][:, 3])
    return _unit(tips - np.array(bases)), _unit(hand.tips.at(hand.posture(soon)) - tips)


def _opposed(d: Array, m: Array) -> int:
    """Return the finger without which the others agree best."""
    agree = [sum(float(np.linalg.norm(np.delete(v, f, axis=0).mean(axis=0))) for v in (d, m)) for f in range(len(d))]
    return int(np.argmax(np.round(agree, 6)))


def _palm_frame(
    hand: UndescribedHand, opened: Mapping[str, float], closed: Mapping[str, float], opposed: int
) -> tuple[Array, Array, Array, bool]:
    """Return x, z and grasp center (3,) of the palm frame, and whether it is that of a gripper."""
    d, m = _directions(hand, opened, closed)
    way, bases = hand.way(opened, closed), hand.hand.bases[:, :, 3]
    rest = [f for f in range(len(d)) if f != opposed]
    sliding = all(j in hand.place and hand.slides[hand.place[j]] for j in closed)
    stand = way[0] if sliding else bases
    s = _unit(stand[rest].mean(axis=0) - stand[opposed])
    along, bent = _unit(d[rest].mean(axis=0)), _unit(m[rest].mean(axis=0))
    gripper = sliding or float(-bent @ s) >= _GRIPPER
    if sliding:
        x, z = _at_right_angles(s, way[0].mean(axis=0) - _middle_of_palm(hand))
    elif gripper:
        z, x = _at_right_angles(along + bent + d[opposed] + m[opposed], s)
    else:
        x, z = _at_right_angles(along, bent)
    turn = np.column_stack([x, np.cross(z, x), z])
    front = _front_of_palm(hand, x, z, gripper)
    if gripper:
        middle = way.mean(axis=1) @ turn
        meet = int(np.linalg.norm(way - way.mean(axis=1, keepdims=True), axis=2).mean(axis=1).argmin())
        return x, z, np.array([*middle[meet, :2], front + 0.65 * (middle[:, 2].max() - front)]), True
    return x, z, np.array([*(bases[rest].mean(axis=0) @ turn)[:2], front + 0.33 * hand.length]), False


def _middle_of_palm(hand: UndescribedHand) -> Array:
    """Return the middle (3,) of the palm's boxes, of the fingers' bases where it has none."""
    poses = hand.hand.palm_poses if len(hand.hand.palm_poses) else hand.hand.bases
    return poses[:, :, 3].mean(axis=0)


def _front_of_palm(hand: UndescribedHand, x: Array, z: Array, gripper: bool) -> float:
    """Return how far the palm's boxes reach along z, the fingers' first joints where it has none [m].

    Of a hand those boxes count that reach to the half of it, along x, where the fingers begin: a wrist is no palm.
    """
    poses, half, bases = hand.hand.palm_poses, hand.hand.palm_half_extents, hand.hand.bases
    if not len(poses):
        return float(_middle_of_palm(hand) @ z)
    middles = poses[:, :, 3]
    along, out = (np.abs(np.einsum("pij,i->pj", poses[:, :, :3], axis) * half).sum(axis=1) for axis in (x, z))
    halfway = 0.5 * ((middles @ x - along).min() + (bases[:, :, 3] @ x).max())
    counted = (middles @ x + along >= halfway) | gripper
    return float((middles @ z + out)[counted if counted.any() else slice(None)].max())


def _roles(hand: UndescribedHand, bending: Sequence[Mapping[str, float]], opposed: int) -> dict[str, str]:
    roles = {joint: "drives" for joint in hand.leaders if joint not in hand.place}
    for f, joints in enumerate(hand.skeleton.fingers.values()):
        for joint in joints:
            leader = hand.leader_of(joint)
            if leader != joint:
                roles[joint] = f"follows {leader}" if leader else "rests"
            elif _any(joint, bending):
                roles[joint] = "slides" if hand.slides[hand.place[joint]] else "bends"
            else:
                roles[joint] = "opposes" if f == opposed else "spreads"
    return roles


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _at_right_angles(kept: Array, other: Array) -> tuple[Array, Array]:
    """Return unit vectors along the first and across it towards the other, snapped to axes that are near them."""
    kept = _snapped(_unit(kept))
    other = _snapped(_unit(other - (other @ kept) * kept))
    return kept, _unit(other - (other @ kept) * kept)


def _snapped(direction: Array) -> Array:
    k = int(np.argmax(np.abs(direction)))
    return np.sign(direction[k]) * np.eye(3)[k] if abs(direction[k]) >= _SNAP else direction


def _rounded(vector: Array, digits: int) -> list[float]:
    return [round(float(v), digits) + 0.0 for v in vector]


def _rounded_within(value: float, span: tuple[float, float]) -> float:
    return round(float(np.clip(round(value, 2), *span)), 4)

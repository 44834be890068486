"""A description for a hand that nobody has described: what closes, in which direction, and where an object belongs.

    f, j    fingers, joints of a finger      q    joint angles or shifts, (f, j), rad or m      t    closing, 0 to 1
    tip     far end of what the last joint of a finger moves          s    from the opposed finger to the others
    d       unit vector from a finger's base to its tip, open         m    direction in which its tip starts to close

All is decided by where the tips go (`skeleton.py` says what is palm and finger):

1. *Meeting.* The posture is sought in which the tips come nearest to each other, with a slight pull to rest. The joints
   of a finger whose axes there are parallel to that of its last joint (within 40 degrees) bend it, or slide it; the
   others spread or oppose it. Those of the opposed finger (the thumb) stay where they are when the tips meet, those of
   all other fingers at rest.
2. *Closing directions.* Each finger may bend either way. Of all combinations the one is taken on whose way the tips
   come nearest to their common center. Closed is the end of the range (of an unlimited joint 90 degrees on), open is
   rest, or the other end where a finger slides, has one joint, or rests where it is closed.
3. *Opposed finger.* The one without which d and m of the others agree best.
4. *Palm frame.* Where the fingers stand apart in the direction in which they close, as in a gripper, the palm's front is
   in their direction: z = d + m of all, across s, and x = s. Else the palm's front is where the others bend to: x = d
   and z = m, across d. Axes within 15 degrees of the model's own are those.
5. *Where an object belongs.* Of a gripper two thirds of the way from the palm to the tips; of a hand before the place
   where the fingers begin, as far from the palm as a third of a finger is long.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand, read_model
from surehold.grasping.hand.skeleton import Skeleton, skeleton_of
from surehold.grasping.hand.tips import Fingertips

__all__ = ["Proposal", "propose_hand"]

Array = NDArray[np.float64]
_PARALLEL: Final = np.cos(np.radians(40.0))
_SNAP: Final = np.cos(np.radians(15.0))
_PULL: Final = 0.03  # of rest on the meeting posture: a whole range weighs as much as 3 % of a finger's length
_GRIPPER: Final = 0.6  # share of closing in the direction in which fingers stand apart
_STEPS: Final = 9  # postures on the way from open to closed
_UNLIMITED: Final = 0.5 * np.pi  # closing motion of a joint without limits [rad]


class Proposal(NamedTuple):
    """A description, and what it was made of."""

    config: HandConfig
    ranges: Mapping[str, tuple[float, float]]  #: of every joint of a finger [rad or m]
    roles: Mapping[str, str]  #: of every joint of a finger: "bends", "slides", "spreads", "opposes" or "follows .."
    opposed: str  #: the finger that the others close against
    gripper: bool  #: whether the fingers stand apart in the direction in which they close
    resting: tuple[str, ...]  #: joints below the palm that no finger has


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
    return _Proposer(str(model), skeleton, compiled).proposal()


class _Proposer:
    """A hand whose palm frame is that of the palm's body, and its tips."""

    def __init__(self, model: str, skeleton: Skeleton, compiled: Any):
        self.file, self.skeleton = model, skeleton
        self.base = {
            "name": _name_of(model),
            "fingers": {finger: list(joints) for finger, joints in skeleton.fingers.items()},
            "coupling": {joint: coupling.model_dump() for joint, coupling in skeleton.coupling.items()},
        }
        self.leaders = [j for joints in skeleton.fingers.values() for j in joints if j not in skeleton.coupling]
        first = self.leaders[0]
        limited, span = compiled.joint(first).limited, compiled.joint(first).range
        end = (max(span, key=abs) if limited else 0.5) or 0.5
        palm = {"body": skeleton.palm, "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0]}
        preshapes = {"any": {"closed": {first: float(end)}}}
        if abs(end - np.clip(0.0, *span)) < 1e-12:
            preshapes = {"any": {"open": {first: float(span[0])}, "closed": {first: float(span[1])}}}
        self.hand = load_hand(model, HandConfig.model_validate({**self.base, "palm": palm, "preshapes": preshapes}))
        self.place = {name: divmod(i, self.hand.lower.shape[1]) for i, name in enumerate(self.hand.joint_names) if name}
        self.rest = np.clip(0.0, self.hand.lower, self.hand.upper)
        self.tips = Fingertips(self.hand)
        self.slides = self.tips.slides
        self.length = float(np.mean(self._extents()))

    def posture(self, values: Mapping[str, float]) -> Array:
        """Return joint angles (f, j) of the joints that lead; followers follow, the others rest."""
        q = self.rest.copy()
        for joint, value in values.items():
            q[self.place[joint]] = value
        for follower, coupling in self.skeleton.coupling.items():
            q[self.place[follower]] = coupling.factor * q[self.place[coupling.follows]] + coupling.offset
        return np.clip(q, self.hand.lower, self.hand.upper)

    def _extents(self) -> Array:
        """Return the distances (f,) from the first joint of each finger to its tip at rest."""
        return np.linalg.norm(self.tips.at(self.rest) - self.hand.bases[:, :, 3], axis=1)

    def _range(self, joint: str) -> tuple[float, float]:
        place = self.place[joint]
        return float(self.hand.lower[place]), float(self.hand.upper[place])

    def _round(self, joint: str, value: float) -> float:
        lower, upper = self._range(joint)
        return round(float(np.clip(round(value, 2), lower, upper)), 4)

    def meeting(self) -> dict[str, float]:
        """Return the posture of the leading joints in which the tips come nearest to each other."""
        from scipy.optimize import least_squares

        lower, upper = np.array([self._range(joint) for joint in self.leaders]).T
        rest = np.array([self.rest[self.place[joint]] for joint in self.leaders])

        def residuals(v: Array) -> Array:
            tips = self.tips.at(self.posture(dict(zip(self.leaders, v, strict=True))))
            apart = (tips - tips.mean(axis=0)) / self.length
            return np.concatenate([apart.ravel(), _PULL * (v - rest) / (upper - lower)])

        starts = [np.clip(rest, lower, upper), *(lower + share * (upper - lower) for share in (0.5, 0.8, 0.2))]
        inner = 1e-6 * (upper - lower)
        found = [
            least_squares(residuals, np.clip(s, lower + inner, upper - inner), bounds=(lower, upper), max_nfev=60)
            for s in starts
        ]
        best = min(found, key=lambda result: result.cost)
        return dict(zip(self.leaders, best.x.tolist(), strict=True))

    def bending(self) -> list[dict[str, float]]:
        """Return the leading joints that bend or slide each finger, and in which sense with its last joint: +1, -1."""
        frames, found = self.tips.frames(self.posture({})), []
        for joints in self.skeleton.fingers.values():
            last = self.place[joints[-1]]
            chosen: dict[str, float] = {}
            for joint in joints:
                place, leader, sense = (
                    self.place[joint],
                    joint,
                    float(frames[self.place[joint]][:, 2] @ frames[last][:, 2]),
                )
                if joint in self.skeleton.coupling:
                    leader = self.skeleton.coupling[joint].follows
                    sense *= float(np.sign(self.skeleton.coupling[joint].factor))
                if abs(sense) >= _PARALLEL and self.slides[place] == self.slides[last] and leader in joints:
                    chosen.setdefault(leader, float(np.sign(sense)))
            found.append(chosen)
        return found

    def ends(self, joints: Mapping[str, float], sense: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return open and closed values of the joints that bend a finger, if its last one closes in a sense."""
        opened, closed = {}, {}
        for joint, sign in joints.items():
            lower, upper = self._range(joint)
            rest = float(self.rest[self.place[joint]])
            if not self.slides[self.place[joint]] and upper - lower > 2.0 * np.pi - 1e-9:
                lower, upper = rest - _UNLIMITED, rest + _UNLIMITED
            near, far = (lower, upper) if sign * sense > 0.0 else (upper, lower)
            alone = self.slides[self.place[joint]] or len(self._finger_of(joint)) == 1
            opened[joint] = near if alone or abs(far - rest) < 0.4 * (upper - lower) else rest
            closed[joint] = far
        return opened, closed

    def _senses(self, joints: Mapping[str, float]) -> tuple[int, ...]:
        """Return the senses in which a finger may close: of several joints that have room in one sense only, that."""
        room = 0.0
        for joint, sign in joints.items():
            (lower, upper), rest = self._range(joint), float(self.rest[self.place[joint]])
            room += sign * (lower + upper - 2.0 * rest) / (upper - lower)
        alone = any(self.slides[self.place[j]] or len(self._finger_of(j)) == 1 for j in joints)
        return (1, -1) if alone or abs(room) < 0.3 * len(joints) else (int(np.sign(room)),)

    def _finger_of(self, joint: str) -> Sequence[str]:
        return next(joints for joints in self.skeleton.fingers.values() if joint in joints)

    def way(self, opened: Mapping[str, float], closed: Mapping[str, float]) -> Array:
        """Return the tips (t, f, 3) on the way from one posture to another."""
        shares = np.linspace(0.0, 1.0, _STEPS)
        return np.stack(
            [self.tips.at(self.posture({j: opened[j] + t * (closed[j] - opened[j]) for j in opened})) for t in shares]
        )

    def proposal(self) -> Proposal:
        meeting, bending = self.meeting(), self.bending()
        others = [
            {j: self._round(j, meeting[j]) for j in joints if j in meeting and not any(j in group for group in bending)}
            for joints in self.skeleton.fingers.values()
        ]
        opposing = {j: v for group in others for j, v in group.items()}
        found = []
        for senses in product(*map(self._senses, bending)):
            parts = [self.ends(group, sense) for group, sense in zip(bending, senses, strict=True)]
            opened = {j: v for part, _ in parts for j, v in part.items()}
            closed = {j: v for _, part in parts for j, v in part.items()}
            tips = self.way({**opposing, **opened}, {**opposing, **closed})
            apart = np.linalg.norm(tips - tips.mean(axis=1, keepdims=True), axis=2).mean(axis=1)
            nearest = round(float(apart.min()) / (0.02 * self.length))
            found.append((nearest, round(float(apart.min() - apart[0]), 9), opened, closed))
        _, _, opened, closed = min(found, key=lambda one: one[:2])
        thumb = self._opposed(opened, closed)
        return self._described({**others[thumb], **opened}, closed, thumb, bending)

    def _directions(self, opened: Mapping[str, float], closed: Mapping[str, float]) -> tuple[Array, Array]:
        """Return d and m (f, 3)."""
        start = self.tips.at(self.posture(opened))
        soon = {j: v + 0.15 * (closed.get(j, v) - v) for j, v in opened.items()}
        moved = self.tips.at(self.posture(soon)) - start
        frames = self.tips.frames(self.posture(opened))
        along = []
        for f, joints in enumerate(self.skeleton.fingers.values()):
            first = next((j for j in joints if j in closed or j in self.skeleton.coupling), joints[0])
            along.append(start[f] - frames[self.place[first]][:, 3])
        return _unit(np.array(along)), _unit(moved)

    def _opposed(self, opened: Mapping[str, float], closed: Mapping[str, float]) -> int:
        d, m = self._directions(opened, closed)
        without = [(np.delete(d, f, axis=0).mean(axis=0), np.delete(m, f, axis=0).mean(axis=0)) for f in range(len(d))]
        agree = [round(float(np.linalg.norm(along) + np.linalg.norm(moved)), 6) for along, moved in without]
        return int(np.argmax(agree))

    def _described(
        self,
        opened: Mapping[str, float],
        closed: Mapping[str, float],
        thumb: int,
        bending: Sequence[Mapping[str, float]],
    ) -> Proposal:
        d, m = self._directions(opened, closed)
        tips, bases = self.tips.at(self.posture(opened)), self.hand.bases[:, :, 3]
        fingers = list(self.skeleton.fingers)
        pair = [f for f in range(len(fingers)) if f != thumb]
        sliding = all(self.slides[self.place[j]] for j in closed)
        stand = tips if sliding else bases
        s = _unit(stand[pair].mean(axis=0) - stand[thumb])
        along, bent = _unit(d[pair].mean(axis=0)), _unit(m[pair].mean(axis=0))
        gripper = sliding or float(-bent @ s) >= _GRIPPER
        if sliding:
            x, z = _frame(s, self._from_palm(tips), first="x")
        elif gripper:
            x, z = _frame(s, along + bent + d[thumb] + m[thumb], first="z")
        else:
            x, z = _frame(along, bent, first="x")
        turn = np.column_stack([x, np.cross(z, x), z])
        front = self._front(turn)
        if gripper:
            way = self.way(opened, {**opened, **closed})
            middle = 0.5 * (way[:, pair].mean(axis=1) + way[:, thumb]) @ turn
            center = np.array([*middle[0, :2], front + 0.65 * (middle[:, 2].max() - front)])
        else:
            center = np.array([*(bases[pair].mean(axis=0) @ turn)[:2], front + 0.33 * self.length])
            if fingers[thumb].startswith("finger_"):
                fingers[thumb] = "thumb"
        name = "pinch" if gripper and len(fingers) == 2 else "power"
        config = HandConfig.model_validate(
            {
                **self.base,
                "fingers": dict(zip(fingers, map(list, self.skeleton.fingers.values()), strict=True)),
                "palm": {
                    "body": self.skeleton.palm,
                    "x": _rounded(x, 4),
                    "z": _rounded(z, 4),
                    "grasp_center": _rounded(center, 3),
                },
                "preshapes": {
                    name: {
                        "open": {j: round(v, 4) for j, v in opened.items() if round(v - self.rest[self.place[j]], 4)},
                        "closed": {j: round(v, 4) for j, v in closed.items()},
                    }
                },
            }
        )
        return Proposal(
            config,
            {j: self._range(j) for j in self.place},
            self._roles(bending, thumb),
            fingers[thumb],
            gripper,
            self.skeleton.resting,
        )

    def _from_palm(self, tips: Array) -> Array:
        """Return the direction from the palm's boxes to the tips, or from the fingers' bases without a palm."""
        poses = self.hand.palm_poses
        origin = poses[:, :, 3].mean(axis=0) if len(poses) else self.hand.bases[:, :, 3].mean(axis=0)
        return tips.mean(axis=0) - origin

    def _front(self, turn: Array) -> float:
        """Return how far the palm's boxes reach in the direction z, or the fingers' first joints without a palm [m]."""
        hand, z = self.hand, turn[:, 2]
        if not len(hand.palm_poses):
            return float((hand.bases[:, :, 3] @ z).mean())
        reach = np.einsum("pij,i->pj", hand.palm_poses[:, :, :3], z)
        return float((hand.palm_poses[:, :, 3] @ z + np.abs(reach * hand.palm_half_extents).sum(axis=1)).max())

    def _roles(self, bending: Sequence[Mapping[str, float]], thumb: int) -> dict[str, str]:
        roles = {}
        for f, joints in enumerate(self.skeleton.fingers.values()):
            for joint in joints:
                if joint in self.skeleton.coupling:
                    roles[joint] = f"follows {self.skeleton.coupling[joint].follows}"
                elif any(joint in group for group in bending):
                    roles[joint] = "slides" if self.slides[self.place[joint]] else "bends"
                else:
                    roles[joint] = "opposes" if f == thumb else "spreads"
        return roles


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _frame(x: Array, z: Array, first: str) -> tuple[Array, Array]:
    """Return x and z at right angles, the first one kept, each the axis of the model that is near it."""
    kept, other = (x, z) if first == "x" else (z, x)
    kept = _snapped(_unit(kept))
    other = _snapped(_unit(other - (other @ kept) * kept))
    other = _unit(other - (other @ kept) * kept)
    return (kept, other) if first == "x" else (other, kept)


def _snapped(direction: Array) -> Array:
    k = int(np.argmax(np.abs(direction)))
    return np.sign(direction[k]) * np.eye(3)[k] if abs(direction[k]) >= _SNAP else direction


def _rounded(vector: Array, digits: int) -> list[float]:
    return [round(float(v), digits) + 0.0 for v in vector]


def _name_of(model: str) -> str:
    return Path(model).stem[:60]

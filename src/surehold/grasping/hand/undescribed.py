"""A hand that is not described yet: what its joints can do with its fingertips, in the frame of the palm's body."""

from collections.abc import Mapping
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.skeleton import Skeleton
from surehold.grasping.hand.tips import Fingertips

__all__ = ["UndescribedHand"]

Array = NDArray[np.float64]
Values = Mapping[str, float]  #: of joints [rad or m]
_PARALLEL: Final = np.cos(np.radians(40.0))
_PULL: Final = 0.03  # of rest on the meeting posture: a whole range weighs as much as 3 % of a finger's length
_STEPS: Final = 9  # postures on the way from open to closed
_NEAR: Final = 0.02  # of a finger's length: differences below do not tell which tips come nearer to each other
_WIDER: Final = np.radians(30.0)
_FREE: Final = (0.5 * np.pi, 0.05)  # motion each way of a joint without limits that turns [rad], that slides [m]


class UndescribedHand:
    """The hand of a skeleton, whose palm frame is that of the palm's body.

    `rest` (f, j) is its posture with all joints at 0, or at the nearest end of their range. Joints that follow others
    have no value of their own: `leaders` are those that have one. `parts` are name, fingers and coupling as a
    description has them.
    """

    def __init__(self, model: str, skeleton: Skeleton, parts: Mapping[str, Any]):
        self.skeleton = skeleton
        self.leaders = [j for joints in skeleton.fingers.values() for j in joints if j not in skeleton.coupling]
        palm = {"body": skeleton.palm, "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0]}
        first, (lower, upper) = self.leaders[0], skeleton.ranges[self.leaders[0]]
        ends = {"open": {first: lower}, "closed": {first: upper}}  # any that differ
        self.hand = load_hand(model, HandConfig.model_validate({**parts, "palm": palm, "preshapes": {"any": ends}}))
        self.place = {name: divmod(i, self.hand.lower.shape[1]) for i, name in enumerate(self.hand.joint_names) if name}
        self.rest = np.clip(0.0, self.hand.lower, self.hand.upper)
        self.tips = Fingertips(self.hand)
        self.slides = self.tips.slides
        #: mean distance from the first joint of a finger to its tip at rest [m]
        self.length = float(np.linalg.norm(self.tips.at(self.rest) - self.hand.bases[:, :, 3], axis=1).mean())

    def at_rest(self, joint: str) -> float:
        """Return where a joint rests [rad or m]."""
        return float(self.rest[self.place[joint]])

    def posture(self, values: Values) -> Array:
        """Return joint angles (f, j) of the joints that lead; followers follow, the others rest."""
        q = self.rest.copy()
        for joint, value in values.items():
            q[self.place[joint]] = value
        for follower, coupling in self.skeleton.coupling.items():
            q[self.place[follower]] = coupling.factor * q[self.place[coupling.follows]] + coupling.offset
        return np.clip(q, self.hand.lower, self.hand.upper)

    def way(self, opened: Values, closed: Values) -> Array:
        """Return the tips (t, f, 3) on the way from one posture to another [m]."""
        shares = np.linspace(0.0, 1.0, _STEPS)
        return np.stack(
            [self.tips.at(self.posture({j: v + t * (closed.get(j, v) - v) for j, v in opened.items()})) for t in shares]
        )

    def meeting(self) -> dict[str, float]:
        """Return the posture of the leading joints in which the tips come nearest to each other."""
        from scipy.optimize import least_squares

        lower, upper = np.array([self.skeleton.ranges[joint] for joint in self.leaders]).T
        rest = np.array([self.at_rest(joint) for joint in self.leaders])

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
                place, leader = self.place[joint], joint
                sense = float(frames[place][:, 2] @ frames[last][:, 2])
                if joint in self.skeleton.coupling:
                    leader = self.skeleton.coupling[joint].follows
                    sense *= float(np.sign(self.skeleton.coupling[joint].factor))
                if abs(sense) >= _PARALLEL and self.slides[place] == self.slides[last] and leader in joints:
                    chosen.setdefault(leader, float(np.sign(sense)))
            found.append(chosen)
        return found

    def closing(self, bending: list[dict[str, float]], others: Values) -> tuple[dict[str, float], dict[str, float]]:
        """Return open and closed values of the joints that bend, where `others` are at the values given."""
        found = []
        for senses in product(*map(self._senses, bending)):
            parts = [self._ends(group, sense) for group, sense in zip(bending, senses, strict=True)]
            opened = {j: v for part, _ in parts for j, v in part.items()}
            closed = {j: v for _, part in parts for j, v in part.items()}
            tips = self.way({**others, **opened}, closed)
            apart = np.linalg.norm(tips - tips.mean(axis=1, keepdims=True), axis=2).mean(axis=1)
            nearest = round(float(apart.min()) / (_NEAR * self.length))
            found.append((nearest, round(float(apart.min() - apart[0]), 9), opened, closed))
        return min(found, key=lambda one: one[:2])[2:]

    def widened(self, bending: list[dict[str, float]], opened: Values, closed: Values) -> dict[str, float]:
        """Return open values at which the first joint that bends each finger is up to 30 degrees wider than at rest."""
        wider = dict(opened)
        for joint in (next(iter(group)) for group in bending if group):
            if not self._alone(joint):
                outwards = np.sign(opened[joint] - closed[joint])
                wider[joint] = float(np.clip(opened[joint] + _WIDER * outwards, *self.skeleton.ranges[joint]))
        return wider

    def _ends(self, joints: Mapping[str, float], sense: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return open and closed values of the joints that bend a finger, if its last one closes in a sense."""
        opened, closed = {}, {}
        for joint, sign in joints.items():
            (lower, upper), rest, slides = (
                self.skeleton.ranges[joint],
                self.at_rest(joint),
                self.slides[self.place[joint]],
            )
            if upper - lower >= (1.999 if slides else 1.999 * np.pi):  # no limits, as they are read
                lower, upper = rest - _FREE[int(slides)], rest + _FREE[int(slides)]
            near, far = (lower, upper) if sign * sense > 0.0 else (upper, lower)
            opened[joint] = near if self._alone(joint) or abs(far - rest) < 0.4 * (upper - lower) else rest
            closed[joint] = far
        return opened, closed

    def _senses(self, joints: Mapping[str, float]) -> tuple[int, ...]:
        """Return the senses in which a finger may close: of several joints that have room in one sense only, that."""
        room = 0.0
        for joint, sign in joints.items():
            lower, upper = self.skeleton.ranges[joint]
            room += sign * (lower + upper - 2.0 * self.at_rest(joint)) / (upper - lower)
        alone = any(self._alone(joint) for joint in joints)
        return (1, -1) if alone or abs(room) < 0.3 * len(joints) else (int(np.sign(room)),)

    def _alone(self, joint: str) -> bool:
        """Whether a joint slides, or is the only one of its finger: then it may rest where the hand is closed."""
        finger = next(joints for joints in self.skeleton.fingers.values() if joint in joints)
        return bool(self.slides[self.place[joint]]) or len(finger) == 1

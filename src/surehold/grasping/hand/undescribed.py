"""A hand that is not described yet: what its joints can do with its fingertips, in the frame of the palm's body."""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.hand.building import built_hand
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.coupling import JointCouplings
from surehold.grasping.hand.rest import RestingModel
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
_SHARES: Final = (0.2, 0.05)  # of a range, over which followers are taken: a loop may not let it go farther
_FOLLOWS: Final = 1e-6  # rad or m per unit of the leader


class UndescribedHand:
    """The hand of a skeleton, whose palm frame is that of the palm's body.

    `leaders` are the joints that have values of their own, and what they move, (j,) of all joints of the model per
    unit: the others follow them or rest. Where links close loops, those that actuators drive come first. Followers are
    taken as moving in proportion, which decides what bends and where to; a description is read by the exact rules.
    """

    def __init__(self, file: str, mujoco: Any, model: Any, skeleton: Skeleton):
        self.skeleton = skeleton
        fingers = {finger: list(joints) for finger, joints in skeleton.fingers.items()}
        palm = {"body": skeleton.palm, "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0]}
        described: dict[str, Any] = {
            "name": "hand",
            "palm": palm,
            "fingers": fingers,
            "preshapes": {"p": {"closed": {}}},
        }
        resting = RestingModel(mujoco, model, HandConfig.model_validate(described))
        self._ids = resting.joint_ids
        #: of all joints that turn or slide [rad or m]; a whole turn or a meter each way without limits
        self.ranges = {name: resting.range(j) for name, j in self._ids.items() if resting.moves(j)}
        own, couplings = [joint for finger in fingers.values() for joint in finger], JointCouplings(resting)
        joints = [*skeleton.driving, *own, *couplings.followed(own)]  # a bar that is no finger may lead them all
        self._still, self.leaders = self._led(couplings, dict.fromkeys(joints))
        first = next(iter(self.leaders))
        away = np.clip(self._still[self._ids[first]], *self.ranges[first])
        described["preshapes"] = {"p": {"open": {first: away}, "closed": {first: away + self._steps[first]}}}
        self.hand = built_hand(RestingModel(mujoco, model, HandConfig.model_validate(described)), file)
        self.place = {name: divmod(i, self.hand.lower.shape[1]) for i, name in enumerate(self.hand.joint_names) if name}
        self.tips = Fingertips(self.hand)
        self.slides = self.tips.slides
        tips = self.tips.at(self.posture({}))
        #: mean distance from the first joint of a finger to its tip at rest [m]
        self.length = float(np.linalg.norm(tips - self.hand.bases[:, :, 3], axis=1).mean())

    def at_rest(self, joint: str) -> float:
        """Return where a joint rests [rad or m]: at 0, or at the nearest end of its range, or where it follows."""
        return float(self._still[self._ids[joint]])

    def posture(self, values: Values) -> Array:
        """Return joint angles (f, j) of the fingers from those of the joints that lead; the others follow or rest."""
        every = self._still + sum((v - self.at_rest(joint)) * self.leaders[joint] for joint, v in values.items())
        q = np.zeros_like(self.hand.lower)
        for joint, place in self.place.items():
            q[place] = every[self._ids[joint]]
        return np.clip(q, self.hand.lower, self.hand.upper)

    def leader_of(self, joint: str) -> str:
        """Return the joint that a joint of a finger follows most, "" for one that rests, itself for one that leads."""
        if joint in self.leaders:
            return joint
        moved = {
            name: abs(column[self._ids[joint]]) * np.ptp(self.ranges[name]) for name, column in self.leaders.items()
        }
        most = max(moved, key=lambda name: moved[name])
        return most if moved[most] > _FOLLOWS else ""

    def _led(self, couplings: JointCouplings, joints: Iterable[str]) -> tuple[Array, dict[str, Array]]:
        """Return all joints at rest (j,), and what each joint that leads moves, (j,) per unit."""
        names = list(self._ids)
        still = np.array([np.clip(0.0, *self.ranges[name]) if name in self.ranges else 0.0 for name in names])
        still = couplings.posture({}, still, "rest")
        leaders: dict[str, Array] = {}
        self._steps: dict[str, float] = {}
        for joint in joints:
            j = self._ids[joint]
            if joint in couplings.followers() or any(abs(column[j]) > _FOLLOWS for column in leaders.values()):
                continue
            lower, upper = self.ranges[joint]
            far = (upper if upper - still[j] >= still[j] - lower else lower) - still[j]
            held = {name: float(still[self._ids[name]]) for name in leaders}
            for share in _SHARES:
                step = float(np.clip(share * far, -_FREE[0], _FREE[0]))
                try:
                    moved = couplings.posture({**held, joint: still[j] + step}, still, joint)
                except InputError:  # the loop does not let it go that far
                    continue
                leaders[joint], self._steps[joint] = (moved - still) / step, step
                break
        return still, leaders

    def way(self, opened: Values, closed: Values) -> Array:
        """Return the tips (t, f, 3) on the way from one posture to another [m]."""
        shares = np.linspace(0.0, 1.0, _STEPS)
        return np.stack(
            [self.tips.at(self.posture({j: v + t * (closed.get(j, v) - v) for j, v in opened.items()})) for t in shares]
        )

    def meeting(self) -> dict[str, float]:
        """Return the posture of the leading joints in which the tips come nearest to each other."""
        from scipy.optimize import least_squares

        lower, upper = np.array([self.ranges[joint] for joint in self.leaders]).T
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
        """Return the leaders that bend or slide each finger, and in which sense with its last joint: +1 or -1."""
        frames, found, taken = self.tips.frames(self.posture({})), [], set()
        for joints in self.skeleton.fingers.values():
            last = self.place[joints[-1]]
            along = {j: float(frames[self.place[j]][:, 2] @ frames[last][:, 2]) for j in joints}
            along = {
                j: c
                for j, c in along.items()
                if abs(c) >= _PARALLEL and self.slides[self.place[j]] == self.slides[last]
            }
            chosen: dict[str, float] = {}
            for leader, column in self.leaders.items():
                moved = [j for j in along if abs(column[self._ids[j]]) > _FOLLOWS]
                if moved and leader not in taken and (leader in moved or leader not in joints):
                    first = leader if leader in moved else moved[0]
                    chosen[leader] = float(np.sign(along[first] * column[self._ids[first]]))
            taken |= set(chosen)
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
        """Return open values at which the first joint that bends each finger is up to 30 degrees wider, all alike."""
        firsts = [next(iter(group)) for group in bending if group]
        if any(map(self._alone, firsts)):  # these are open already
            return dict(opened)
        out = {joint: int(opened[joint] > closed[joint]) for joint in firsts}
        more = min(_WIDER, *(abs(self.ranges[joint][end] - opened[joint]) for joint, end in out.items()))
        return {**opened, **{joint: opened[joint] + (more if end else -more) for joint, end in out.items()}}

    def _ends(self, joints: Mapping[str, float], sense: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return open and closed values of the joints that bend a finger, if its last one closes in a sense."""
        opened, closed = {}, {}
        for joint, sign in joints.items():
            (lower, upper), rest, slides = self.ranges[joint], self.at_rest(joint), self._slides(joint)
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
            lower, upper = self.ranges[joint]
            room += sign * (lower + upper - 2.0 * self.at_rest(joint)) / (upper - lower)
        alone = any(self._alone(joint) for joint in joints)
        return (1, -1) if alone or abs(room) < 0.3 * len(joints) else (int(np.sign(room)),)

    def _slides(self, joint: str) -> bool:
        return joint in self.place and bool(self.slides[self.place[joint]])

    def _alone(self, joint: str) -> bool:
        """Whether a joint slides, is the only one of its finger, or a bar: it may rest where the hand is closed."""
        finger = next((joints for joints in self.skeleton.fingers.values() if joint in joints), (joint,))
        return len(finger) == 1 or self._slides(joint)

"""A model of a hand at rest: what moves what, and where everything is, seen from the palm.

At rest every joint of a finger is at 0, every other one at 0 or at the nearest end of its range.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.model import HandModel

__all__ = ["RestingModel"]

Array = NDArray[np.float64]


class RestingModel:
    """A compiled model of MuJoCo at rest and the palm frame of its description.

    `fingers` holds the joints of each finger by their numbers in the model, `of_body` the finger and the place in it of
    the joint that moves a body, `of_palm` the bodies that move with the palm; `turn` (3, 3) and `origin` (3,) are the
    palm frame in the frame of the model's file. Bodies and joints without a name are "body 3" and "joint 0", by their
    number.
    """

    def __init__(self, mujoco: Any, model: Any, config: HandConfig):
        self.mujoco, self.model, self.config = mujoco, model, config
        self.data = mujoco.MjData(model)
        self.joint_names = [model.joint(j).name or f"joint {j}" for j in range(model.njnt)]
        self.body_names = [model.body(b).name or f"body {b}" for b in range(model.nbody)]
        self.joint_ids = {name: j for j, name in enumerate(self.joint_names)}
        self.body_ids = {name: b for b, name in enumerate(self.body_names)}
        if not model.njnt:
            raise InputError(f"the model of hand '{config.name}' has no joint; give a hand whose fingers move.")
        self.fingers = {finger: [self._joint(name) for name in names] for finger, names in config.fingers.items()}
        moving = [j for joints in self.fingers.values() for j in joints]
        if len(set(moving)) != len(moving):
            twice = next(self.joint_names[j] for j in moving if moving.count(j) > 1)
            raise InputError(f"hand '{config.name}' names joint '{twice}' twice; a joint moves one finger.")
        for j in range(model.njnt):
            if self.moves(j):
                rest = 0.0 if j in moving else float(np.clip(0.0, *self.range(j)))
                self.data.qpos[model.jnt_qposadr[j]] = rest
        mujoco.mj_kinematics(model, self.data)
        palm = config.palm
        if palm.body not in self.body_ids:
            raise unknown_name("body", palm.body, self.body_names)
        self.palm_body = self.body_ids[palm.body]
        z, x = np.asarray(palm.z), np.asarray(palm.x)
        if np.linalg.norm(z) < 1e-6 or np.linalg.norm(np.cross(z, x)) <= 1e-3 * np.linalg.norm(z) * np.linalg.norm(x):
            raise InputError(f"hand '{config.name}': palm.x {palm.x} and palm.z {palm.z} must point in two directions.")
        z = z / np.linalg.norm(z)
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        turn = self.data.xmat[self.palm_body].reshape(3, 3)
        self.turn = turn @ np.column_stack([x, np.cross(z, x), z])
        self.origin = self.data.xpos[self.palm_body] + turn @ np.asarray(palm.origin)
        self.of_body, self.of_palm = self._owners()

    def source(self, file: str) -> HandModel:
        """Return the names and frames of the model at rest."""
        frames = {name: self._palm_in(b) for name, b in self.body_ids.items() if b not in self.of_body}
        order = sorted((int(self.model.jnt_qposadr[j]), j) for j in self.joint_ids.values() if self.moves(j))
        return HandModel(
            file,
            self.config.palm.body,
            frames[self.config.palm.body],
            np.column_stack([self.turn, self.origin]),
            tuple(self.joint_names[j] for _, j in order),
            tuple(float(self.data.qpos[place]) for place, _ in order),
            frames,
            tuple(self.body_names[b] for b in sorted(self.of_body)),
        )

    def _palm_in(self, body: int) -> Array:
        """Return the palm frame (3, 4) in the frame of a body."""
        rotation = self.data.xmat[body].reshape(3, 3)
        return np.column_stack([rotation.T @ self.turn, rotation.T @ (self.origin - self.data.xpos[body])])

    def moves(self, j: int) -> bool:
        """Whether a joint turns or slides about one axis."""
        return self.model.jnt_type[j] in (int(self.mujoco.mjtJoint.mjJNT_HINGE), int(self.mujoco.mjtJoint.mjJNT_SLIDE))

    def _joint(self, name: str) -> int:
        if name not in self.joint_ids:
            raise unknown_name("joint", name, self.joint_names)
        j = self.joint_ids[name]
        if not self.moves(j):
            raise InputError(f"joint '{name}' of hand '{self.config.name}' neither turns nor slides about one axis.")
        return j

    def range(self, j: int) -> tuple[float, float]:
        """Return the ends of a joint's range [rad or m]; a whole turn or a meter each way without limits."""
        if not self.model.jnt_limited[j]:
            turns = self.model.jnt_type[j] == int(self.mujoco.mjtJoint.mjJNT_HINGE)
            return (-np.pi, np.pi) if turns else (-1.0, 1.0)
        return float(self.model.jnt_range[j][0]), float(self.model.jnt_range[j][1])

    def _above(self, body: int) -> Iterator[int]:
        while True:
            yield body
            if body == 0:
                return
            body = int(self.model.body_parentid[body])

    def _owners(self) -> tuple[dict[int, tuple[str, int]], list[int]]:
        """Return which finger and joint moves each body (the last joint above it), and the bodies of the palm."""
        last = {}
        for finger, joints in self.fingers.items():
            for k, j in enumerate(joints):
                body = int(self.model.jnt_bodyid[j])
                if k and int(self.model.jnt_bodyid[joints[k - 1]]) not in self._above(body):
                    before = self.joint_names[joints[k - 1]]
                    raise InputError(
                        f"finger '{finger}': joint '{self.joint_names[j]}' is not moved by '{before}'; name the "
                        "joints of a finger from the palm to the tip."
                    )
                if self.palm_body not in self._above(body):
                    raise InputError(
                        f"finger '{finger}': joint '{self.joint_names[j]}' is not below the palm "
                        f"'{self.config.palm.body}'."
                    )
                last[body] = (finger, k)
        of_body: dict[int, tuple[str, int]] = {}
        of_palm = []
        for body in range(self.model.nbody):
            above = list(self._above(body))
            owner = next((last[b] for b in above if b in last), None)
            if owner is not None:
                of_body[body] = owner
            elif self.palm_body in above:
                of_palm.append(body)
        return of_body, of_palm

    def joined(self, body: int, other: int) -> bool:
        """Whether one body carries the other by a joint: MuJoCo lets these two overlap."""
        weld, parents = self.model.body_weldid, self.model.body_parentid
        return bool(weld[parents[weld[body]]] == weld[other])

    def placed(self, position: Array, rotation: Array) -> tuple[Array, Array]:
        """Return a position (3,) and a rotation (3, 3) of the model's file in the palm frame."""
        return self.turn.T @ (position - self.origin), self.turn.T @ rotation

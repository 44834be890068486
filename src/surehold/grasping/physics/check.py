"""Physics as the second opinion: whether the closed hand holds the object when it weighs and is shaken (MuJoCo).

The closed grasp of a trial is taken over as it is: palm fixed, fingers under position control with limited torque, the
object free and, at first, without weight (model.py). The fingers squeeze: in `SQUEEZE` seconds the torques are ramped
up until the first joint is at its limit, in such a proportion that the forces balance on the object, as a hand with a
sense of touch commands them (squeeze.py); or, if asked for, until every joint pushes as hard as it can. From that state
gravity pulls for a second in one of six directions of the palm's frame, or the object weighs and is shaken to and fro
along each axis. Each load is a run of its own. What counts is how far the object's center of mass moves and how far the
object turns under the load. An object that holds under every load, but that the squeeze moved beyond `RATED`, is
"moved": what held is not the grasp that was rated. The quality of the contacts that it has after the squeeze is given
beside.

Runs are deterministic, whatever the number of threads. The pinned version of MuJoCo matters: contacts differ between
versions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.grasp import Grasp
from surehold.grasping.physics.model import STEP, Drives, drives_of, dynamics_model, mujoco_module
from surehold.grasping.physics.squeeze import balanced_torques
from surehold.grasping.poses import Pose
from surehold.grasping.simulator import Simulator

__all__ = ["LOADS", "SQUEEZES", "VERDICTS", "GraspCheck", "GraspChecker", "LoadOutcome"]

Array = NDArray[np.float64]
Verdict = Literal["held", "moved", "slipped", "dropped"]
VERDICTS: Final[tuple[Verdict, ...]] = ("held", "moved", "slipped", "dropped")  #: from the best to the worst
SQUEEZES: Final = ("balanced", "full")

SQUEEZE: Final = 0.5  #: time in which the fingers squeeze, before the load [s]
LOAD_TIME: Final = 1.0  #: time under load [s]
SHAKE: Final = 5.0  #: acceleration of the shake [m/s^2]
HELD: Final = (0.010, np.radians(20.0))  #: a held object moves and turns less than this [m, rad]
RATED: Final = (0.005, np.radians(5.0))  #: a grasp is the one that was rated if the squeeze moves the object less
DROPPED: Final = 0.050  #: an object that moves farther is dropped [m]

_GRAVITY = 9.81
_PHASE = 0.1  # controls are constant for so long [s]
_BEATS = 2  # phases until the shake turns around

_AXES = tuple(f"gravity {sign}{axis}" for axis in "xyz" for sign in "+-")
#: The loads: gravity along the palm's axes, and the shake.
LOADS: Final = (*_AXES, "shake")


class LoadOutcome(NamedTuple):
    """What became of the object under one load."""

    load: str  #: one of `LOADS`
    verdict: Verdict
    moved: float  #: largest distance of the center of mass from where the load found it [m]
    turned: float  #: largest turn from there [rad]


@dataclass(frozen=True)
class GraspCheck:
    """The verdict on a grasp: that of its worst load, or "moved" if all hold after a squeeze that moved the object."""

    verdict: Verdict
    settled: float  #: how far the object's center of mass moved while the fingers squeezed [m]
    settled_turn: float  #: how far the object turned meanwhile [rad]
    settled_quality: float  #: quality of the skin's contacts after the squeeze; 0 if that dropped the object
    loads: tuple[LoadOutcome, ...]  #: in the order of `LOADS`

    @property
    def moved(self) -> float:
        """Largest motion under any load [m]."""
        return max(load.moved for load in self.loads)

    @property
    def turned(self) -> float:
        """Largest turn under any load [rad]."""
        return max(load.turned for load in self.loads)


class GraspChecker:
    """Checks the grasps of one simulator.

    Parameters
    ----------
    simulator
        Whose hand, object and friction are taken.
    finger_force
        F, the force of a stretched finger at its tip [N]; the hand's own if not given.
    mass
        Mass of the object [kg]; its own if not given.
    squeeze
        "balanced": torques whose contact forces balance on the object; "full": every joint pushes as it can.
    threads
        Threads on which MuJoCo runs the loads; the outcome does not depend on it.

    Raises
    ------
    InputError
        If MuJoCo is not installed, a name or number is out of range, or the object's mesh is not watertight.
    """

    def __init__(
        self,
        simulator: Simulator,
        *,
        finger_force: float | None = None,
        mass: float | None = None,
        squeeze: str = "balanced",
        threads: int = 1,
    ):
        mujoco = mujoco_module()
        if finger_force is None:
            finger_force = simulator.hand.finger_force
        if not (np.isfinite(finger_force) and 0.0 < finger_force <= 1000.0):
            raise InputError(f"finger_force is {finger_force!r} N; give a force above 0 and up to 1000 N, such as 8.")
        self.mass: Final[float] = simulator.object.mass if mass is None else float(mass)
        if not (np.isfinite(self.mass) and 0.0 < self.mass <= 1000.0):
            raise InputError(f"mass is {mass!r} kg; give a mass above 0 and up to 1000 kg.")
        if squeeze not in SQUEEZES:
            raise unknown_name("squeeze", squeeze, SQUEEZES)
        if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
            raise InputError(f"threads are {threads!r}; give an integer of 1 or more.")
        self.simulator: Final = simulator
        self.finger_force: Final[float] = float(finger_force)
        self.squeeze: Final = squeeze
        self.drives: Final[Drives] = drives_of(simulator, self.finger_force, self.mass)
        self.model: Final[Any] = dynamics_model(simulator, self.drives)  # mujoco.MjModel
        self._moving: Final = np.flatnonzero(simulator.hand.joint_names)  # those of (f j,) that move
        self._data = [mujoco.MjData(self.model) for _ in range(threads)]

    def check(self, grasp: Grasp) -> GraspCheck:
        """Return the verdict on one grasp; on a hand that collides while open it is "dropped"."""
        return self.checks([grasp])[0]

    def checks(self, grasps: Sequence[Grasp]) -> list[GraspCheck]:
        """Return the verdicts on many grasps, in parallel on the threads."""
        lost = GraspCheck(
            "dropped", np.inf, np.pi, 0.0, tuple(LoadOutcome(name, "dropped", np.inf, np.inf) for name in LOADS)
        )
        found = [lost] * len(grasps)
        for part in self._parts(grasps):
            for i, check in zip(part, self._checked([grasps[i] for i in part]), strict=True):
                found[i] = check
        return found

    def held(self, grasps: Sequence[Grasp]) -> NDArray[np.bool_]:
        """Return whether the verdict on each grasp is "held", (n,): `checks` that end where the answer is known."""
        held = np.zeros(len(grasps), dtype=bool)
        for part in self._parts(grasps):
            first, settled, targets = self._squeezed([grasps[i] for i in part])
            squeezed, twisted = _motion(self.model, first, settled)
            stayed = np.flatnonzero((squeezed < RATED[0]) & (twisted < RATED[1]))
            moved, turned = self._loaded(settled[stayed], targets[stayed], to_the_end=False)
            holding = (moved < HELD[0]) & (turned < HELD[1])
            held[np.array(part)[stayed]] = holding.all(axis=1)
        return held

    def _parts(self, grasps: Sequence[Grasp]) -> list[list[int]]:
        closed = [i for i, grasp in enumerate(grasps) if grasp.status != "initial collision"]
        return [closed[start : start + 64] for start in range(0, len(closed), 64)]  # bounds the memory of the states

    def _checked(self, grasps: Sequence[Grasp]) -> list[GraspCheck]:
        first, settled, targets = self._squeezed(grasps)
        squeezed, twisted = _motion(self.model, first, settled)
        moved, turned = self._loaded(settled, targets)
        checks = []
        for i, grasp in enumerate(grasps):
            loads = tuple(
                LoadOutcome(name, _verdict(far, turn), float(far), float(turn))
                for name, far, turn in zip(LOADS, moved[i], turned[i], strict=True)
            )
            worst = VERDICTS[max(VERDICTS.index(load.verdict) for load in loads)]
            if squeezed[i] > DROPPED:
                worst = "dropped"
            elif worst == "held" and (squeezed[i] >= RATED[0] or twisted[i] >= RATED[1]):
                worst = "moved"
            quality = 0.0 if squeezed[i] > DROPPED else self._quality(settled[i], grasp)
            checks.append(GraspCheck(worst, float(squeezed[i]), float(twisted[i]), quality, loads))
        return checks

    def _squeezed(self, grasps: Sequence[Grasp]) -> tuple[Array, Array, Array]:
        """Return the states (n, k) before and after the squeeze, and the targets of the joints (n, a) at its end."""
        from mujoco import rollout

        first = np.stack([self._state(grasp) for grasp in grasps])
        touch = np.stack([grasp.joints.ravel()[self._moving] for grasp in grasps])
        beyond = np.stack([self._beyond(grasp) for grasp in grasps])
        states, phases = first, round(SQUEEZE / _PHASE)
        with rollout.Rollout(nthread=len(self._data)) as pool:
            for phase in range(phases):
                states = self._advance(pool, states, touch + (phase + 1) / phases * beyond)[:, -1]
        return first, states, touch + beyond

    def _loaded(self, settled: Array, targets: Array, to_the_end: bool = True) -> tuple[Array, Array]:
        """Return how far the object moves [m] and turns [rad] under each load, (n, loads), from the settled states.

        Unless it goes `to_the_end`, what is not held under a load is not loaded any longer: its numbers are too small.
        """
        from mujoco import rollout

        many = len(LOADS)
        moved, turned = np.zeros((2, len(settled), many))
        origin, states = np.repeat(settled, many, axis=0), np.repeat(settled, many, axis=0)
        targets = np.repeat(targets, many, axis=0)
        alive = np.arange(len(settled))
        with rollout.Rollout(nthread=len(self._data)) as pool:
            for phase in range(round(LOAD_TIME / _PHASE)):
                if not len(alive):
                    break
                rows = (many * alive[:, None] + np.arange(many)).ravel()
                forces = np.tile(self.mass * _accelerations(phase), (len(alive), 1))
                reached = self._advance(pool, states[rows], targets[rows], forces)
                far, turn = _motion(self.model, origin[rows, None], reached)
                moved[alive] = np.maximum(moved[alive], far.max(axis=1).reshape(-1, many))
                turned[alive] = np.maximum(turned[alive], turn.max(axis=1).reshape(-1, many))
                states[rows] = reached[:, -1]
                if not to_the_end:
                    alive = alive[((moved[alive] < HELD[0]) & (turned[alive] < HELD[1])).all(axis=1)]
        return moved, turned

    def _advance(
        self,
        pool: Any,
        states: Array,
        targets: Array,
        forces: Array | None = None,
    ) -> Array:
        """Return the states (n, steps, k) of one phase from states (n, k), with forces (n, 3) on the center of mass."""
        mujoco = mujoco_module()
        spec = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_XFRC_APPLIED
        pushes = np.zeros((len(states), self.model.nbody, 6))
        if forces is not None:
            pushes[:, -1, :3] = forces
        controls = np.concatenate([targets, pushes.reshape(len(states), -1)], axis=1)[:, None]
        reached, _ = pool.rollout(
            [self.model] * len(states),
            self._data,
            np.ascontiguousarray(states),
            np.ascontiguousarray(controls),
            control_spec=int(spec),
            nstep=round(_PHASE / STEP),
        )
        return np.array(reached)

    def _quality(self, state: Array, grasp: Grasp) -> float:
        """Return the quality of the contacts where the fingers and the object are in a state."""
        simulator, n = self.simulator, len(self._moving)
        x, y, z, *quaternion = state[1 + n : 8 + n]  # after the time and the joints
        w, i, j, k = np.asarray(quaternion) / np.linalg.norm(quaternion)
        palm = Pose((float(x), float(y), float(z)), (float(w), float(i), float(j), float(k))).inverse()
        joints = grasp.joints.copy()
        joints.ravel()[self._moving] = state[1 : 1 + n]
        return simulator.quality_at(palm, joints)

    def _state(self, grasp: Grasp) -> Array:
        """Return the initial state: time, positions (joints, then the object's pose in the palm frame), velocities."""
        mujoco = mujoco_module()
        pose, data = grasp.pose.inverse(), mujoco.MjData(self.model)
        data.qpos[:] = np.concatenate([grasp.joints.ravel()[self._moving], pose.position, pose.quaternion])
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(self.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        return state

    def _beyond(self, grasp: Grasp) -> Array:
        """Return how far the joints' targets go beyond the touch when the squeeze is complete [rad or m], (a,)."""
        drives, hand = self.drives, self.simulator.hand
        on = np.clip(grasp.joints + drives.beyond * drives.closing, hand.lower, hand.upper) - grasp.joints
        if self.squeeze == "full":
            return on.ravel()[self._moving]
        moving = np.zeros(drives.limits.size)
        moving[self._moving] = 1.0
        limits = drives.largest * moving.reshape(drives.limits.shape)
        shares, residual = balanced_torques(self.simulator, grasp, limits)
        if residual < 1.0 and not np.any(shares * np.sign(drives.closing) > 0.0):
            return on.ravel()[self._moving]  # balance asks for no joint to close: nothing would be squeezed
        return (shares * limits / drives.stiffness).ravel()[self._moving]


def _accelerations(phase: int) -> Array:
    """Return the acceleration (loads, 3) that each load gives the object in a phase [m/s^2]."""
    rows = [_GRAVITY * sign * np.eye(3)[axis] for axis in range(3) for sign in (1.0, -1.0)]
    axis, sign = (phase // (2 * _BEATS)) % 3, 1.0 if phase % (2 * _BEATS) < _BEATS else -1.0
    return np.array([*rows, _GRAVITY * np.eye(3)[0] + SHAKE * sign * np.eye(3)[axis]])


def _motion(model: Any, before: Array, after: Array) -> tuple[Array, Array]:
    """Return how far the center of mass moved [m] and the object turned [rad] between states (..., k)."""
    center = model.body_ipos[-1]
    places, turns = [], []
    for states in (before, after):
        pose = states[..., model.nq - 6 : model.nq + 1]  # after the time and the joints
        w, v = pose[..., 3:4], pose[..., 4:]
        lift = 2.0 * np.cross(v, np.cross(v, center) + w * center)
        places.append(pose[..., :3] + center + lift)
        turns.append(pose[..., 3:])
    far = np.linalg.norm(places[1] - places[0], axis=-1)
    cosine = np.abs(np.sum(turns[0] * turns[1], axis=-1))
    return far, 2.0 * np.arccos(np.minimum(cosine, 1.0))


def _verdict(moved: float, turned: float) -> Verdict:
    if moved > DROPPED:
        return "dropped"
    return "held" if moved < HELD[0] and turned < HELD[1] else "slipped"

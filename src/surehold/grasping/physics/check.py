"""Physics as the second opinion: whether the closed hand holds the object when it weighs and is shaken (MuJoCo).

    m    mass of the object, kg                   F     force that a finger can exert at its tip, N
    tau  largest torque of a joint, F times the distance to the tip of the stretched finger, N m

The closed grasp of a trial is taken over as it is: palm fixed, fingers under position control with limited torque, the
object free and, at first, without weight. The fingers squeeze: their targets move on in the direction of closing, in
`SQUEEZE` seconds, until the torques are at their limits. From that state gravity pulls for a second in one of six
directions of the palm's frame, or the object weighs and is shaken to and fro along each axis. Each load is a run of
its own. What counts is how far the object's center of mass moves and how far the object turns under the load. An object
that holds under every load, but that the squeeze moved beyond `RATED`, is "moved": what held is not the grasp that was
rated. The quality of the contacts that it has after the squeeze is given beside.

The object is made of convex pieces (convex_pieces.py), links are capsules, the palm is made of boxes with round edges;
only contacts between hand and object are simulated. Contacts have the friction of the simulator, and its torsional
friction or that of a patch of `PATCH` radius, whichever is larger: a point contact in the exact sense does not exist.
Runs are deterministic, whatever the number of threads. The pinned version of MuJoCo matters: contacts differ between
versions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.grasp import Grasp
from surehold.grasping.physics.convex_pieces import convex_pieces
from surehold.grasping.poses import Pose
from surehold.grasping.simulator import Simulator
from surehold.grasping.wrench.friction_cones import soft_finger_torsion

__all__ = ["LOADS", "GraspCheck", "GraspChecker", "LoadOutcome"]

Verdict = Literal["held", "moved", "slipped", "dropped"]
_VERDICTS: Final[tuple[Verdict, ...]] = ("held", "moved", "slipped", "dropped")

SQUEEZE: Final = 0.5  #: time in which the fingers squeeze, before the load [s]
LOAD_TIME: Final = 1.0  #: time under load [s]
SHAKE: Final = 5.0  #: acceleration of the shake [m/s^2]
HELD: Final = (0.010, np.radians(20.0))  #: a held object moves and turns less than this [m, rad]
RATED: Final = (0.005, np.radians(5.0))  #: a grasp is the one that was rated if the squeeze moves the object less
DROPPED: Final = 0.050  #: an object that moves farther is dropped [m]
PATCH: Final = 0.003  #: least radius of a patch of contact, for the torsional friction [m]

_GRAVITY = 9.81
_STEP = 0.002  # s
_PHASE = 0.1  # controls are constant for so long [s]
_BENT, _SHIFT = 0.35, 0.01  # how far targets move on beyond the touch [rad, m]; torque is at its limit from half on
_SLOW = 0.03  # joints that turn with a smaller rate of closing hold their place [rad per unit of the closing parameter]
_BEATS = 2  # phases until the shake turns around
_STIFF = 40.0  # stiffness of a joint that does not close, relative to its torque limit [1/rad]

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
    threads
        Threads on which MuJoCo runs the loads; the outcome does not depend on it.

    Raises
    ------
    InputError
        If MuJoCo is not installed, a number is out of range, or the object's mesh is not watertight.
    """

    def __init__(
        self,
        simulator: Simulator,
        *,
        finger_force: float | None = None,
        mass: float | None = None,
        threads: int = 1,
    ):
        mujoco = _mujoco()
        hand = simulator.hand
        if finger_force is None:
            finger_force = hand.finger_force
        if not (np.isfinite(finger_force) and 0.0 < finger_force <= 1000.0):
            raise InputError(f"finger_force is {finger_force!r} N; give a force above 0 and up to 1000 N, such as 8.")
        self.mass: Final[float] = simulator.object.mass if mass is None else float(mass)
        if not (np.isfinite(self.mass) and 0.0 < self.mass <= 1000.0):
            raise InputError(f"mass is {mass!r} kg; give a mass above 0 and up to 1000 kg.")
        if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
            raise InputError(f"threads are {threads!r}; give an integer of 1 or more.")
        self.simulator: Final = simulator
        self.finger_force: Final[float] = float(finger_force)
        slides = hand.chains[:, :, 0] > 0.0
        rate = hand.preshapes[simulator.preshape].rate
        self._closing: Final = np.sign(rate) * (np.abs(rate) > np.where(slides, 0.0, _SLOW))
        self._moving: Final = np.flatnonzero(hand.joint_names)  # those of (f j,) that move
        self._bent: Final = np.where(slides, _SHIFT, _BENT)
        levers = np.where(slides, 1.0, np.maximum(hand.reach().max(axis=2), 0.005))
        self._limits: Final = self.finger_force * levers  # (f, j) N m, or N for joints that slide
        self.model: Final[Any] = self._build(mujoco)  # mujoco.MjModel
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
        closed = [i for i, grasp in enumerate(grasps) if grasp.status != "initial collision"]
        for start in range(0, len(closed), 64):  # bounds the memory of the states
            part = closed[start : start + 64]
            for i, check in zip(part, self._run([grasps[i] for i in part]), strict=True):
                found[i] = check
        return found

    def _run(self, grasps: Sequence[Grasp]) -> list[GraspCheck]:
        from mujoco import rollout

        model, n = self.model, len(grasps)
        states = np.stack([self._state(grasp) for grasp in grasps])
        with rollout.Rollout(nthread=len(self._data)) as pool:
            squeezing = round(SQUEEZE / _PHASE)
            for phase in range(squeezing):
                share = (phase + 1) / squeezing
                controls = np.stack([self._targets(grasp, share) for grasp in grasps])
                states = self._advance(pool, states, controls)[:, -1]
            settled = states
            targets = np.repeat(np.stack([self._targets(grasp, 1.0) for grasp in grasps]), len(LOADS), axis=0)
            states = np.repeat(states, len(LOADS), axis=0)
            moved, turned = np.zeros(n * len(LOADS)), np.zeros(n * len(LOADS))
            origin = states
            for phase in range(round(LOAD_TIME / _PHASE)):
                forces = np.tile(self.mass * _accelerations(phase), (n, 1))
                states = self._advance(pool, states, targets, forces)
                far, turn = _motion(model, origin[:, None], states)
                moved, turned = np.maximum(moved, far.max(axis=1)), np.maximum(turned, turn.max(axis=1))
                states = states[:, -1]
        first = np.stack([self._state(grasp) for grasp in grasps])
        squeezed, twisted = _motion(model, first, settled)
        checks = []
        for i in range(n):
            rows = slice(i * len(LOADS), (i + 1) * len(LOADS))
            loads = tuple(
                LoadOutcome(name, _verdict(far, turn), float(far), float(turn))
                for name, far, turn in zip(LOADS, moved[rows], turned[rows], strict=True)
            )
            worst = _VERDICTS[max(_VERDICTS.index(load.verdict) for load in loads)]
            if squeezed[i] > DROPPED:
                worst = "dropped"
            elif worst == "held" and (squeezed[i] >= RATED[0] or twisted[i] >= RATED[1]):
                worst = "moved"
            quality = 0.0 if squeezed[i] > DROPPED else self._quality(settled[i], grasps[i])
            checks.append(GraspCheck(worst, float(squeezed[i]), float(twisted[i]), quality, loads))
        return checks

    def _advance(
        self,
        pool: Any,
        states: NDArray[np.float64],
        targets: NDArray[np.float64],
        forces: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the states (n, steps, k) of one phase from states (n, k), with forces (n, 3) on the center of mass."""
        mujoco = _mujoco()
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
            nstep=round(_PHASE / _STEP),
        )
        return np.array(reached)

    def _quality(self, state: NDArray[np.float64], grasp: Grasp) -> float:
        """Return the quality of the contacts where the fingers and the object are in a state."""
        simulator, n = self.simulator, len(self._moving)
        x, y, z, *quaternion = state[1 + n : 8 + n]  # after the time and the joints
        w, i, j, k = np.asarray(quaternion) / np.linalg.norm(quaternion)
        palm = Pose((float(x), float(y), float(z)), (float(w), float(i), float(j), float(k))).inverse()
        joints = grasp.joints.copy()
        joints.ravel()[self._moving] = state[1 : 1 + n]
        return simulator.quality_at(palm, joints)

    def _state(self, grasp: Grasp) -> NDArray[np.float64]:
        """Return the initial state: time, positions (joints, then the object's pose in the palm frame), velocities."""
        mujoco = _mujoco()
        pose, data = grasp.pose.inverse(), mujoco.MjData(self.model)
        data.qpos[:] = np.concatenate([grasp.joints.ravel()[self._moving], pose.position, pose.quaternion])
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(self.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        return state

    def _targets(self, grasp: Grasp, share: float) -> NDArray[np.float64]:
        """Return the targets of the joints: where they are, and on in the direction of closing by a share."""
        hand = self.simulator.hand
        on = np.clip(grasp.joints + share * self._bent * self._closing, hand.lower, hand.upper)
        return on.ravel()[self._moving]

    def _build(self, mujoco: Any) -> Any:
        """Return the model: the palm at rest, the fingers, and the object as the last body."""
        simulator = self.simulator
        hand, obj = simulator.hand, simulator.object
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        option = spec.option
        option.timestep, option.gravity = _STEP, (0.0, 0.0, 0.0)
        option.integrator, option.cone = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC
        option.impratio = 10.0  # friction that does not creep
        torsion = max(simulator.measure.torsion, soft_finger_torsion(simulator.friction, PATCH))
        shared = {"condim": 4, "friction": (max(simulator.friction, 1e-5), torsion, 1e-5), "solref": (0.008, 1.0)}
        palm = spec.worldbody.add_body(name="palm")
        for k, (pose, half, rounding) in enumerate(
            zip(hand.palm_poses, hand.palm_half_extents, hand.palm_roundings, strict=True)
        ):
            corners = _rounded_corners(half, float(rounding)) @ pose[:, :3].T + pose[:, 3]
            spec.add_mesh(name=f"palm {k}", uservert=corners.ravel())
            palm.add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"palm {k}", contype=1, conaffinity=2, density=0.0, **shared
            )
        for f in range(len(hand.bases)):
            parent, offset = palm, hand.bases[f]
            for j in range(hand.radii.shape[1]):
                row = hand.chains[f, j]
                quaternion = Pose.from_matrix(offset).quaternion
                body = parent.add_body(name=f"{f} {j}", pos=offset[:, 3], quat=quaternion, mass=1e-4)
                body.explicitinertial, body.inertia = True, (1e-8, 1e-8, 1e-8)
                name = hand.joint_names[f * hand.radii.shape[1] + j]
                if name:
                    self._add_joint(mujoco, spec, body, name, f, j)
                if hand.radii[f, j] > 0.0:
                    body.add_geom(
                        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                        fromto=row[1:7],
                        size=(hand.radii[f, j], 0.0, 0.0),
                        contype=1,
                        conaffinity=2,
                        density=0.0,
                        **shared,
                    )
                parent, offset = body, row[7:].reshape(3, 4)
        thing = spec.worldbody.add_body(name="object")
        thing.add_freejoint()
        for k, corners in enumerate(convex_pieces(obj.vertices, obj.faces)):
            spec.add_mesh(name=f"piece {k}", uservert=corners.ravel())
            thing.add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece {k}", contype=2, conaffinity=1, density=0.0, **shared
            )
        center, inertia = _inertia(obj.vertices, obj.faces, self.mass)
        thing.mass, thing.ipos, thing.explicitinertial = self.mass, center, True
        thing.fullinertia = inertia
        return spec.compile()

    def _add_joint(self, mujoco: Any, spec: Any, body: Any, name: str, f: int, j: int) -> None:
        hand = self.simulator.hand
        slides, limit = hand.chains[f, j, 0] > 0.0, float(self._limits[f, j])
        closes = self._closing[f, j] != 0.0
        stiffness = 2.0 * limit / float(self._bent[f, j]) if closes else _STIFF * limit
        kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(
            name=name,
            type=kind,
            axis=(0.0, 0.0, 1.0),
            range=(hand.lower[f, j], hand.upper[f, j]),
            limited=True,
            armature=5e-5 if not slides else 0.05,  # inertia of the motor behind its gear
            damping=0.02 * limit,
        )
        spec.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            gainprm=[stiffness] + [0.0] * 9,
            biasprm=[0.0, -stiffness] + [0.0] * 8,
            forcelimited=True,
            forcerange=(-limit, limit) if closes else (-10.0 * limit, 10.0 * limit),
        )


def _mujoco() -> Any:
    """Return the module mujoco, which has no complete type stubs, or raise InputError."""
    try:
        return import_module("mujoco")
    except ImportError as error:
        raise InputError("the check of a grasp by physics needs MuJoCo; pip install 'surehold[mujoco]'.") from error


def _accelerations(phase: int) -> NDArray[np.float64]:
    """Return the acceleration (loads, 3) that each load gives the object in a phase [m/s^2]."""
    rows = [_GRAVITY * sign * np.eye(3)[axis] for axis in range(3) for sign in (1.0, -1.0)]
    axis, sign = (phase // (2 * _BEATS)) % 3, 1.0 if phase % (2 * _BEATS) < _BEATS else -1.0
    return np.array([*rows, _GRAVITY * np.eye(3)[0] + SHAKE * sign * np.eye(3)[axis]])


def _motion(
    model: Any, before: NDArray[np.float64], after: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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


def _rounded_corners(half: NDArray[np.float64], rounding: float) -> NDArray[np.float64]:
    """Return points (k, 3) whose convex hull is a box of half extents `half` with round edges."""
    directions = np.array([d for d in product(np.linspace(0.0, 1.0, 4), repeat=3) if max(d) == 1.0])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    signs = np.array(list(product((-1.0, 1.0), repeat=3)))
    return np.vstack([sign * (half - rounding + rounding * directions) for sign in signs])


def _inertia(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], mass: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return center of mass (3,) [m] and inertia about it, xx yy zz xy xz yz [kg m^2], of a solid of even density."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    i = np.asarray(mesh.moment_inertia) * mass / float(mesh.volume)
    return np.asarray(mesh.center_mass), np.array([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])

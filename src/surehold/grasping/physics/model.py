"""The hand and its object as a model of rigid bodies (MuJoCo).

    F    force that a finger can exert at its tip, N
    tau  largest torque of a joint, F times the distance to the tip of the stretched finger, N m

The palm rests, links are capsules, the palm is made of boxes with round edges, the object of convex pieces
(convex_pieces.py); only contacts between hand and object are simulated. Contacts have the friction of the simulator,
and its torsional friction or that of a patch of `PATCH` radius, whichever is larger: a point contact in the exact sense
does not exist. Joints are under position control with limited torque; inertia and damping of a motor grow with its
stiffness, so that strong hands are simulated as well as weak ones.
"""

from importlib import import_module
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.hand.model import Hand
from surehold.grasping.physics.convex_pieces import convex_pieces
from surehold.grasping.poses import Pose
from surehold.grasping.simulator import Simulator
from surehold.grasping.wrench.friction_cones import soft_finger_torsion

__all__ = ["PATCH", "STEP", "Drives", "drives_of", "dynamics_model", "mujoco_module"]

Array = NDArray[np.float64]

PATCH: Final = 0.003  #: least radius of a patch of contact, for the torsional friction [m]
STEP: Final = 0.002  #: of the simulation [s]

_BENT, _SHIFT = 0.35, 0.01  # how far targets move on beyond the touch [rad, m]; torque is at its limit from half on
_SLOW = 0.03  # joints that turn with a smaller rate of closing hold their place [rad per unit of the closing parameter]
_RESPONSE: Final = 0.01  # time in which a joint under position control follows its target [s]
_CENTERED: Final = 1e-6  # centers of mass nearer than this are the same [m]
# Contacts of MuJoCo give way by as much as the finger's force accelerates the object: where that is more than this they
# are made harder, or fingers sink through what is light [m/s^2].
_PRESSED: Final = 1200.0
_STIFF = 40.0  # stiffness of a joint that does not close, relative to its torque limit [1/rad]


class Drives(NamedTuple):
    """What moves the joints of a hand, all (f, j), and the object's mass."""

    mass: float  #: of the object [kg]
    force: float  #: of a stretched finger at its tip [N]
    closing: Array  #: 1 or -1 where a joint closes, in that direction; 0 where it holds its place
    limits: Array  #: largest torque [N m], or force of joints that slide [N]
    stiffness: Array  #: of the position control [N m/rad, N/m]
    beyond: Array  #: how far targets move on from the touch to push as hard as the joint can [rad, m]

    @property
    def largest(self) -> Array:
        """Largest torque [N m] or force [N] of each joint; a joint that holds its place is held by its gear, too."""
        return np.where(self.closing != 0.0, 1.0, 10.0) * self.limits


def drives_of(simulator: Simulator, finger_force: float, mass: float) -> Drives:
    """Return the drives of a hand whose stretched fingers exert a force at their tips [N]."""
    hand = simulator.hand
    slides = hand.chains[:, :, 0] > 0.0
    rate = hand.preshapes[simulator.preshape].rate
    closing = np.sign(rate) * (np.abs(rate) > np.where(slides, 0.0, _SLOW))
    beyond = np.where(slides, _SHIFT, _BENT)
    levers = np.where(slides, 1.0, np.maximum(hand.reach().max(axis=2), 0.005))
    limits = finger_force * levers
    return Drives(
        mass, finger_force, closing, limits, np.where(closing != 0.0, 2.0 * limits / beyond, _STIFF * limits), beyond
    )


def dynamics_model(simulator: Simulator, drives: Drives) -> Any:
    """Return the MjModel: the palm at rest, the fingers, and the object as the last body.

    Raises
    ------
    InputError
        If MuJoCo is not installed or the object's mesh is not watertight.
    """
    mujoco = mujoco_module()
    hand, obj = simulator.hand, simulator.object
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.timestep, option.gravity = STEP, (0.0, 0.0, 0.0)
    option.integrator, option.cone = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 10.0  # friction that does not creep
    friction = simulator.friction
    torsion = max(simulator.measure.torsion, soft_finger_torsion(friction, PATCH))
    gives = min(1.0, _PRESSED * drives.mass / drives.force)
    shared = {
        "condim": 4,
        "friction": (max(friction, 1e-5), torsion, 1e-5),
        "solref": (0.008, 1.0),
        "solimp": (1.0 - 0.1 * gives, 1.0 - 0.05 * gives, 0.001, 0.5, 2.0),
    }
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
                _add_joint(mujoco, spec, body, name, hand, drives, (f, j))
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
    center, inertia = _inertia(obj.vertices, obj.faces, drives.mass)
    if not np.allclose(center, obj.center_of_mass, rtol=0.0, atol=_CENTERED):  # the density is not even
        center = obj.center_of_mass
    thing.mass, thing.ipos, thing.explicitinertial = drives.mass, center, True
    thing.fullinertia = inertia
    return spec.compile()


def _add_joint(mujoco: Any, spec: Any, body: Any, name: str, hand: Hand, drives: Drives, at: tuple[int, int]) -> None:
    slides, stiffness = hand.chains[*at, 0] > 0.0, float(drives.stiffness[at])
    kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(
        name=name,
        type=kind,
        axis=(0.0, 0.0, 1.0),
        range=(hand.lower[at], hand.upper[at]),
        limited=True,
        armature=stiffness * _RESPONSE**2,  # inertia of the motor behind its gear
        damping=2.0 * stiffness * _RESPONSE,  # critical
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
        forcerange=(-drives.largest[at], drives.largest[at]),
    )


def mujoco_module() -> Any:
    """Return the module mujoco, which has no complete type stubs, or raise InputError."""
    try:
        return import_module("mujoco")
    except ImportError as error:
        raise InputError("the check of a grasp by physics needs MuJoCo; pip install 'surehold[mujoco]'.") from error


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

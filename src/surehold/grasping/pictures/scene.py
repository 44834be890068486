"""What a picture of a grasp needs: triangle meshes of object and hand, how they move in the world, and the contacts."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.grasp import Grasp
from surehold.grasping.hand.kinematics import link_frames
from surehold.grasping.hand.model import Hand
from surehold.grasping.hand.synergy import closing_motion
from surehold.grasping.poses import Pose
from surehold.grasping.simulator import Simulator

__all__ = ["Scene", "SceneMesh", "capsule_mesh", "grasp_scene", "hand_meshes"]

_AROUND = 24  #: corners around a link
_CAP = 6  #: rings on each round end of a link
_MOST_SHOWN = 60_000  #: triangles of an object in a picture
STEPS = 25  #: poses of a closing hand


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """One body as triangles in a frame of its own, and where that frame is."""

    name: str  #: "object", "palm", or such as "index distal"
    vertices: NDArray[np.float32] = field(repr=False)  #: (v, 3) m, in the body's frame
    faces: NDArray[np.int32] = field(repr=False)  #: (f, 3), counterclockwise seen from outside
    poses: NDArray[np.float32] = field(repr=False)  #: (k, 3, 4) body's frame in the world while the hand closes


@dataclass(frozen=True, eq=False)
class Scene:
    """A grasp and how it closed, or the open hand before it, as meshes and contacts in the world."""

    object: SceneMesh
    hand: tuple[SceneMesh, ...]  #: the palm's boxes and the links
    points: NDArray[np.float32] = field(repr=False)  #: (c, 3) contacts on the object [m]
    normals: NDArray[np.float32] = field(repr=False)  #: (c, 3) unit length, into the object
    weights: NDArray[np.float32] = field(repr=False)  #: (c,) in (0, 1]
    bodies: tuple[str, ...] = field(repr=False)  #: (c,) names of the touching bodies
    friction: float  #: tangent of the friction cones' half angle
    box_center: NDArray[np.float32]  #: (3,) center of the object's box [m]
    box_axes: NDArray[np.float32]  #: (3, 3) axes of the box as columns
    box_half_extents: NDArray[np.float32]  #: (3,) half edges of the box [m]


def grasp_scene(simulator: Simulator, grasp: Grasp, opened: bool = False) -> Scene:
    """Return the scene of a grasp in the world of the simulator; with `opened`, the hand before it closes.

    The poses of a body are those at `STEPS` equal steps of the closing parameter, of which the last is the end; an open
    hand, and the object, have one pose. The open hand's scene has no contacts.
    """
    to_world = simulator.object_pose
    obj, hand = simulator.object, simulator.hand
    contacts = grasp.contacts
    still = opened or np.array_equal(grasp.joints, grasp.open_joints)
    steps = grasp.open_joints[None] if still else closing_steps(simulator, grasp)
    shown = slice(0, 0) if opened else slice(None)
    return Scene(
        object=SceneMesh("object", *_shown(obj.vertices, obj.faces), to_world.matrix[None].astype(np.float32)),
        hand=tuple(hand_meshes(hand, to_world @ grasp.pose, steps)),
        points=to_world.apply(contacts.points[shown]).astype(np.float32),
        normals=(contacts.normals[shown] @ to_world.rotation.T).astype(np.float32),
        weights=contacts.weights[shown].astype(np.float32),
        bodies=() if opened else contacts.names,
        friction=simulator.friction,
        box_center=to_world.apply(obj.box_center).astype(np.float32),
        box_axes=(to_world.rotation @ obj.axes).astype(np.float32),
        box_half_extents=obj.box_half_extents.astype(np.float32),
    )


def closing_steps(simulator: Simulator, grasp: Grasp) -> NDArray[np.float64]:
    """Return the joint angles (k, f, j) while the hand of a grasp closes, from the open hand to the grasp."""
    motion = closing_motion(simulator.hand, grasp.s1, simulator.preshape)
    moved = np.abs(grasp.joints - grasp.open_joints) > 1e-9
    # A joint follows its motion until it is stopped, and the motion is monotone: it is the lesser of the two.
    rate = np.where(motion.rate == 0.0, 1.0, motion.rate)
    ends = np.where(moved, (grasp.joints - motion.start) / rate, 0.0)
    last = float(ends.max())
    forward, steps = motion.rate > 0.0, []
    for t in np.linspace(0.0, last, STEPS):
        free = motion.joints(float(t))
        steps.append(np.where(forward, np.minimum(free, grasp.joints), np.maximum(free, grasp.joints)))
    steps[-1] = grasp.joints
    return np.stack(steps)


def hand_meshes(hand: Hand, pose: Pose, steps: NDArray[np.float64]) -> list[SceneMesh]:
    """Return the palm's boxes and each link, at joint angles (k, f, j), in the frame that `pose` leads to."""
    r, p = pose.rotation, np.asarray(pose.position)
    bodies = []
    for placed, half, rounding in zip(hand.palm_poses, hand.palm_half_extents, hand.palm_roundings, strict=True):
        vertices, faces = _rounded_box(half, float(rounding))
        frame = np.column_stack([r @ placed[:, :3], r @ placed[:, 3] + p])
        bodies.append(SceneMesh("palm", vertices.astype(np.float32), faces, frame[None].astype(np.float32)))
    frames = np.stack([link_frames(hand.bases, hand.chains, np.ascontiguousarray(joints)) for joints in steps])
    frames = np.concatenate([r @ frames[..., :3], (frames[..., 3] @ r.T + p)[..., None]], axis=-1).astype(np.float32)
    rows = hand.chains.reshape(-1, hand.chains.shape[2])
    for body, (name, row, radius) in enumerate(zip(hand.link_names, rows, hand.radii.ravel(), strict=True)):
        if radius > 0.0:
            vertices, faces = capsule_mesh(row[1:4], row[4:7], float(radius))
            bodies.append(SceneMesh(name, vertices.astype(np.float32), faces, frames[:, body]))
    return bodies


def _shown(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return a mesh that is light enough for a picture: of a fine one, vertices within a small cube become one."""
    size = float(np.ptp(vertices, axis=0).max())
    cell = size / 100.0
    while len(faces) > _MOST_SHOWN:
        key = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
        _, where, counts = np.unique(key, axis=0, return_inverse=True, return_counts=True)
        where = where.ravel()
        middles = np.column_stack([np.bincount(where, weights=vertices[:, i]) for i in range(3)]) / counts[:, None]
        merged = where[faces]
        kept = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
        vertices, faces, cell = middles, np.unique(merged[kept], axis=0).astype(np.int32), 1.5 * cell
    return vertices.astype(np.float32), faces.astype(np.int32)


def capsule_mesh(
    near: NDArray[np.float64], far: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return vertices (v, 3) and faces (f, 3) of a capsule whose axis ends at `near` and `far` (3,)."""
    length = float(np.linalg.norm(far - near))
    axis = (far - near) / length
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    frame = np.column_stack([first, np.cross(axis, first), axis])
    low = np.linspace(-np.pi / 2.0, 0.0, _CAP + 1)[1:]
    latitude = np.concatenate([low, -low[::-1]])  # rings of the lower cap, then of the upper one
    height = np.where(np.arange(2 * _CAP) < _CAP, 0.0, length) + radius * np.sin(latitude)
    turn = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    rings = [
        np.column_stack([radius * np.cos(a) * ring, np.full(_AROUND, h)]) for a, h in zip(latitude, height, strict=True)
    ]
    local = np.vstack([*rings, [[0.0, 0.0, -radius], [0.0, 0.0, length + radius]]])
    return np.asarray(near + local @ frame.T, dtype=np.float64), _ring_faces(2 * _CAP, _AROUND)


def _ring_faces(rings: int, around: int) -> NDArray[np.int32]:
    """Return the faces of a closed surface of rings with a pole below (number rings x around) and one above (+ 1)."""
    i = np.arange(around)
    j = (i + 1) % around
    below, above = rings * around, rings * around + 1
    faces = [np.column_stack([np.full(around, below), j, i])]
    for r in range(rings - 1):
        a, b = r * around, (r + 1) * around
        faces += [np.column_stack([a + i, a + j, b + j]), np.column_stack([a + i, b + j, b + i])]
    last = (rings - 1) * around
    faces.append(np.column_stack([last + i, last + j, np.full(around, above)]))
    return np.vstack(faces).astype(np.int32)


def _rounded_box(half: NDArray[np.float64], rounding: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return a sphere whose eight octants are moved apart: a box with round edges."""
    around, rings = 4 * _CAP, 2 * _CAP
    core = half - rounding
    turn = 2.0 * np.pi * (np.arange(around) + 0.5) / around
    latitude = np.linspace(-np.pi / 2.0, np.pi / 2.0, rings + 2)[1:-1]
    lat, lon = np.repeat(latitude, around), np.tile(turn, rings)
    unit = np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    poles = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    unit = np.vstack([unit, poles])
    apart = np.where(np.abs(unit) < 1e-12, 0.0, np.sign(unit)) * core
    return np.asarray(rounding * unit + apart, dtype=np.float64), _ring_faces(rings, around)

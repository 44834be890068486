"""What a picture of a grasp needs: triangle meshes of object and hand in the world, and the contacts."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.grasp import Grasp, Simulator
from surehold.grasping.hand import Hand, link_ends
from surehold.grasping.poses import Pose

__all__ = ["Scene", "SceneMesh", "grasp_scene"]

_AROUND = 24  #: corners around a link
_CAP = 6  #: rings on each round end of a link


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """One body as triangles in the world."""

    name: str  #: "object", "palm", or such as "index distal"
    vertices: NDArray[np.float32] = field(repr=False)  #: (v, 3) m
    faces: NDArray[np.int32] = field(repr=False)  #: (f, 3), counterclockwise seen from outside


@dataclass(frozen=True, eq=False)
class Scene:
    """A grasp, or the open hand before it, as meshes and contacts in the world."""

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

    The open hand's scene has no contacts.
    """
    to_world = simulator.object_pose
    obj = simulator.object
    bodies = hand_meshes(simulator.hand, grasp.pose, grasp.open_joints if opened else grasp.joints)
    contacts = grasp.contacts
    shown = slice(0, 0) if opened else slice(None)
    return Scene(
        object=_moved("object", obj.vertices, obj.faces, to_world),
        hand=tuple(_moved(name, vertices, faces, to_world) for name, vertices, faces in bodies),
        points=to_world.apply(contacts.points[shown]).astype(np.float32),
        normals=(contacts.normals[shown] @ to_world.rotation.T).astype(np.float32),
        weights=contacts.weights[shown].astype(np.float32),
        bodies=() if opened else contacts.names,
        friction=simulator.friction,
        box_center=to_world.apply(obj.box_center).astype(np.float32),
        box_axes=(to_world.rotation @ obj.axes).astype(np.float32),
        box_half_extents=obj.box_half_extents.astype(np.float32),
    )


def hand_meshes(
    hand: Hand, pose: Pose, joints: NDArray[np.float64]
) -> list[tuple[str, NDArray[np.float64], NDArray[np.int32]]]:
    """Return name, vertices (v, 3), faces (f, 3) of the palm's boxes and of each link, in the frame `pose` leads to."""
    ends = pose.apply(link_ends(hand.bases, hand.chains, np.ascontiguousarray(joints)))
    bodies = []
    for placed, half, rounding in zip(hand.palm_poses, hand.palm_half_extents, hand.palm_roundings, strict=True):
        vertices, faces = _rounded_box(half, float(rounding))
        bodies.append(("palm", pose.apply(vertices @ placed[:, :3].T + placed[:, 3]), faces))
    for name, (near, far), radius in zip(hand.link_names, ends, hand.radii.ravel(), strict=True):
        if radius > 0.0:
            bodies.append((name, *_capsule(near, far, float(radius))))
    return bodies


def _moved(name: str, vertices: NDArray[np.float64], faces: NDArray[np.int32], pose: Pose) -> SceneMesh:
    return SceneMesh(name, pose.apply(vertices).astype(np.float32), faces.astype(np.int32))


def _capsule(
    near: NDArray[np.float64], far: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
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

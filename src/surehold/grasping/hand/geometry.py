"""The geometries of a model that can touch, as the capsules and round boxes that close on an object.

A capsule stays what it is; a sphere is a capsule of no length; a box, cylinder or ellipsoid is covered by parallel
capsules whose radius is its smallest half extent, no farther apart than that radius (the hollows between them are at
most 0.14 radius deep); a mesh is cut across its longest axis into pieces of at most 20 mm, each covered like a box.
Geometries of the palm, and of what moves with it, become boxes with round edges: a mesh several, so that its openings
stay open (filling.py).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import unknown_name
from surehold.grasping.hand.cover import SHORTEST, Capsule, cover_box, cover_mesh
from surehold.grasping.hand.filling import filling_boxes
from surehold.grasping.hand.rest import RestingModel

__all__ = ["LinkPart", "PalmBox", "link_parts", "palm_boxes"]

Array = NDArray[np.float64]


class LinkPart(NamedTuple):
    """A geometry of a finger, in the palm frame."""

    body: int  #: its body, by its number in the model
    capsules: list[Capsule]
    box: tuple[Array, Array] | None  #: pose (3, 4) and half extents (3,) of one that is a box


def link_parts(rest: RestingModel, finger: str, k: int) -> Iterator[LinkPart]:
    """Yield the geometries that joint k of a finger moves."""
    allowed = rest.config.contact_links
    for name in allowed or []:
        if name not in rest.body_ids:
            raise unknown_name("body", name, rest.body_names)
    for body, owner in rest.of_body.items():
        name = rest.body_names[body]
        if owner != (finger, k) or (allowed is not None and name not in allowed):
            continue
        for g in _geometries(rest, body):
            p, r = rest.placed(rest.data.geom_xpos[g], rest.data.geom_xmat[g].reshape(3, 3))
            capsules = [(p + r @ near, p + r @ far, radius) for near, far, radius in _cover(rest, g)]
            center, half = _half(rest, g)
            flat = rest.model.geom_type[g] == int(rest.mujoco.mjtGeom.mjGEOM_BOX)
            yield LinkPart(body, capsules, (np.column_stack([r, p + r @ center]), half) if flat else None)


class PalmBox(NamedTuple):
    """A box with round edges, in the palm frame."""

    body: int  #: that has it, by its number in the model
    pose: Array  #: (3, 4)
    half: Array  #: (3,)
    rounding: float


def palm_boxes(rest: RestingModel) -> list[PalmBox]:
    """Return the boxes of the palm."""
    boxes = []
    types = rest.mujoco.mjtGeom
    for body in rest.of_palm:
        for g in _geometries(rest, body):
            p, r = rest.placed(rest.data.geom_xpos[g], rest.data.geom_xmat[g].reshape(3, 3))
            kind = rest.model.geom_type[g]
            turn, filled = _filled(rest, g) if kind == int(types.mjGEOM_MESH) else (np.eye(3), [_half(rest, g)])
            for center, half in filled:
                smallest = float(half.min())
                round_body = kind in (int(types.mjGEOM_SPHERE), int(types.mjGEOM_CAPSULE))
                rounding = smallest * (1.0 - 1e-6) if round_body else min(0.003, 0.5 * smallest)
                boxes.append(PalmBox(body, np.column_stack([r @ turn, p + r @ turn @ center]), half, rounding))
    return boxes


def _geometries(rest: RestingModel, body: int) -> Iterator[int]:
    first = int(rest.model.body_geomadr[body])
    for g in range(first, first + int(rest.model.body_geomnum[body])):
        touches = rest.model.geom_contype[g] or rest.model.geom_conaffinity[g]
        if touches and max(_half(rest, g)[1]) > 0.0015:  # markers of a millimeter are no bodies
            yield g


def _half(rest: RestingModel, g: int) -> tuple[Array, Array]:
    """Return center and half extents (3,) of a geometry's box in its own frame."""
    return rest.model.geom_aabb[g][:3].copy(), rest.model.geom_aabb[g][3:].copy()


def _cover(rest: RestingModel, g: int) -> list[Capsule]:
    """Return capsules that cover a geometry, in its own frame."""
    types = rest.mujoco.mjtGeom
    kind, size = rest.model.geom_type[g], rest.model.geom_size[g]
    up = np.array([0.0, 0.0, 1.0])
    if kind == int(types.mjGEOM_SPHERE):
        return [(-0.5 * SHORTEST * up, 0.5 * SHORTEST * up, float(size[0]))]
    if kind == int(types.mjGEOM_CAPSULE):
        return [(-float(size[1]) * up, float(size[1]) * up, float(size[0]))]
    center, half = _half(rest, g)
    if kind != int(types.mjGEOM_MESH):
        return cover_box(center, half)
    return cover_mesh(*_mesh(rest, g))


def _mesh(rest: RestingModel, g: int) -> tuple[Array, NDArray[np.integer]]:
    """Return vertices (v, 3) and faces (f, 3) of a geometry that is a mesh, in its own frame."""
    mesh = int(rest.model.geom_dataid[g])
    vertices = rest.model.mesh_vert[rest.model.mesh_vertadr[mesh] :][: rest.model.mesh_vertnum[mesh]]
    faces = rest.model.mesh_face[rest.model.mesh_faceadr[mesh] :][: rest.model.mesh_facenum[mesh]]
    return np.asarray(vertices, dtype=np.float64), np.asarray(faces)


def _filled(rest: RestingModel, g: int) -> tuple[Array, list[tuple[Array, Array]]]:
    """Return axes (3, 3) and boxes along them that fill a mesh: its own axes of inertia, or those of its file.

    The smaller box around all of it decides between the two.
    """
    vertices, faces = _mesh(rest, g)
    of_file = np.empty(9)
    rest.mujoco.mju_quat2Mat(of_file, rest.model.mesh_quat[int(rest.model.geom_dataid[g])])
    turn = min((np.eye(3), of_file.reshape(3, 3).T), key=lambda axes: float(np.prod(np.ptp(vertices @ axes, axis=0))))
    return turn, filling_boxes(vertices @ turn, faces)

"""The 3-D scene: how a grasp is drawn, and what the page loads: every mesh once, as base64 arrays, one view a grasp."""

import base64
import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.reports.run_report import Candidate, ContactSet, ObjectBox, Scene, SceneMesh

if TYPE_CHECKING:
    from surehold.grasping.pictures.scene import Scene as GraspScene

__all__ = ["drawn_scene", "scene_data"]

_OBJECT, _HAND, _TOUCHING = "#5f97d3", "#c3bdb2", "#e0a183"
_MOST_TRIANGLES = 400_000  # beyond this a page takes long to open on a phone


def drawn_scene(scene: "GraspScene") -> Scene:
    """Return a grasp's scene as the page draws it: the object see-through, the links that touch in another color."""
    thing = scene.object
    object_mesh = SceneMesh("object", thing.vertices, thing.faces, _OBJECT, see_through=True, poses=thing.poses)
    touching = set(scene.bodies)
    hand = [
        SceneMesh(mesh.name, mesh.vertices, mesh.faces, _TOUCHING if mesh.name in touching else _HAND, poses=mesh.poses)
        for mesh in scene.hand
    ]
    friction = np.full(len(scene.points), float(scene.friction))
    contacts = ContactSet(scene.points, scene.normals, friction, scene.weights)
    box = ObjectBox(scene.box_center, 2.0 * scene.box_half_extents, scene.box_axes)
    return Scene((object_mesh, *hand), contacts, box)


def scene_data(candidates: tuple[Candidate, ...]) -> dict[str, Any] | None:
    """Return what the page's script draws (JSON-ready), or None if no candidate has a scene.

    Positions are float32 [m], indices uint32, both little-endian and base64; equal arrays are stored once.

    Raises
    ------
    InputError
        If a mesh is malformed (an index without vertex, a number that is not finite) or all meshes together have more
        than 400,000 triangles.
    """
    shown = [(c.label, c.scene) for c in candidates if c.scene is not None]
    if not shown:
        return None
    buffers: dict[str, str] = {}
    meshes: list[dict[str, Any]] = []
    known: dict[tuple[Any, ...], int] = {}
    views = []
    for label, scene in shown:
        indices, poses = [], []
        for mesh in scene.meshes:
            vertices = _buffer(buffers, _finite(mesh.vertices, 3, mesh.name).astype("<f4"))
            faces = _buffer(buffers, _faces(mesh).astype("<u4"))
            base = (mesh.name, mesh.color, mesh.see_through, vertices, faces)
            # Two equal bodies of one scene are two: each has a place of its own.
            key = next(k for k in ((*base, n) for n in range(len(scene.meshes))) if known.get(k) not in indices)
            if key not in known:
                known[key] = len(meshes)
                meshes.append(dict(zip(("name", "color", "see_through", "vertices", "faces"), base, strict=True)))
            indices.append(known[key])
            poses.append(None if mesh.poses is None else _buffer(buffers, _poses(mesh).astype("<f4")))
        views.append({"label": label, "meshes": indices, "poses": poses, **_marks(scene), "view": list(scene.view)})
    triangles = sum(len(buffers[m["faces"]]) // 16 for m in meshes)
    if triangles > _MOST_TRIANGLES:
        raise InputError(
            f"the scene has {triangles:,} triangles, more than {_MOST_TRIANGLES:,}; simplify its meshes for the report."
        )
    return {"buffers": buffers, "meshes": meshes, "views": views}


def _marks(scene: Scene) -> dict[str, Any]:
    marks: dict[str, Any] = {"contacts": [], "box": None}
    if scene.contacts is not None:
        contacts = scene.contacts
        points, normals = _finite(contacts.points, 3, "contacts"), _finite(contacts.normals, 3, "contact normals")
        shapes = {len(points), len(normals), len(contacts.friction), len(contacts.weights)}
        if len(shapes) > 1:
            raise InputError(
                f"contacts of the scene have {len(points)} points, {len(normals)} normals, {len(contacts.friction)} "
                f"friction coefficients and {len(contacts.weights)} weights; give one of each a contact."
            )
        marks["contacts"] = [
            {"p": _round(p), "n": _round(n), "mu": round(float(mu), 4), "w": round(float(w), 4)}
            for p, n, mu, w in zip(points, normals, contacts.friction, contacts.weights, strict=True)
        ]
    if scene.box is not None:
        marks["box"] = {
            "center": _round(scene.box.center),
            "size": _round(scene.box.size),
            "axes": [_round(axis) for axis in np.asarray(scene.box.rotation).T],
        }
    marks["neighbors"] = []
    if scene.neighbors is not None:
        points = _finite(scene.neighbors.points, 3, "neighbors")
        marks["neighbors"] = [
            {"p": _round(p), "bad": bool(bad)} for p, bad in zip(points, scene.neighbors.unsafe, strict=True)
        ]
    return marks


def _poses(mesh: SceneMesh) -> NDArray[np.floating]:
    poses = np.asarray(mesh.poses)
    if poses.ndim != 3 or poses.shape[1:] != (3, 4) or not len(poses) or not np.all(np.isfinite(poses)):
        raise InputError(f"poses of mesh '{mesh.name}' must be finite, of shape (k, 3, 4); got shape {poses.shape}.")
    return poses


def _round(vector: NDArray[np.floating]) -> list[float]:
    return [round(float(v), 6) for v in np.asarray(vector)]


def _finite(rows: NDArray[np.floating], width: int, name: str) -> NDArray[np.floating]:
    array = np.asarray(rows, dtype=np.float64).reshape(-1, width) if np.size(rows) == 0 else np.asarray(rows)
    if array.ndim != 2 or array.shape[1] != width or not np.all(np.isfinite(array)):
        raise InputError(f"{name} of the scene must be finite numbers of shape (n, {width}); got shape {array.shape}.")
    return array


def _faces(mesh: SceneMesh) -> NDArray[np.integer]:
    faces = np.asarray(mesh.faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or not np.issubdtype(faces.dtype, np.integer):
        raise InputError(f"faces of mesh '{mesh.name}' must be integers of shape (f, 3); got shape {faces.shape}.")
    if faces.size and (faces.min() < 0 or faces.max() >= len(mesh.vertices)):
        raise InputError(f"faces of mesh '{mesh.name}' name vertices that are not there (it has {len(mesh.vertices)}).")
    return faces


def _buffer(buffers: dict[str, str], array: NDArray[Any]) -> str:
    raw = np.ascontiguousarray(array).tobytes()
    key = hashlib.sha256(raw).hexdigest()[:12]
    buffers.setdefault(key, base64.b64encode(raw).decode("ascii"))
    return key

"""The quality of the simulator behind the thesis ("simox"), its slips included, so that levels can be compared.

Notation: see friction_cones.py. It differs from epsilon in these points, all as in the original program:

- edge forces have magnitude one, eight to a cone, and every cone is 45 degrees wide (mu = 1), whatever the friction is;
- torques are divided by half the longest side of the object's axis-aligned box, about the plain mean of the vertices;
- the radius is measured about the mean of the hull's *vertices*, not about the origin: it is positive without force
  closure too, and adding a contact may lower it;
- quality is that radius divided by the same number of the object wrench space: the hull of the wrenches of contacts at
  the centroids of up to 300 faces of the mesh.

Where the original draws 300 faces at random, evenly spaced ones are taken here. The object's number depends on how the
mesh is triangulated, by several percent for coarse meshes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.grasping.wrench.friction_cones import contact_wrenches, finite_array
from surehold.grasping.wrench.hull.inscribed_ball import ball_radius

__all__ = ["FRICTION", "ObjectWrenchSpace", "check_cones", "object_wrench_space", "simox_quality"]

FRICTION = 1.0
EDGES = 8


@dataclass(frozen=True)
class ObjectWrenchSpace:
    """What the simox quality needs of an object, computed once."""

    torque_length: float
    """Half the longest side of the axis-aligned box [m]."""
    origin: tuple[float, float, float]
    """Plain mean of the vertices [m]."""
    radius: float
    """Distance from the mean of the vertices of the object's wrench hull to its nearest facet, > 0."""


def check_cones(friction: float | None, torsion: float, edges: int) -> None:
    """Raise InputError if cones are asked for that simox does not have; a friction of None is not asked for."""
    own = {"friction": FRICTION, "torsion": 0.0, "edges": EDGES}
    given = {"friction": FRICTION if friction is None else friction, "torsion": torsion, "edges": edges}
    for name, value in given.items():
        if value != own[name]:
            verb = "are" if name == "edges" else "is"
            raise InputError(
                f"{name} {verb} {value!r}, but the quality 'simox' always has cones of friction {FRICTION:g} and "
                f"{EDGES} edges, without torsion; leave {name} out, or ask for another quality."
            )


def object_wrench_space(vertices: ArrayLike, faces: ArrayLike, max_faces: int = 300) -> ObjectWrenchSpace:
    """Measure the wrench space of a triangle mesh with outward winding, for `simox_quality`.

    Parameters: vertices (v, 3) [m]; faces (f, 3), indices of vertices; max_faces, evenly spaced faces are taken if
    there are more. Raises InputError if the arrays are unusable or the mesh has no volume of wrenches (a flat or
    empty mesh).
    """
    v = finite_array("vertices", vertices, (None, 3))
    f = np.asarray(faces)
    if f.ndim != 2 or f.shape[1] != 3 or not np.issubdtype(f.dtype, np.integer):
        raise InputError(f"faces must be integers of shape (f, 3), not {f.dtype} of shape {f.shape}.")
    if f.size and (f.min() < 0 or f.max() >= len(v)):
        raise InputError(f"faces must index the {len(v)} vertices, but reach from {f.min()} to {f.max()}.")
    corners = v[f]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    sound = np.flatnonzero(lengths > 0.0)  # a face without area has no normal
    if len(sound) > max_faces:
        sound = sound[np.linspace(0, len(sound) - 1, max_faces).round().astype(int)]
    torque_length = float(np.ptp(v, axis=0).max()) / 2.0 if len(v) else 0.0
    if not torque_length > 0.0 or not len(sound):
        raise InputError("the mesh has no extent; give a closed triangle mesh in meters.")
    origin = v.mean(axis=0)
    wrenches = _wrenches(
        corners[sound].mean(axis=1), -normals[sound] / lengths[sound, None], torque_length, tuple(origin)
    )
    radius = _vertex_centered_radius(wrenches)
    if radius == 0.0:
        raise InputError("the faces of the mesh span no volume of wrenches; give a closed triangle mesh.")
    return ObjectWrenchSpace(torque_length, (float(origin[0]), float(origin[1]), float(origin[2])), radius)


def simox_quality(points: ArrayLike, normals: ArrayLike, space: ObjectWrenchSpace) -> float:
    """Return the simox quality of contacts: points (c, 3) [m] and inward unit normals (c, 3) in the mesh's frame.

    0 for fewer than two contacts or contacts whose wrenches are flat; may be positive without force closure. The
    original program reports up to 0.79 for power grasps. Raises InputError for unusable arrays.
    """
    wrenches = _wrenches(points, normals, space.torque_length, space.origin)
    return _vertex_centered_radius(wrenches) / space.radius if len(wrenches) >= 2 * EDGES else 0.0


def _wrenches(points: ArrayLike, normals: ArrayLike, torque_length: float, origin: tuple) -> NDArray[np.float64]:
    """Return the cone edges' wrenches, edge 0 where the smallest rotation from z to the normal carries x, (8 c, 6)."""
    n = finite_array("normals", normals, (None, 3))
    x, along = np.array([1.0, 0.0, 0.0]), n + np.array([0.0, 0.0, 1.0])
    near = along[:, 2] < 1e-6  # 1 + n_z has lost its digits there
    along[near, 2] = np.sum(n[near, :2] ** 2, axis=1) / (1.0 - n[near, 2])
    down = along[:, 2] <= 1e-12  # there the rotation is any half turn
    tangents = x - (n[:, 0] / np.where(down, 1.0, along[:, 2]))[:, None] * along
    tangents[down] = x - n[down, :1] * n[down]
    return contact_wrenches(points, n, FRICTION, EDGES, torque_length, origin, tangents, "unit_magnitude")


def _vertex_centered_radius(wrenches: NDArray[np.float64]) -> float:
    """Return the distance from the mean of the hull's vertices to the nearest facet, 0 if the hull is flat."""
    return ball_radius(wrenches - wrenches[_hull_vertices(wrenches)].mean(axis=0))


def _hull_vertices(wrenches: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return which wrenches are vertices of their hull, exactly, for forces of magnitude one.

    Points of the unit sphere are all extreme. Hence a wrench can be a mixture only of wrenches with the very same
    force; their torques lie in the plane perpendicular to the force, and the extreme ones among them are corners of a
    planar convex hull.
    """
    forces = np.round(wrenches[:, :3], 9) + 0.0  # no negative zeros
    _, group, counts = np.unique(forces, axis=0, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    vertices = [np.flatnonzero(counts[group] == 1)]
    for shared in np.flatnonzero(counts > 1):
        members = np.flatnonzero(group == shared)
        f = wrenches[members[0], :3]
        across = np.eye(3)[np.argmin(np.abs(f))]
        across = across - (across @ f) * f
        plane = np.column_stack((across, np.cross(f, across))).astype(np.float64)
        vertices.append(members[_planar_hull(wrenches[members, 3:] @ plane)])
    return np.concatenate(vertices)


def _planar_hull(points: NDArray[np.float64]) -> list[int]:
    """Return the corners of the convex hull of points (k, 2), duplicates and points on edges left out (Andrew 1979)."""
    tolerance = 1e-9 * (1.0 + float(np.abs(points).max()))  # torques are about one
    snapped = np.round(points / tolerance)
    order = np.lexsort((snapped[:, 1], snapped[:, 0]))

    def chain(indices: NDArray[np.intp]) -> list[int]:
        corners: list[int] = []
        for i in indices:
            if corners and np.abs(points[i] - points[corners[-1]]).max() <= tolerance:
                continue
            while len(corners) > 1:
                a, b = points[corners[-1]] - points[corners[-2]], points[i] - points[corners[-2]]
                if a[0] * b[1] - a[1] * b[0] > tolerance * np.sqrt(b @ b):
                    break
                corners.pop()
            corners.append(int(i))
        return corners

    lower, upper = chain(order), chain(order[::-1])
    return lower if len(lower) == 1 else lower[:-1] + upper[:-1]

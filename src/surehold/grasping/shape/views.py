"""What a camera would see of a known object: a half view, to learn from and to be judged by.

Points are drawn on the object's mesh, equally likely for each piece of its surface as the camera sees it, and kept if
nothing lies between them and the camera (sphere tracing on the object's distances). Noise is normal along the ray, as
that of a depth camera.
"""

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.object.distance_field import DistanceField, distance_field_of, field_distance
from surehold.grasping.object.model import GraspObject
from surehold.store.kernels import njit

__all__ = ["camera_towards", "half_view", "surface_points"]

Array = NDArray[np.float64]


def camera_towards(obj: GraspObject, azimuth: float, elevation: float, distance: float = 0.6) -> Array:
    """Return the place (3,) of a camera that looks at the center of an object's box [m].

    Azimuth (from x to y, 0 to 2 pi) and elevation [rad] are those of the camera seen from there.
    """
    c = np.cos(elevation)
    return obj.box_center + distance * np.array([c * np.cos(azimuth), c * np.sin(azimuth), np.sin(elevation)])


def half_view(obj: GraspObject, camera: Array, n: int, noise: float, rng: np.random.Generator) -> Array:
    """Return n points (n, 3) of an object's surface that the camera at (3,) sees, with noise along its rays [m].

    Raises
    ------
    InputError
        If the camera is inside the object or sees nothing of it.
    """
    field = distance_field_of(obj)
    if field.distance(camera[None])[0] <= 0.0:
        raise InputError(f"the camera at {camera.tolist()} is inside '{obj.name}'; place it outside.")
    found: list[Array] = []
    count = 0
    for _ in range(200):
        points, normals = surface_points(obj, 2000, rng)
        ray = camera - points
        far = np.linalg.norm(ray, axis=1)
        cosine = np.sum(normals * ray, axis=1) / far
        points = points[rng.random(len(points)) < cosine]  # a piece is seen as large as it is turned to the camera
        points = points[_visible(field.nodes, field.frame, points, camera)]
        found.append(points)
        count += len(points)
        if count >= n:
            break
    if count < n:
        raise InputError(f"the camera at {camera.tolist()} sees too little of '{obj.name}'; place it elsewhere.")
    points = np.vstack(found)[:n]
    ray = points - camera
    return points + noise * rng.standard_normal((n, 1)) * ray / np.linalg.norm(ray, axis=1)[:, None]


def surface_points(obj: GraspObject, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return n points (n, 3) drawn evenly on an object's mesh, and outward unit normals (n, 3)."""
    corners = obj.vertices[obj.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    face = rng.choice(len(area), n, p=area / area.sum())
    u, v = rng.random((2, n))
    turned = u + v > 1.0
    u, v = np.where(turned, 1.0 - u, u), np.where(turned, 1.0 - v, v)
    a, b, c = corners[face].transpose(1, 0, 2)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), cross[face] / area[face][:, None]


def hidden_mask(field: DistanceField, points: Array, camera: Array) -> NDArray[np.bool_]:
    """Return which surface points (n, 3) the camera at (3,) does not see."""
    return ~_visible(field.nodes, field.frame, points, camera)


@njit(cache=True)
def _visible(nodes, frame, points, camera):
    """Return which points on the surface see the camera: the ray from 2 mm before them meets nothing."""
    out = np.ones(len(points), dtype=np.bool_)
    for i in range(len(points)):
        dx, dy, dz = camera[0] - points[i, 0], camera[1] - points[i, 1], camera[2] - points[i, 2]
        far = np.sqrt(dx * dx + dy * dy + dz * dz)
        t = 0.002
        while t < far:
            s = t / far
            d = field_distance(nodes, frame, points[i, 0] + s * dx, points[i, 1] + s * dy, points[i, 2] + s * dz)
            if d < 0.0002:
                out[i] = False
                break
            t += d
    return out

"""A mesh of one's own: read from STL, OBJ, PLY or glTF, diagnosed in one line, and given mass and box.

What is read and what is refused of a file is said in mesh_reading.py, what is mended or refused of a mesh in
mesh_repair.py; the line of the diagnosis says what was done.

Box. Its axes are the file's own or the principal axes of the volume, each named after the axis of the file that it is
nearest to. Principal axes that belong to moments within 1 % of each other are arbitrary; of these, those nearest to the
file's axes are taken, or those of the smallest box where that is smaller by 1 %. `auto` takes the file's own unless the
principal axes give a box that is smaller by 1 %, or a box that lies on a flat side of the object is smaller by a tenth:
most parts have the same box, and the same length by which torques are divided, however the file turns them.
"""

from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.object.mesh_reading import MESH_FORMATS, read_mesh
from surehold.grasping.object.mesh_repair import UNITS, repaired
from surehold.grasping.object.model import GraspObject

__all__ = ["BOX_FRAMES", "DENSITY", "MESH_FORMATS", "UNITS", "LoadedMesh", "load_mesh"]

Array = NDArray[np.float64]

BOX_FRAMES: Final = ("auto", "file", "principal")
DENSITY: Final = 1000.0  #: of an object whose mass is not given [kg/m^3]
_FLAT: Final = 0.01  # of the area of a hull: what is smaller is no flat side of the object
_Y_UP: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # columns: x, y, z of the box in glTF


@dataclass(frozen=True, eq=False)
class LoadedMesh:
    """A mesh that was read, and what is to be said of it."""

    object: GraspObject
    diagnosis: str  #: one line: size in mm, mass, what was found and what was done about it


def load_mesh(
    path: str | Path,
    unit: str | None = None,
    mass: float | None = None,
    frame: str = "auto",
    friction: float = 0.5,
    scale: float = 1.0,
) -> LoadedMesh:
    """Read a mesh as an object to grasp; its frame is that of the file, in meters.

    Parameters
    ----------
    path
        An .stl, .obj, .ply, .gltf or .glb file.
    unit
        Unit of the file's coordinates: "mm", "cm", "m" or "in". Only glTF has one of its own, m.
    mass
        Mass [kg]; that of a solid of 1000 kg/m^3 if not given.
    frame
        Axes of the object's box: "file", "principal" or "auto", see above. In glTF y is up.
    friction
        Coefficient of friction with the hand.
    scale
        By which the coordinates are multiplied besides.

    Raises
    ------
    InputError
        If the file cannot be read, is no mesh, refers to another file for its triangles, or is refused as said above.
    """
    file = Path(path)
    kind = file.suffix.lower().lstrip(".")
    if kind not in MESH_FORMATS:
        known = ", ".join(f".{name}" for name in MESH_FORMATS)
        raise InputError(f"{str(path)!r} is no mesh file; give one of {known} (archives are not opened).")
    if unit is None:
        if kind not in ("gltf", "glb"):
            raise InputError(f"{str(path)!r} does not say its unit of length; give --unit mm, cm, m or in.")
        unit = "m"
    if unit not in UNITS:
        raise unknown_name("unit", unit, UNITS)
    if frame not in BOX_FRAMES:
        raise unknown_name("frame", frame, BOX_FRAMES)
    if mass is not None and not (np.isfinite(mass) and 0.0 < mass <= 100.0):
        raise InputError(f"mass is {mass!r}; give kilograms above 0 and up to 100.")
    if not (np.isfinite(scale) and scale > 0.0):
        raise InputError(f"scale of {file.name!r} is {scale!r}; give a positive number.")
    vertices, faces, notes = read_mesh(file, kind)
    vertices, faces, more = repaired(file.name, vertices * (UNITS[unit] * scale), faces, unit)
    notes += more
    volume, center, moments = _volume_integrals(vertices, faces)
    if volume < 1e-10:  # 0.1 ml: less is a sheet folded on itself
        raise InputError(f"{file.name!r} encloses no volume ({volume * 1e9:.3g} mm^3); give the surface of a solid.")
    own = _Y_UP if kind in ("gltf", "glb") else np.eye(3)
    axes = _box_axes(vertices, own, moments, frame)
    obj = GraspObject(
        file.stem,
        vertices,
        faces.astype(np.int32),
        float(mass) if mass is not None else DENSITY * volume,
        center,
        friction,
        axes=axes,
    )
    size = " x ".join(f"{2e3 * half:.1f}" for half in obj.box_half_extents)
    weight = f"{1e3 * obj.mass:.3g} g" + ("" if mass is not None else f" at {DENSITY:g} kg/m^3")
    turned = "" if np.array_equal(axes, own) else "; its box is turned from the file's axes"
    line = f"{file.name}: {len(faces):,} triangles, {size} mm, {weight}{turned}"
    return LoadedMesh(obj, "; ".join([line, *notes]))


def _volume_integrals(vertices: Array, faces: NDArray[np.int64]) -> tuple[float, Array, Array]:
    """Return volume, center of volume (3,) and second moments (3, 3) about it."""
    from trimesh.triangles import mass_properties

    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))  # digits are lost far from the origin
    found = mass_properties((vertices - middle)[faces], density=1.0)
    inertia = np.asarray(found["inertia"])
    moments = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return float(found["volume"]), middle + np.asarray(found["center_mass"]), moments


def _box_axes(vertices: Array, own: Array, moments: Array, frame: str) -> Array:
    """Return the axes (3, 3) of the box as columns."""
    if frame == "file":
        return own
    flat = _flat_sides(vertices)
    principal = _principal_axes(vertices, moments, flat, own)
    if frame == "principal":
        return principal
    chosen, size = own, _box_volume(vertices, own)
    for axes, share in ((principal, 0.99), (_smallest_box(vertices, flat, own), 0.9)):
        if _box_volume(vertices, axes) < share * size:
            chosen, size = axes, _box_volume(vertices, axes)
    return chosen


def _box_volume(vertices: Array, axes: Array) -> float:
    return float(np.prod(np.ptp(vertices @ axes, axis=0)))


def _principal_axes(vertices: Array, moments: Array, flat: Array, own: Array) -> Array:
    """Return the principal axes (3, 3) as columns, each the one nearest to an axis of `own`, right-handed."""
    values, vectors = np.linalg.eigh(own.T @ moments @ own)
    order, turn = _named(vectors)
    chosen, close = values[order], 0.01 * float(values.max())
    same = np.abs(chosen - np.roll(chosen, -1)) < close  # of 0 and 1, 1 and 2, 2 and 0
    if not np.any(same):
        return own @ turn
    if np.sum(same) > 1:
        nearest, normals = np.eye(3), flat @ own
    else:
        # Turn the pair about its normal to where it lies nearest to the file's axes.
        i = int(np.argmax(same))
        j, k = (i + 1) % 3, (i + 2) % 3
        angle = np.arctan2(turn[j, i] - turn[i, j], turn[i, i] + turn[j, j])
        c, s = np.cos(-angle), np.sin(-angle)
        nearest, normals = turn.copy(), turn[:, k][None]
        nearest[:, i], nearest[:, j] = c * turn[:, i] + s * turn[:, j], c * turn[:, j] - s * turn[:, i]
    smallest, nearest = _smallest_box(vertices, normals @ own.T, own), own @ nearest
    return smallest if _box_volume(vertices, smallest) < 0.99 * _box_volume(vertices, nearest) else nearest


def _named(axes: Array) -> tuple[list[int], Array]:
    """Return in which order axes (3, 3), as columns, come nearest to x, y and z, and themselves so, right-handed."""
    best, found, chosen = -np.inf, [0, 1, 2], axes
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turned = axes[:, order] * np.array(signs)
            if np.linalg.det(turned) > 0.0 and np.trace(turned) > best + 1e-9:
                best, found, chosen = float(np.trace(turned)), list(order), turned
    return found, chosen


def _flat_sides(vertices: Array) -> Array:
    """Return the normals (n, 3) of the flat sides of the hull of vertices (v, 3), each a share `_FLAT` or more."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    corners = vertices[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    sides = hull.equations[np.argsort(-areas, kind="stable"), :3]  # of a side in several parts the largest comes first
    _, first, side = np.unique(np.round(sides, 4), axis=0, return_index=True, return_inverse=True)
    return sides[first[np.bincount(side.ravel(), np.sort(areas)[::-1]) > _FLAT * areas.sum()]]


def _smallest_box(vertices: Array, normals: Array, own: Array) -> Array:
    """Return the axes (3, 3) of the smallest box of vertices (v, 3) that has a face along a normal (n, 3).

    They are named after the axes of `own` (3, 3) that they are nearest to.
    """
    from scipy.spatial import ConvexHull
    from trimesh.bounds import oriented_bounds_2D

    if not len(normals):
        return own
    corners = vertices[ConvexHull(vertices).vertices]
    best, axes = np.inf, np.eye(3)
    for normal in normals:
        across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        across /= np.linalg.norm(across)
        frame = np.column_stack([across, np.cross(normal, across), normal])
        turn, rectangle = oriented_bounds_2D(corners @ frame[:, :2])
        volume = float(np.prod(rectangle) * np.ptp(corners @ normal))
        if volume < (1.0 - 1e-9) * best:
            best, axes = volume, np.column_stack([frame[:, :2] @ turn[:2, :2].T, normal])
    return own @ _named(own.T @ axes)[1]

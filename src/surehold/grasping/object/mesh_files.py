"""A mesh of one's own: read from STL, OBJ, PLY or glTF, diagnosed in one line, and given mass and box.

What is read and what is refused of a file is said in mesh_reading.py, what is mended or refused of a mesh in
mesh_repair.py; the line of the diagnosis says what was done.

Box. Its axes are the file's own or the principal axes of the volume, each named after the axis of the file that it is
nearest to. Principal axes that belong to moments within 1 % of each other are arbitrary; of these, those that are
nearest to the file's axes are taken. `auto` takes the file's own unless the principal axes give a smaller box.
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
    turned = "" if np.array_equal(axes, own) else "; its box follows the principal axes"
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
    principal = _principal_axes(moments, own)
    if frame == "principal":
        return principal
    size = [np.prod(np.ptp(vertices @ axes, axis=0)) for axes in (own, principal)]
    return principal if size[1] < 0.99 * size[0] else own


def _principal_axes(moments: Array, own: Array) -> Array:
    """Return the principal axes (3, 3) as columns, each the one nearest to an axis of `own`, right-handed."""
    values, vectors = np.linalg.eigh(own.T @ moments @ own)
    best, turn, chosen = -np.inf, np.eye(3), values
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            axes = vectors[:, order] * np.array(signs)
            if np.linalg.det(axes) > 0.0 and np.trace(axes) > best + 1e-9:
                best, turn, chosen = float(np.trace(axes)), axes, values[list(order)]
    close = 0.01 * float(values.max())
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        if abs(chosen[i] - chosen[j]) < close:
            if abs(chosen[j] - chosen[k]) < close or abs(chosen[k] - chosen[i]) < close:
                return own
            # Turn the pair about its normal to where it lies nearest to the file's axes.
            angle = np.arctan2(turn[j, i] - turn[i, j], turn[i, i] + turn[j, j])
            c, s = np.cos(-angle), np.sin(-angle)
            first, second = turn[:, i].copy(), turn[:, j].copy()
            turn[:, i], turn[:, j] = c * first + s * second, c * second - s * first
            break
    return own @ turn

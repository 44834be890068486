"""A mesh of one's own: read from STL, OBJ, PLY or glTF, diagnosed in one line, and given mass and box.

Nothing but the file itself is read: no archive is unpacked, and material files, textures and external buffers that a
file names are neither looked for nor fetched.

Diagnosis. A mesh is refused if it is not a solid of a size that a hand can meet: without triangles, not finite, open
over more than `MOST_OPEN` of its area, with faces that disagree about what is outside, flat, below 5 mm or above 2 m.
Small holes and stray faces do no harm, because inside and outside are told apart by the winding number (Barill et al.
2018). Vertices at the same place become one, triangles without area are left out, and a mesh that is inside out is
turned; the line says so.

Box. Its axes are the file's own or the principal axes of the volume, each named after the axis of the file that it is
nearest to. Principal axes that belong to moments within 1 % of each other are arbitrary; of these, those that are
nearest to the file's axes are taken. `auto` takes the file's own unless the principal axes give a smaller box.
"""

import io
import json
import struct
import warnings
from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.object.model import GraspObject

__all__ = ["BOX_FRAMES", "DENSITY", "MESH_FORMATS", "UNITS", "LoadedMesh", "load_mesh"]

Array = NDArray[np.float64]

UNITS: Final = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}  #: name of a unit -> meters
MESH_FORMATS: Final = ("stl", "obj", "ply", "gltf", "glb")
BOX_FRAMES: Final = ("auto", "file", "principal")
DENSITY: Final = 1000.0  #: of an object whose mass is not given [kg/m^3]
MOST_OPEN: Final = 0.1  #: area of all holes by area of the surface, from which on a mesh is no solid
_SMALLEST, _LARGEST = 0.005, 2.0  # of the longest edge of the box [m]
_FLATTEST = 2e-4  # shortest edge of the box [m]
_MOST_BYTES = 2**30
_Y_UP: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # columns: x, y, z of the box in glTF


@dataclass(frozen=True, eq=False)
class LoadedMesh:
    """A mesh that was read, and what is to be said of it."""

    object: GraspObject
    diagnosis: str  #: one line: size in mm, mass, what was found and what was done about it


class _Holes(NamedTuple):
    borders: int  # separate open borders
    open_edges: int  # edges with a face on one side only
    twisted_edges: int  # edges whose two faces disagree about what is outside
    share: float  # area of all holes by area of the surface
    largest: float  # area of the largest hole [m^2]


def load_mesh(
    path: str | Path,
    unit: str | None = None,
    mass: float | None = None,
    frame: str = "auto",
    friction: float = 0.5,
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
    vertices, faces = _read(file, kind)
    vertices = vertices * UNITS[unit]
    notes: list[str] = []
    vertices, faces = _checked(file.name, vertices, faces, unit, notes)
    volume, center, moments = _volume_integrals(vertices, faces)
    if volume < 0.0:
        faces = np.ascontiguousarray(faces[:, ::-1])
        notes.append("it was inside out and is turned")
        volume, moments = -volume, -moments
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


def _read(file: Path, kind: str) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices (v, 3) in the file's unit and faces (f, 3)."""
    import trimesh

    try:
        if file.stat().st_size > _MOST_BYTES:
            raise InputError(f"{file.name!r} is larger than 1 GB; simplify the mesh.")
        content = file.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {str(file)!r}: {error.strerror}.") from None
    if content[:4] == b"PK\x03\x04" or content[:2] in (b"\x1f\x8b", b"BZ"):
        raise InputError(f"{file.name!r} is an archive; unpack it and give the mesh inside.")
    if kind in ("gltf", "glb"):
        content = _self_contained(file.name, content, kind)
    elif kind == "obj":
        content = b"\n".join(line for line in content.splitlines() if line[:6] not in (b"mtllib", b"usemtl"))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of coordinates that are not finite, said below
            scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, resolver=_Nothing(), process=False)
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    except MemoryError:
        raise InputError(f"{file.name!r} does not fit into memory; simplify the mesh.") from None
    except Exception as error:  # a damaged file can make the reader stumble anywhere
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{file.name!r} cannot be read as {kind.upper()}: {reason}.") from None
    if not meshes:
        raise InputError(f"{file.name!r} holds no triangles; export a surface mesh.")
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    vertices = np.vstack([np.asarray(mesh.vertices, dtype=np.float64) for mesh in meshes])
    faces = np.vstack([np.asarray(mesh.faces) + start for mesh, start in zip(meshes, starts, strict=True)])
    return vertices, faces.astype(np.int64)


class _Nothing(dict):
    """What a file may refer to: nothing outside itself."""

    def __missing__(self, name: str) -> bytes:
        raise InputError(f"it refers to {str(name)[:60]!r}, which is not inside; export one self-contained file (GLB)")


def _self_contained(name: str, content: bytes, kind: str) -> bytes:
    """Return a glTF without materials and images, or raise InputError if its triangles are elsewhere."""
    binary = b""
    text = content
    if kind == "glb":
        if content[:4] != b"glTF" or len(content) < 20:
            raise InputError(f"{name!r} is not a GLB file.")
        length = struct.unpack("<I", content[12:16])[0]
        text, binary = content[20 : 20 + length], content[20 + length :]
    try:
        data: Any = json.loads(text)
        buffers = data.get("buffers", []) if isinstance(data, dict) else None
        if not isinstance(buffers, list):
            raise ValueError("its buffers are no list")
        for buffer in buffers:
            where = buffer.get("uri")
            if where is not None and not str(where).startswith("data:"):
                raise InputError(
                    f"{name!r} keeps its triangles in {str(where)[:60]!r}; export one self-contained file (GLB)."
                )
    except (ValueError, AttributeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name!r} is not glTF: {' '.join(str(error).split())[:120]}.") from None
    packed = [e for e in data.get("extensionsRequired", []) if "compression" in str(e) or "meshopt" in str(e)]
    if packed:
        raise InputError(f"{name!r} is compressed ({packed[0]}); export it without compression.")
    for key in ("images", "textures", "materials", "samplers", "extensionsRequired", "extensionsUsed"):
        data.pop(key, None)
    for mesh in data.get("meshes", []):
        for primitive in mesh.get("primitives", []) if isinstance(mesh, dict) else []:
            if isinstance(primitive, dict):
                primitive.pop("material", None)
    text = json.dumps(data).encode()
    if kind == "gltf":
        return text
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<II", 2, 20 + len(text) + len(binary)) + struct.pack("<I", len(text)) + b"JSON"
    return head + text + binary


def _checked(
    name: str, vertices: Array, faces: NDArray[np.int64], unit: str, notes: list[str]
) -> tuple[Array, NDArray[np.int64]]:
    """Return the mesh with one vertex at each place and no triangle without area, or raise InputError."""
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{name!r} has triangles whose corners are not there (it has {len(vertices)} vertices).")
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    if not np.all(np.isfinite(vertices[used])):
        raise InputError(f"{name!r} has coordinates that are not finite; repair the mesh.")
    size = vertices[used].max(axis=0) - vertices[used].min(axis=0)
    numbers = (f"{1e3 * s:.4g}" if s < 10.0 else f"{1e3 * s:,.0f}" for s in size)
    shown = f"{' x '.join(numbers)} mm in unit {unit}"
    if size.max() < _SMALLEST or size.max() > _LARGEST:
        fitting = [u for u, meters in UNITS.items() if 0.02 <= size.max() / UNITS[unit] * meters <= 0.5]
        guess = f"; is its unit {' or '.join(fitting)}?" if fitting else "."
        raise InputError(
            f"{name!r} is {shown}, too {'small' if size.max() < _SMALLEST else 'large'} for a hand "
            f"({1e3 * _SMALLEST:g} mm to {1e3 * _LARGEST:g} mm){guess}"
        )
    vertices, faces = _merged(vertices, faces)
    corners = vertices[faces]
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = (
        (doubled <= 1e-16) | (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    )
    if np.all(flat):
        raise InputError(f"{name!r} is degenerate: none of its {len(faces):,} triangles has an area ({shown}).")
    if np.any(flat):
        notes.append(f"{np.sum(flat):,} triangles without area are left out")
        faces, doubled = faces[~flat], doubled[~flat]
    if size.min() < _FLATTEST:
        raise InputError(f"{name!r} is flat ({shown}); give the surface of a solid.")
    holes = _holes(vertices, faces, 0.5 * float(doubled.sum()))
    if holes.twisted_edges > 0.02 * len(faces):
        raise InputError(
            f"{name!r} ({shown}) has {holes.twisted_edges:,} edges whose two faces disagree about what is outside; "
            "make the normals consistent in your modeling program."
        )
    if holes.share > MOST_OPEN:
        raise InputError(
            f"{name!r} ({shown}) is an open surface: {holes.borders} hole{'s' * (holes.borders > 1)} of "
            f"{100 * holes.share:.0f} % of its area; close it."
        )
    if holes.borders:
        notes.append(
            f"not watertight: {holes.borders} hole{'s' * (holes.borders > 1)}, the largest of "
            f"{1e6 * holes.largest:.2g} mm^2, bridged"
        )
    return vertices, faces


def _merged(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Return the mesh with one vertex at each place (to 10 nm), in the order of first use."""
    places = np.round(vertices * 1e8).astype(np.int64)
    key = np.ascontiguousarray(places).view(np.dtype((np.void, 24))).ravel()
    _, first, where = np.unique(key, return_index=True, return_inverse=True)
    merged = where.ravel()[faces]
    used = np.zeros(len(first), dtype=bool)
    used[merged] = True
    number = np.cumsum(used) - 1
    return np.ascontiguousarray(vertices[first[used]]), number[merged]


def _holes(vertices: Array, faces: NDArray[np.int64], area: float) -> _Holes:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    n = len(vertices)
    forward, counts = np.unique(edges[:, 0] * n + edges[:, 1], return_counts=True)
    backward = (forward % n) * n + forward // n
    lonely = ~np.isin(forward, backward)
    twisted = int(np.sum(counts[counts > 1] - 1))
    # An edge without partner is on a border; twice in the same direction, its faces disagree instead.
    border = forward[lonely & (counts == 1)]
    if not len(border):
        return _Holes(0, 0, twisted, 0.0, 0.0)
    a, b = border // n, border % n
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
    label = connected_components(graph, directed=False)[1][a]
    _, label = np.unique(label, return_inverse=True)
    middle = vertices.mean(axis=0)
    spans = 0.5 * np.cross(vertices[a] - middle, vertices[b] - middle)
    areas = np.linalg.norm(
        np.column_stack([np.bincount(label, weights=spans[:, i]) for i in range(3)]), axis=1
    )  # vector area of a border: exact for a plane hole
    return _Holes(len(areas), len(border), twisted, float(areas.sum()) / area, float(areas.max()))


def _volume_integrals(vertices: Array, faces: NDArray[np.int64]) -> tuple[float, Array, Array]:
    """Return volume, center of volume (3,) and second moments (3, 3) about it, of the tetrahedra over the middle."""
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    a, b, c = (vertices[faces[:, k]] - middle for k in range(3))
    six = np.einsum("ij,ij->i", a, np.cross(b, c))
    volume = float(six.sum()) / 6.0
    if volume == 0.0:
        return 0.0, middle, np.zeros((3, 3))
    total = a + b + c
    center = np.einsum("i,ij->j", six, total) / (24.0 * volume)
    moments = sum(np.einsum("i,ij,ik->jk", six, x, x) for x in (a, b, c, total)) / 120.0
    moments = moments - volume * np.outer(center, center)
    lower, upper = vertices.min(axis=0) - middle, vertices.max(axis=0) - middle
    return volume, middle + np.clip(center, lower, upper), moments


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

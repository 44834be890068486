"""Triangles from the bytes of a mesh file: STL, OBJ, PLY, glTF and GLB.

Nothing but a regular file is read: no device, no pipe, no archive. Material files and textures that a file names are
neither looked for nor fetched; of a glTF, a buffer in the same folder or below is read, and no other.

Read although it is not quite what the format says: text in UTF-16, decimal commas, a binary STL followed by other bytes
or whose header counts no triangles. A note says so. STL, OBJ and PLY have readers of their own (stl_files.py and so
on), glTF is read by trimesh.
"""

import base64
import io
import json
import re
import stat
import struct
import warnings
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.grasping.object.obj_files import read_obj
from surehold.grasping.object.ply_files import read_ply
from surehold.grasping.object.polygons import triangles_of
from surehold.grasping.object.stl_files import binary_stl, read_binary_stl, read_text_stl

__all__ = ["MESH_FORMATS", "read_mesh"]

MESH_FORMATS: Final = ("stl", "obj", "ply", "gltf", "glb")
_MOST_BYTES: Final = 2**30
_NAMES: Final = re.compile(rb"(?m)^[ \t]*(#|o |g |solid|endsolid|mtllib|usemtl|comment|obj_info|format).*$")


def read_mesh(file: Path, kind: str) -> tuple[NDArray[np.float64], NDArray[np.int64], list[str]]:
    """Return vertices (v, 3) in the file's unit, faces (f, 3), and notes on how the file was read.

    Raises
    ------
    InputError
        If the file cannot be read, is no mesh of that kind, or has its triangles where they are not read from.
    """
    notes: list[str] = []
    content = _bytes(file)
    if content[:4] == b"PK\x03\x04" or content[:2] in (b"\x1f\x8b", b"BZ"):
        raise InputError(f"{file.name!r} is an archive; unpack it and give the mesh inside.")
    if content.startswith(b"version https://git-lfs"):
        raise InputError(f"{file.name!r} is a pointer of Git LFS, not the mesh; run git lfs pull and give it again.")
    if kind in ("gltf", "glb"):
        content = _self_contained(file, content, kind)
    try:
        facets = binary_stl(content, notes) if kind == "stl" else None
        if kind == "obj" or (kind == "stl" and facets is None) or (kind == "ply" and not _is_binary(content)):
            content = _plain_text(content, notes)
        if kind == "stl":
            vertices, faces = read_text_stl(content, notes) if facets is None else read_binary_stl(facets)
        elif kind == "obj":
            vertices, faces = read_obj(content)
        elif kind == "ply":
            ply = read_ply(content)
            vertices, faces = ply.vertices, triangles_of(ply.vertices, ply.corners, ply.counts)
        else:
            vertices, faces = _by_trimesh(content, kind)
    except MemoryError:
        raise InputError(f"{file.name!r} does not fit into memory; simplify the mesh.") from None
    except Exception as error:  # a damaged file can make the reader stumble anywhere
        reason = " ".join(str(error).split())[:160].rstrip(".") or type(error).__name__
        raise InputError(f"{file.name!r} cannot be read as {kind.upper()}: {reason}.") from None
    if not len(faces):
        raise InputError(f"{file.name!r} holds no triangles; export a surface mesh.")
    if vertices.shape[1:] != (3,):
        raise InputError(f"{file.name!r} has vertices without three coordinates; export the mesh again.")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{file.name!r} has triangles whose corners are not there (it has {len(vertices)} vertices).")
    return vertices, faces, notes


def _by_trimesh(content: bytes, kind: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices and triangles of glTF, none where there are none."""
    import trimesh

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of coordinates that are not finite, which are refused later
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, resolver=_Nothing(), process=False)
    meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    if not meshes:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    vertices = np.vstack([np.asarray(mesh.vertices, dtype=np.float64) for mesh in meshes])
    faces = np.vstack([np.asarray(mesh.faces) + start for mesh, start in zip(meshes, starts, strict=True)])
    return vertices, faces.astype(np.int64)


class _Nothing(dict):
    """What a file may refer to: nothing outside itself."""

    def __missing__(self, name: str) -> bytes:
        raise InputError(f"it refers to {str(name)[:60]!r}, which is not inside; export one self-contained file (GLB)")


def _bytes(file: Path) -> bytes:
    """Return the content of a regular file of at most 1 GB."""
    try:
        status = file.stat()
        if not stat.S_ISREG(status.st_mode):  # reading a pipe or a device might never end
            raise InputError(f"{str(file)!r} is no regular file; give a file on disk.")
        if status.st_size > _MOST_BYTES:
            raise InputError(f"{file.name!r} is larger than 1 GB; simplify the mesh.")
        return file.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot read {str(file)!r}: {getattr(error, 'strerror', None) or error}.") from None


def _is_binary(content: bytes) -> bool:
    return b"format binary" in content[:200]


def _plain_text(content: bytes, notes: list[str]) -> bytes:
    """Return text as UTF-8 without a byte order mark and with decimal points."""
    even, odd = content[0:400:2], content[1:400:2]
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    if wide or (len(odd) and not any(even) and all(odd)) or (len(odd) and not any(odd) and all(even)):
        encoding = "utf-16" if wide else ("utf-16-le" if any(even) else "utf-16-be")
        content = content.decode(encoding, errors="replace").encode()
        notes.append("its text is UTF-16")
    content = content.removeprefix(b"\xef\xbb\xbf")
    numbers = _NAMES.sub(b"", content)  # a name or a version has points of its own
    if re.search(rb"\d,\d", numbers) and not re.search(rb"\d\.\d", numbers):
        content = content.replace(b",", b".")
        notes.append("its decimal commas are read as points")
    return content


def _self_contained(file: Path, content: bytes, kind: str) -> bytes:
    """Return a glTF with its buffers inside and without materials and images, or raise InputError."""
    name, binary, text = file.name, b"", content
    if kind == "glb":
        if content[:4] != b"glTF" or len(content) < 20:
            raise InputError(f"{name!r} is not a GLB file.")
        version, _, length = struct.unpack("<III", content[4:16])
        if version != 2:
            raise InputError(f"{name!r} is glTF {version}; export it as glTF 2.0.")
        text, binary = content[20 : 20 + length], content[20 + length :]
    try:
        data: Any = json.loads(text)
        if not isinstance(data, dict):
            raise ValueError("it is no mapping")
        version = str(data.get("asset", {}).get("version", "2.0"))
        if not version.startswith("2"):
            raise InputError(f"{name!r} is glTF {version[:10]}; export it as glTF 2.0.")
        for key in ("buffers", "meshes", "accessors"):
            if not isinstance(data.get(key, []), list) or not all(isinstance(e, dict) for e in data.get(key, [])):
                raise ValueError(f"its {key} are no list of mappings, but {str(data[key])[:40]}")
        room = len(content)
        for buffer in data.get("buffers", []):
            where = buffer.get("uri")
            if where is not None and not str(where).startswith("data:"):
                inside = _buffer(file, str(where))
                room += len(inside)
                buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(inside).decode()
        if any(accessor.get("count", 0) > room for accessor in data.get("accessors", [])):
            raise ValueError("it counts more numbers than it has bytes")
        packed = [e for e in data.get("extensionsRequired", []) if "compression" in str(e) or "meshopt" in str(e)]
        if packed:
            raise InputError(f"{name!r} is compressed ({packed[0]}); export it without compression.")
        _check_triangles(name, data)
        for key in ("images", "textures", "materials", "samplers", "extensionsRequired", "extensionsUsed"):
            data.pop(key, None)
        for mesh in data.get("meshes", []):
            for primitive in mesh.get("primitives", []):
                primitive.pop("material", None)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name!r} is not glTF: {' '.join(str(error).split())[:120]}.") from None
    text = json.dumps(data).encode()
    if kind == "gltf":
        return text
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<II", 2, 20 + len(text) + len(binary)) + struct.pack("<I", len(text)) + b"JSON"
    return head + text + binary


def _check_triangles(name: str, data: dict[str, Any]) -> None:
    """Refuse triangles that are stored in a way that is not read: without it they would be others."""
    accessors = data.get("accessors", [])
    for mesh in data.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            places = [primitive.get("attributes", {}).get("POSITION"), primitive.get("indices")]
            used = [accessors[i] for i in places if isinstance(i, int) and 0 <= i < len(accessors)]
            if any("sparse" in accessor for accessor in used):
                found = "sparse accessors"
            elif any(accessor.get("normalized") for accessor in used):
                found = "whole numbers normalized to 0 to 1"
            elif primitive.get("mode") == 6:
                found = "a fan of triangles"
            else:
                continue
            raise InputError(f"{name!r} keeps its triangles as {found}, which is not read; export plain floats.")


def _buffer(file: Path, uri: str) -> bytes:
    """Return a buffer that lies in the folder of a glTF or below."""
    folder = file.parent.resolve()
    where = (folder / unquote(uri).replace("\0", "")).resolve()
    if "://" in uri or not where.is_relative_to(folder):
        raise InputError(
            f"{file.name!r} keeps its triangles in {uri[:60]!r}, outside its folder; export one self-contained file "
            "(GLB)."
        )
    return _bytes(where)

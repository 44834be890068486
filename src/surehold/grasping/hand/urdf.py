"""A URDF file as MuJoCo takes it: collision meshes found, of whatever format, and nothing that is only looked at.

Meshes are named relative to the file, as `package://NAME/PATH` or as `file:///PATH`. A package is looked for beside the
file and in the folders above it, by its name or as the folder itself. MuJoCo reads some formats and drops the folders
of names; it is given triangles instead.
"""

from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np

from surehold.errors import InputError, unknown_name
from surehold.grasping.object.mesh_reading import MESH_FORMATS, read_mesh
from surehold.grasping.plain_data import regular_bytes

__all__ = ["read_urdf"]


def read_urdf(path: Path) -> tuple[str, dict[str, bytes]]:
    """Return the text of a URDF file without visuals, and the meshes that it names, as binary STL.

    Raises
    ------
    InputError
        If the file cannot be read, is no XML, two joints have one name, the limits of a joint are exchanged, a joint
        mimics one that is not there, or a mesh is not found or is none.
    """
    content = regular_bytes(path)
    if b"<!ENTITY" in content:  # which can grow without bound
        raise InputError(f"{str(path)!r} defines entities; give a plain URDF file.")
    try:
        robot = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{str(path)!r} is not a model that MuJoCo can read: {error}.") from None
    if any("xacro" in element.tag for element in robot.iter()):
        raise InputError(f"{str(path)!r} is a xacro file; make a URDF of it: xacro {path.name} > plain.urdf.")
    _check_joints(robot, path)
    for joint in robot.iterfind("joint"):
        _complete_limits(joint, path)
    folder = path.resolve().parent
    for compiler in robot.iterfind("mujoco/compiler"):
        folder = folder / compiler.attrib.pop("meshdir", "")
    meshes: dict[Path, str] = {}
    assets: dict[str, bytes] = {}
    for link in robot.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for mesh in link.iterfind("collision/geometry/mesh"):
            file = _found(mesh.get("filename", ""), path, folder)
            if file not in meshes:
                meshes[file] = f"{file.stem}_{len(meshes)}.stl"
                assets[meshes[file]] = _triangles(file)
            mesh.set("filename", meshes[file])
    return ElementTree.tostring(robot, encoding="unicode"), assets


def _check_joints(robot: ElementTree.Element, path: Path) -> None:
    """Refuse a joint that follows none, which MuJoCo would leave where it is, and a name that two joints have."""
    names = [joint.get("name", "") for joint in robot.iterfind("joint")]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{str(path)!r} has {names.count(name)} joints {name!r}; give each a name of its own.")
    for joint in robot.iterfind("joint"):
        for mimic in joint.iterfind("mimic"):
            leader = mimic.get("joint", "")
            if leader not in names or leader == joint.get("name"):
                others = [name for name in names if name != joint.get("name")]
                raise InputError(
                    f"{str(path)!r}: joint {joint.get('name')!r} mimics {leader!r}: "
                    f"{unknown_name('joint', leader, others)}"
                )


def _complete_limits(joint: ElementTree.Element, path: Path) -> None:
    """Write the end that a limit leaves out, which is 0 in URDF: MuJoCo takes such a joint as one without limits.

    Exchanged ends it takes so, too; they are refused.
    """
    for limit in joint.iterfind("limit"):
        if joint.get("type") not in ("revolute", "prismatic") or not {"lower", "upper"} & set(limit.attrib):
            continue
        lower, upper = limit.attrib.setdefault("lower", "0"), limit.attrib.setdefault("upper", "0")
        try:
            valid = float(lower) <= float(upper)
        except ValueError:
            valid = False
        if not valid:
            raise InputError(
                f"{str(path)!r}: joint {joint.get('name')!r} has the limits {lower[:20]!r} to {upper[:20]!r}; give two "
                "numbers, the lower one first [rad or m]."
            )


def _found(name: str, urdf: Path, folder: Path) -> Path:
    scheme, _, place = name.rpartition("://")
    place = unquote(place) if scheme else place
    above = [folder, *folder.parents]
    if scheme in ("package", "model"):
        inside = place.partition("/")[2]
        tries = [base / place for base in above] + [base / inside for base in above]
    elif scheme in ("", "file"):
        tries = [urdf.parent / place, folder / place, folder / Path(place).name]
    else:
        raise InputError(f"{str(urdf)!r}: mesh {name[:80]!r} is not on this disk; nothing is fetched.")
    for file in tries:
        if file.is_file():
            return file.resolve()
    where = "there" if scheme == "file" else f"beside the file or above it (first tried: {str(tries[0])!r})"
    raise InputError(f"{str(urdf)!r}: mesh {name[:80]!r} is not {where}; put it there, as the file names it.")


def _triangles(file: Path) -> bytes:
    """Return the triangles of a mesh file as binary STL."""
    kind = file.suffix.lower().removeprefix(".")
    if kind not in MESH_FORMATS:
        raise InputError(
            f"mesh {str(file)!r} is not read; save it as one of {', '.join(MESH_FORMATS)} and name that in the URDF."
        )
    vertices, faces, _ = read_mesh(file, kind)
    rows = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = vertices[faces]
    return bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes()

"""The object beside its grasps: a mesh in meters, and the folder of meshes that DexGraspBench reads."""

import json
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.object.model import GraspObject
from surehold.store.atomic import checked_folder, write_file

__all__ = ["write_object_folder", "write_object_mesh"]

_COARSE: Final = (1e-3, 0.015)  #: tolerance and smallest size of the benchmark's convex pieces [m]


def write_object_mesh(path: str | Path, obj: GraspObject) -> None:
    """Write the object's surface as OBJ, in meters and in the object's own frame."""
    write_file(Path(path), _obj_text(obj.vertices, obj.faces))


def write_object_folder(folder: str | Path, obj: GraspObject) -> None:
    """Write what DexGraspBench reads of an object: its surface, its convex pieces, its mass.

    Raises
    ------
    InputError
        If the mesh is not watertight, or the folder cannot be written.
    """
    from scipy.spatial import ConvexHull

    from surehold.grasping.physics.convex_pieces import convex_pieces

    pieces = convex_pieces(obj.vertices, obj.faces, *_COARSE)
    place = Path(folder)
    for part in ("mesh", "urdf/meshes", "info"):
        checked_folder(place / part)
    write_object_mesh(place / "mesh" / "simplified.obj", obj)
    volume = 0.0
    for i, corners in enumerate(pieces):
        hull = ConvexHull(corners)
        volume += hull.volume
        outward = np.einsum("fi,fi->f", np.cross(*_edges(corners, hull.simplices)), hull.equations[:, :3]) > 0.0
        faces = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])
        write_file(place / "urdf" / "meshes" / f"convex_piece_{i:03d}.obj", _obj_text(corners, faces))
    about = {
        "gravity_center": obj.center_of_mass.tolist(),
        "obb": (2.0 * obj.box_half_extents).tolist(),
        "scale": 1.0,
        "density": obj.mass / volume,
        "mass": obj.mass,
    }
    write_file(place / "info" / "simplified.json", json.dumps(about, indent=1) + "\n")


def _edges(corners: NDArray[np.float64], faces: NDArray[np.integer]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a, b, c = (corners[faces[:, k]] for k in range(3))
    return b - a, c - a


def _obj_text(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> str:
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    rows += [f"f {i} {j} {k}" for i, j, k in (faces + 1).tolist()]
    return "\n".join(rows) + "\n"

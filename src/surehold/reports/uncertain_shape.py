"""A surface that is known here and unknown there, as meshes of a scene: colored by its standard deviation."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.reports.run_report import SceneMesh

__all__ = ["LEGEND", "shape_meshes"]

_CLASSES: Final = (("known", 0.0015, "#3f8f5f"), ("uncertain", 0.004, "#e0b84a"), ("unknown", np.inf, "#c9524a"))
#: What the colors mean.
LEGEND: Final = "green is known to 1.5 mm (one standard deviation), yellow to 4 mm, red less well."


def shape_meshes(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    deviation: NDArray[np.floating],
    see_through: bool = False,
) -> tuple[SceneMesh, ...]:
    """Return up to three meshes of a surface (v, 3), (f, 3) [m], split by the deviation (v,) [m] of its faces."""
    of_face = np.asarray(deviation)[faces].mean(axis=1)
    number = np.searchsorted([limit for _, limit, _ in _CLASSES], of_face)
    meshes = []
    for k, (name, _, color) in enumerate(_CLASSES):
        mine = faces[number == k]
        if len(mine):
            used, where = np.unique(mine, return_inverse=True)
            placed = vertices[used].astype(np.float32)
            corners = where.reshape(-1, 3).astype(np.int32)
            meshes.append(SceneMesh(f"surface, {name}", placed, corners, color, see_through))
    return tuple(meshes)

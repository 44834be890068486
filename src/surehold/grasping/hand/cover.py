"""Capsules that cover a body, for fingers that close on capsules.

A box is covered by parallel capsules along its longest axis whose radius is its smallest half extent, no farther apart
than that radius: the hollows between them are at most 0.14 radius deep. A mesh is cut across its longest axis into
pieces of at most `PIECE`, each covered like the box around it.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["PIECE", "SHORTEST", "Capsule", "cover_box", "cover_mesh"]

Array = NDArray[np.float64]
Capsule = tuple[Array, Array, float]  #: ends (3,) of the axis in the frame of the body [m], radius [m]

SHORTEST: Final = 1e-5  #: a sphere is a capsule of this length [m]
PIECE: Final = 0.020  #: longest piece of a mesh [m]


def cover_box(center: Array, half: Array, trim: tuple[bool, bool] = (True, True)) -> list[Capsule]:
    """Return parallel capsules along the longest axis of a box that cover it up to its edges."""
    order = np.argsort(half, kind="stable")
    thin, wide, long = (int(k) for k in order)
    radius = max(float(half[thin]), 1e-4)
    across = float(half[wide]) - radius
    count = 1 if across < 0.1 * radius else int(np.ceil(2.0 * across / radius)) + 1
    ends = [float(half[long]) - (radius if cut else 0.0) for cut in trim]
    ends = [max(end, 0.5 * SHORTEST) for end in ends]
    capsules = []
    for shift in np.linspace(-across, across, count) if count > 1 else [0.0]:
        middle = center + shift * np.eye(3)[wide]
        capsules.append((middle - ends[0] * np.eye(3)[long], middle + ends[1] * np.eye(3)[long], radius))
    return capsules


def cover_mesh(vertices: Array, faces: NDArray[np.integer]) -> list[Capsule]:
    """Return capsules that cover a mesh, piece by piece along its longest axis."""
    corners = vertices[faces]  # (f, 3, 3)
    grid = [(i / 8.0, j / 8.0) for i in range(9) for j in range(9 - i)]
    weights = np.array([(1.0 - u - v, u, v) for u, v in grid])
    points = np.einsum("sk,fki->fsi", weights, corners).reshape(-1, 3)
    lower, upper = points.min(axis=0), points.max(axis=0)
    long = int(np.argmax(upper - lower))
    count = int(np.ceil((upper - lower)[long] / PIECE))
    cuts = np.linspace(lower[long], upper[long], count + 1)
    capsules = []
    for i in range(count):
        piece = points[(points[:, long] >= cuts[i] - 1e-9) & (points[:, long] <= cuts[i + 1] + 1e-9)]
        if len(piece):
            low, high = piece.min(axis=0), piece.max(axis=0)
            low[long], high[long] = cuts[i], cuts[i + 1]
            capsules += cover_box(0.5 * (low + high), 0.5 * (high - low))
    return capsules

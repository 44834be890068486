"""The shipped objects, built from solids: the mug, the bottle, the glass and the drill.

Each object stands in its own frame: z up, x to the right, y to the front, the origin on its axis at the foot.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from surehold.errors import InputError, unknown_name
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.solids import RevolvedProfile, RoundedBox, Solid, Tube, triangles

__all__ = ["OBJECTS", "shipped_object"]


def _mug() -> tuple[Solid, ...]:
    """Stoneware: 80 mm wide, 95 mm high, wall 4 mm, bottom 6 mm, a round bar of 11 mm as handle towards the back."""
    outer, inner, height, bottom, edge = 0.040, 0.036, 0.095, 0.006, 0.0019
    cup = RevolvedProfile(_cup(outer, outer, inner, inner, height, bottom, edge), edge)
    bar = 0.0055
    turn = np.linspace(0.0, np.pi, 21)
    reach = inner + bar + 0.030 * np.sin(turn) ** 0.8  # the ends are tangent to the inner wall, not beyond it
    handle = np.column_stack([np.zeros_like(turn), -reach, 0.0475 + 0.029 * np.cos(turn)])
    return cup, Tube(tuple(map(tuple, handle.tolist())), bar)


def _bottle() -> tuple[Solid, ...]:
    """A full small water bottle: 52.5 mm wide, 160 mm high, shoulder from 95 to 125 mm, cap of 13 mm."""
    body, cap, height, edge = 0.02625, 0.0065, 0.160, 0.002
    fall = np.linspace(0.0, 1.0, 13)
    shoulder = np.column_stack([cap + (body - cap) * 0.5 * (1.0 + np.cos(fall * np.pi)), 0.095 + 0.030 * fall])
    shoulder -= edge * np.array([1.0, 0.0])
    corners = [(0.0, edge), (body - edge, edge), *shoulder.tolist(), (cap - edge, height - edge), (0.0, height - edge)]
    return (RevolvedProfile(tuple((float(r), float(z)) for r, z in corners), edge),)


def _glass() -> tuple[Solid, ...]:
    """A tall drinking glass: 71 mm wide at the rim, 57 mm at the foot, 159 mm high, wall 2.4 mm, bottom 8 mm."""
    foot, rim, height, wall, bottom = 0.0285, 0.0355, 0.159, 0.0024, 0.008
    return (RevolvedProfile(_cup(foot, rim, foot - wall, rim - wall, height, bottom, 0.0011), 0.0011),)


def _drill() -> tuple[Solid, ...]:
    """A cordless drill of 190 x 60 x 180 mm: motor housing along x, chuck in front, tilted grip, battery below."""
    housing = RevolvedProfile(
        ((0.0, -0.073), (0.024, -0.073), (0.028, -0.068), (0.028, 0.028), (0.022, 0.048), (0.0, 0.048)),
        0.002,
        origin=(0.0, 0.0, 0.150),
        axis="x",
    )
    chuck = RevolvedProfile(
        ((0.0, 0.045), (0.018, 0.045), (0.018, 0.080), (0.009, 0.100), (0.005, 0.114), (0.0, 0.114)),
        0.001,
        origin=(0.0, 0.0, 0.150),
        axis="x",
    )
    grip = RoundedBox((-0.028, 0.0, 0.083), (0.021, 0.0165, 0.070), 0.012, tilt=0.20)
    battery = RoundedBox((-0.030, 0.0, 0.020), (0.045, 0.030, 0.020), 0.006)
    return housing, chuck, grip, battery


def _cup(
    foot: float, rim: float, inner_foot: float, inner_rim: float, height: float, bottom: float, edge: float
) -> tuple[tuple[float, float], ...]:
    """Return the profile of a cup, smaller by `edge` all around: it is grown by that again, with round edges."""
    slope = (inner_rim - inner_foot) / height
    return (
        (0.0, edge),
        (foot - edge, edge),
        (rim - edge, height - edge),
        (inner_rim + edge, height - edge),
        (inner_foot + slope * bottom + edge, bottom - edge),
        (0.0, bottom - edge),
    )


#: name -> (builder of the solids, density [kg/m^3], friction at a dry finger of elastomer)
_BUILDERS: Final[dict[str, tuple[Callable[[], tuple[Solid, ...]], float, float]]] = {
    "mug": (_mug, 2300.0, 0.5),  # glazed
    "bottle": (_bottle, 1000.0, 0.45),  # smooth plastic
    "glass": (_glass, 2500.0, 0.4),
    "drill": (_drill, 1100.0, 0.7),  # a grip of rubber
}

#: Names of the shipped objects.
OBJECTS: Final[tuple[str, ...]] = tuple(_BUILDERS)


@cache
def shipped_object(name: str) -> GraspObject:
    """Return the shipped object of that name: mug, bottle, glass or drill.

    Raises
    ------
    InputError
        If no object of that name is shipped.
    """
    if name not in _BUILDERS:
        error = unknown_name("object", name, OBJECTS)
        if not Path(name).suffix:
            raise error
        call = f"surehold.grasping.object.mesh_files.load_mesh({name!r}).object"
        raise InputError(f"{error} Load a mesh's file first: {call}.")
    build, density, friction = _BUILDERS[name]
    solids = build()
    vertices, faces, volume, center = triangles(solids)
    return GraspObject(name, vertices, faces, density * volume, center, friction, solids)

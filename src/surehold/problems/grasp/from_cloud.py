"""From a point cloud in words to an object of which the shape is not known for certain."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.object.mesh_files import UNITS
from surehold.grasping.object.model import GraspObject
from surehold.grasping.shape.belief import ShapeBelief
from surehold.grasping.shape.prior import PRIORS
from surehold.problems.grasp.told_contacts import checked_against, contacts_of_file

__all__ = ["belief_of_file", "object_of_cloud"]

_MOST_SHAPES = 64


def object_of_cloud(words: Mapping[str, Any]) -> tuple[GraspObject, str]:
    """Return the mean shape of a cloud, with draws of it, and a line that says what was found; words as in options.py.

    Raises
    ------
    InputError
        If the file is refused, or an option contradicts it.
    """
    shapes = words["shapes"]
    if not 0 <= shapes <= _MOST_SHAPES:
        raise InputError(f"shapes are {shapes}; give 0 to {_MOST_SHAPES}.")
    belief, line = belief_of_file(words)
    mean, *draws = belief.objects(shapes, np.random.default_rng(0))
    size = " x ".join(f"{2e3 * half:.0f}" for half in mean.box_half_extents)
    known = replace(mean, draws=tuple(draws), deviation=belief.surface.deviation(mean.vertices))
    return known, f"{line}; mean shape {size} mm, {1e3 * mean.mass:.3g} g"


def belief_of_file(words: Mapping[str, Any]) -> tuple[ShapeBelief, str]:
    """Return what a cloud's file says of the shape, and a line about it.

    Raises
    ------
    InputError
        If the file is refused, or an option contradicts it.
    """
    from surehold.extras import require
    from surehold.grasping.shape.cloud_files import read_cloud
    from surehold.grasping.shape.completion import belief_of_cloud
    from surehold.grasping.shape.point_cloud import cleaned

    require("mesh", "the shape of a point cloud")
    if words.get("object"):
        raise InputError(f"both object '{words['object']}' and a cloud are given; leave one of them out.")
    if words.get("frame"):
        raise InputError("frame is for mesh files; the box of a cloud follows its table, camera and file.")
    unit, noise, prior = words["unit"] or "m", words["cloud_noise"], words["prior"]
    if unit not in UNITS:
        raise unknown_name("unit", unit, UNITS)
    if prior not in PRIORS:
        raise unknown_name("prior shape", prior, PRIORS)
    if noise is not None and not 0.0 < noise <= 0.02:
        raise InputError(f"cloud-noise is {noise!r} m; give a standard deviation above 0 and up to 0.02 m.")
    if words["mass"] is not None and not 0.0 < words["mass"] <= 100.0:
        raise InputError(f"mass is {words['mass']!r}; give kilograms above 0 and up to 100.")
    touched = contacts_of_file(words["contacts"]) if words["contacts"] else None
    raw = read_cloud(words["cloud"])
    if words["normals"] and raw.normals is None:
        raise InputError(f"{words['cloud']!r} holds no normals; leave --normals out, they are estimated then.")
    camera = _camera(words["camera"])
    camera = raw.camera if camera is None else camera
    scale = UNITS[unit]
    cloud = cleaned(
        raw.points * scale,
        raw.normals if words["normals"] else None,
        None if camera is None else camera * scale,
        noise,
    )
    file = Path(words["cloud"])
    belief = belief_of_cloud(cloud, prior, name=file.stem, mass=words["mass"])
    notes = list(cloud.notes)
    if touched is not None:
        checked_against(belief.surface, touched, f"{words['contacts']!r}")
        told = belief.surface.observations + touched
        belief = belief.knowing(told, np.vstack([belief.free, touched.free]))
        notes.append(f"{len(touched.points)} touches")
    return belief, "; ".join([f"{file.name}: {len(raw.points):,} points", *notes])


def _camera(given: str | Sequence[float]) -> NDArray[np.float64] | None:
    if not len(given):
        return None
    try:
        numbers = [float(word) for word in (given.split(",") if isinstance(given, str) else given)]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not np.all(np.isfinite(numbers)):
        raise InputError(f"camera is {given!r}; give three numbers x,y,z in the cloud's unit, such as 0,0,0.")
    return np.array(numbers)

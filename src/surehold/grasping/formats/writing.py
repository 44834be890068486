"""A folder of grasps for the next tool: the grasps in one or several formats, and the object's meshes beside them."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from surehold.errors import unknown_name
from surehold.grasping.formats.dexgraspbench import write_dexgraspbench_files
from surehold.grasping.formats.graspgen import write_graspgen_file
from surehold.grasping.formats.gripper import described_gripper, in_root_frame, joint_order
from surehold.grasping.formats.isaac import write_isaac_file
from surehold.grasping.formats.named import FORMATS
from surehold.grasping.formats.object_files import write_object_folder, write_object_mesh
from surehold.grasping.formats.stored import GraspFile, StoredGrasp
from surehold.grasping.hand.model import Hand, Preshape
from surehold.grasping.object.model import GraspObject

__all__ = ["checked_formats", "write_grasps"]


def checked_formats(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of formats, "isaac" first; InputError with the valid ones if one is unknown."""
    given = [name.strip() for name in names if name.strip()]
    for name in given:
        if name not in FORMATS:
            raise unknown_name("format of grasps", name, FORMATS)
    return tuple(dict.fromkeys(["isaac", *given]))


def write_grasps(
    folder: str | Path,
    grasps: Iterable[StoredGrasp],
    obj: GraspObject,
    hand: Hand,
    preshape: Preshape,
    formats: Iterable[str] = ("isaac",),
    settings: Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write grasps that are placed by the hand's gripper frame, and return the paths of what was written.

    isaac
        grasps.yaml, and the object's mesh beside it, in meters.
    graspgen
        graspgen.json, of the same mesh.
    dexgraspbench
        dexgraspbench/grasps/NAME.npy, and the object's folder dexgraspbench/OBJECT, to which they point.

    Raises
    ------
    InputError
        If a format is unknown, a grasp is not usable, or a file cannot be written.
    """
    place, chosen = Path(folder), checked_formats(formats)
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", obj.name) or "object"
    file = GraspFile(obj.name, "", tuple(grasps), object_file=f"{name}.obj", settings=settings or {})
    file = described_gripper(hand, preshape, file)
    write_isaac_file(place / "grasps.yaml", file)
    write_object_mesh(place / f"{name}.obj", obj)
    written = [place / "grasps.yaml"]
    rooted = in_root_frame(hand, file)
    if "graspgen" in chosen:
        written.append(place / "graspgen.json")
        write_graspgen_file(written[-1], rooted)
    if "dexgraspbench" in chosen:
        below = place / "dexgraspbench"
        write_object_folder(below / name, obj)
        pointed = replace(rooted, object_file=str((below / name).resolve()))
        write_dexgraspbench_files(below / "grasps", pointed, joint_order(hand))
        written.append(below / "grasps")
    return written

"""From a grasp in words, as a command line, a stored study or a plan says it, to the problem."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from surehold.errors import InputError
from surehold.grasping.hand.model import Hand
from surehold.grasping.hand.named import hand_named
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import OBJECTS, shipped_object
from surehold.problems.grasp.options import OPTIONS, THESIS_SIMULATOR, GraspOptions, checked_words
from surehold.problems.grasp.problem import GraspProblem

__all__ = ["described_grasp", "described_hand", "described_object"]


def described_grasp(
    words: Mapping[str, Any], obj: GraspObject | None = None, progress: Callable[[float], None] = lambda share: None
) -> GraspProblem:
    """Return the problem of a `DescribedGrasp`; files are found by their paths, `obj` is what was loaded before.

    Raises
    ------
    InputError
        If a name is unknown, a file is refused, or a value is out of range.
    """
    given = checked_words(words)
    body = obj or described_object(given)[0]
    hand = described_hand(given["hand"], given["hand_config"], given["preshape"] or "")
    # A command line says every option: what has its default does not contradict a preset.
    unsaid = {name for name in THESIS_SIMULATOR if given[name] == OPTIONS[name].default}
    options: Any = {name: given[name] for name in GraspOptions.__annotations__ if name not in unsaid}
    return GraspProblem(body, given["facet"], given["variables"], **(options | {"hand": hand}), progress=progress)


def described_object(words: Mapping[str, Any]) -> tuple[GraspObject, str]:
    """Return a shipped object, the mesh of a file or what a point cloud says, and the diagnosis of a file.

    Raises
    ------
    InputError
        If the file is refused, or options are given that are not for this kind of object.
    """
    given = checked_words(words)
    name, unit, frame = (given[key] or None for key in ("object", "unit", "frame"))
    mass = given["mass"]  # 0 is wrong, not absent
    if given["cloud"]:
        from surehold.problems.grasp.from_cloud import object_of_cloud

        return object_of_cloud(given)
    for option in ("camera", "normals", "contacts", "cloud_noise", "prior", "shapes", "plan"):
        if given[option] not in (None, OPTIONS[option].default):
            raise InputError(f"{option} is for point clouds; give one with cloud, or leave {option} out.")
    if not name:
        raise InputError(f"no object is given; name one of {', '.join(OBJECTS)}, a mesh file, or a cloud.")
    if name in OBJECTS or not (Path(name).suffix or Path(name).exists()):
        options = {"unit": unit, "mass": mass, "frame": frame}
        asked = [option for option, value in options.items() if value is not None]
        if name in OBJECTS and asked:
            raise InputError(f"{asked[0]} is for mesh files; '{name}' is shipped with its own size and mass.")
        return shipped_object(name), ""
    from surehold.grasping.object.mesh_files import load_mesh

    loaded = load_mesh(name, unit, mass, frame or "auto")
    return loaded.object, loaded.diagnosis


def described_hand(name: str, config: str, preshape: str = "") -> Hand:
    """Return the hand of a name, of a description that names its model, or of a model file with its description.

    A preshape that is a synergy file is added to the hand's, under the name of the file as it is given.

    Raises
    ------
    InputError
        If the hand is unknown, a file is refused, or one of model and description is missing.
    """
    if Path(preshape).suffix.lower() in (".yaml", ".yml"):
        from surehold.grasping.hand.learned_synergy import read_synergy, with_synergy

        synergy = read_synergy(preshape)
        return with_synergy(described_hand(name, config), synergy, preshape)
    suffix = Path(name).suffix.lower()
    if suffix in (".yaml", ".yml") and not config:
        from surehold.grasping.hand.files import packaged_hand

        return packaged_hand(name)
    if not suffix:
        if config:
            raise InputError(f"hand-config describes a model file; give that as the hand, not '{name}'.")
        return hand_named(name)
    if not config:
        raise InputError(
            f"hand {name} is a model file; describe its palm and fingers with hand-config: a YAML file, such as "
            f"`surehold hand new {shlex.quote(name)}` writes."
        )
    from surehold.grasping.hand.files import load_hand

    return load_hand(name, config)

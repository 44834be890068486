"""Grasps of a file: the hand, the object and the options that it, or whoever rates it, names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from surehold.errors import InputError
from surehold.grasping.formats.gripper import joint_order
from surehold.grasping.formats.named import format_of, read_grasps
from surehold.grasping.formats.stored import GraspFile
from surehold.grasping.hand.model import Hand
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import OBJECTS
from surehold.grasping.simulator import Simulator
from surehold.problems.grasp.description import described_hand
from surehold.problems.grasp.options import OPTIONS, THESIS_SIMULATOR, checked_words

__all__ = ["DescribedFile", "described_file", "described_simulator", "stored_words"]

#: Options that a file of grasps keeps: what the same hand closes on the same object with.
_OBJECT: Final = ("object", "unit", "mass", "frame")
_SIMULATOR: Final = ("contact", "quality", "closing", "friction", "torsion", "cones", "collision")
_KEPT: Final = (*_OBJECT, "hand", "hand_config", "preshape", *_SIMULATOR)


class DescribedFile(NamedTuple):
    """A file of grasps, and what is needed to close the hand in them again."""

    file: GraspFile
    words: dict[str, Any]  #: a `DescribedGrasp`
    hand: Hand
    object: GraspObject | None  #: the mesh that the file brings along; None if the words name the object


def stored_words(words: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a file of grasps keeps of a `DescribedGrasp`: what has its default is left out."""
    given = checked_words(words) | (THESIS_SIMULATOR if words.get("preset") else {})
    usual = checked_words({})
    kept = {name: given[name] for name in _KEPT if given[name] != usual[name]}
    if given["cloud"]:  # the file has its mean shape beside it, in meters
        return {name: value for name, value in kept.items() if name not in ("object", "unit", "frame")}
    return {"object": given["object"]} | kept


def described_file(path: str | Path, words: Mapping[str, Any]) -> DescribedFile:
    """Read a file of grasps; `words`, those that are given, stand above what the file says.

    Raises
    ------
    InputError
        If the file, the hand or the object is refused or not named, or an option of the file does not exist.
    """
    given = {name: value for name, value in words.items() if value not in ("", None)}
    file = read_grasps(path)
    said = dict(file.settings)
    for name in said:
        if name not in _KEPT:
            raise InputError(f"{str(path)!r}: surehold.{name[:40]} is none of {', '.join(_KEPT)}; take it out.")
    if given.keys() & {"object"}:
        said = {name: value for name, value in said.items() if name not in _OBJECT}
    merged = checked_words({"object": ""} | said | given)
    _check_kinds(str(path), merged)
    hand = _hand(str(path), merged, "hand" in given)
    if format_of(path) == "dexgraspbench" and not said:  # of another tool, which may not name the joints
        file = read_grasps(path, joint_order(hand))
    name = merged["object"]
    if name and (name in OBJECTS or Path(name).exists() or "object" in given):
        return DescribedFile(file, merged, hand, None)
    return DescribedFile(file, merged, hand, _beside(Path(path), file, merged["mass"], merged["frame"]))


def described_simulator(words: Mapping[str, Any], obj: GraspObject, hand: Hand) -> Simulator:
    """Return the simulator of a `DescribedGrasp` for an object and a hand that are there.

    A preshape that the hand does not have is another hand's; the first one is taken.
    """
    given = checked_words(words)
    settings: Any = {name: given[name] for name in _SIMULATOR} | (THESIS_SIMULATOR if given["preset"] else {})
    preshape = given["preshape"] or None
    if preshape not in hand.preshapes and tuple(hand.preshapes) == ("file",):
        preshape = None
    return Simulator(hand, obj, preshape=preshape, **settings)


def _hand(path: str, words: Mapping[str, Any], given: bool) -> Hand:
    """Return the hand of a description; the message about one that only the file names says so."""
    try:
        return described_hand(words["hand"], words["hand_config"], words["preshape"] or "")
    except InputError as error:
        if given:
            raise
        raise InputError(
            f"{path!r} was made with hand {words['hand']!r}: {error} Give --hand, or --preshape, as it is here."
        ) from None


def _beside(path: Path, file: GraspFile, mass: float | None, frame: str | None) -> GraspObject:
    """Return the object whose mesh lies in the folder of the file, or in the one above or beside it."""
    from surehold.grasping.object.mesh_files import load_mesh

    if not file.object_file:
        raise InputError(f"{str(path)!r} names no object; give one with --object.")
    folder = (path if path.is_dir() else path.parent).resolve()
    mesh = folder / file.object_file
    if mesh.is_dir():
        mesh = mesh / "mesh" / "simplified.obj"  # of DexGraspBench
    mesh = mesh.resolve()
    if not mesh.is_relative_to(folder.parent) or not mesh.is_file():
        raise InputError(
            f"{str(path)!r} names the object {file.object_file[:80]!r}, which is not beside it; give it with --object "
            "and, for a mesh file, --unit."
        )
    return load_mesh(mesh, "m", mass, frame or "auto", scale=file.object_scale).object


def _check_kinds(path: str, words: Mapping[str, Any]) -> None:
    """Raise InputError if an option of a file is of another kind than that of the command line."""
    for name in _KEPT:
        kind, value = OPTIONS[name].text, words[name]
        if value is None:
            continue
        if not isinstance(value, str if kind is str else (int, float)) or isinstance(value, bool):
            needed = "text" if kind is str else "number"
            raise InputError(f"{path!r}: {name} is {str(value)[:40]!r}; it must be a {needed}.")

"""File formats of grasps by name, and which of them a file is."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from surehold.errors import InputError
from surehold.grasping.formats.dexgraspbench import read_dexgraspbench_grasps
from surehold.grasping.formats.graspgen import read_graspgen_grasps
from surehold.grasping.formats.isaac import read_isaac_grasps
from surehold.grasping.formats.stored import GraspFile

__all__ = ["FORMATS", "format_of", "read_grasps"]

#: Names of the formats.
FORMATS: Final = ("isaac", "graspgen", "dexgraspbench")
_ENDINGS: Final = {".yaml": "isaac", ".yml": "isaac", ".json": "graspgen", ".npy": "dexgraspbench"}


def format_of(path: str | Path) -> str:
    """Return the name of the format that the ending of a file's name stands for; a folder is one of DexGraspBench.

    Raises
    ------
    InputError
        If it stands for none.
    """
    ending = Path(path).suffix.lower()
    if Path(path).is_dir():
        return "dexgraspbench"
    if ending not in _ENDINGS:
        raise InputError(
            f"{str(path)!r} is no file of grasps; give a .yaml (Isaac), a .json (GraspGen), or a .npy or a folder of "
            "them (DexGraspBench)."
        )
    return _ENDINGS[ending]


def read_grasps(path: str | Path, joints: Sequence[str] = ()) -> GraspFile:
    """Read a file of grasps of any format; `joints` are the model's in its order, for files without names of joints.

    Raises
    ------
    InputError
        If the file cannot be read, is none of the formats, damaged, or of a version that is not supported.
    """
    kind = format_of(path)
    if kind == "isaac":
        return read_isaac_grasps(path)
    return read_graspgen_grasps(path) if kind == "graspgen" else read_dexgraspbench_grasps(path, joints)

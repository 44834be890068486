"""A hand of one's own: an MJCF or URDF model, read by MuJoCo, and its description (configuration.py).

Fingers close on capsules that cover the model's collision geometries (geometry.py); a model without collision
geometries on a finger is refused. Nothing in a model is executed, and no plugin is loaded; meshes are read from the
folder that the model names (urdf.py says which).
"""

import importlib
import importlib.util
import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np

from surehold.errors import InputError
from surehold.grasping.hand.building import built_hand
from surehold.grasping.hand.configuration import HandConfig, ModelFile, read_hand_config
from surehold.grasping.hand.model import Hand
from surehold.grasping.hand.rest import RestingModel
from surehold.grasping.hand.urdf import read_urdf
from surehold.grasping.plain_data import regular_bytes

__all__ = ["load_hand", "packaged_hand", "read_model"]

_FARTHEST: Final = 1e6  # of a part from the one that carries it [m]: farther off, squares overflow


def load_hand(model: str | Path, config: str | Path | HandConfig) -> Hand:
    """Return the hand of a model file (.xml of MuJoCo or .urdf) and its description.

    Raises
    ------
    InputError
        As `read_model`, or if the description does not fit the model: the message lists what the model has.
    """
    described = config if isinstance(config, HandConfig) else read_hand_config(config)
    mujoco, compiled = read_model(model)
    try:
        return built_hand(RestingModel(mujoco, compiled, described), str(model))
    except UnicodeDecodeError:
        raise InputError(f"{str(model)!r} has names that are no UTF-8; save it as UTF-8.") from None


def read_model(model: str | Path) -> tuple[Any, Any]:
    """Return MuJoCo and the compiled model of a file (.xml of MuJoCo or .urdf).

    Raises
    ------
    InputError
        If MuJoCo is not installed, or the file cannot be read.
    """
    try:
        mujoco: Any = importlib.import_module("mujoco")  # its names are not in its type information
    except ImportError:
        raise InputError("reading a hand needs MuJoCo; install it with: pip install 'surehold[mujoco]'.") from None
    path = Path(model)
    if path.suffix.lower() not in (".xml", ".urdf", ".mjcf"):
        raise InputError(f"{str(model)!r} is no model of a hand; give an .xml (MJCF) or .urdf file.")
    regular_bytes(path)  # MuJoCo reads the file itself, and a pipe might never end
    try:
        compiled = _compiled(mujoco, path)
    except InputError:
        raise
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(f"{str(model)!r} is not a model that MuJoCo can read: {reason}.") from None
    far = max(float(np.abs(places).max(initial=0.0)) for places in (compiled.body_pos, compiled.jnt_pos))
    if far > _FARTHEST:
        raise InputError(f"{str(model)!r} places its parts {far:.3g} m apart; MuJoCo takes lengths as meters.")
    return mujoco, compiled


def packaged_hand(config: str | Path) -> Hand:
    """Return the hand of a description that names its model: a file, or one of an installed package.

    Raises
    ------
    InputError
        As `load_hand`, or if the package is not installed; nothing is ever downloaded.
    """
    described = read_hand_config(config)
    where = described.model
    if where is None:
        raise InputError(f"{str(config)!r} does not say where its model is; give --hand MODEL beside --hand-config.")
    if isinstance(where, ModelFile):
        return load_hand(Path(config).parent / where.file, described)
    found = importlib.util.find_spec(where.package)
    folders = [] if found is None else list(found.submodule_search_locations or [])
    for folder in folders:
        if (Path(folder) / where.path).is_file():
            return load_hand(Path(folder) / where.path, described)
    raise InputError(
        f"hand '{described.name}' is described here, but its model comes with the package {where.distribution}, which "
        f"is not installed; pip install --no-deps {where.distribution} (nothing is downloaded otherwise)."
    )


def _compiled(mujoco: Any, path: Path) -> Any:
    """Return the model of a file. MuJoCo's warnings, of inertias and the like, do not matter here."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)  # it would write a log into the working directory
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if path.suffix.lower() == ".urdf":
                text, assets = read_urdf(path)
                spec = mujoco.MjSpec.from_string(text, assets=assets)
            else:
                spec = mujoco.MjSpec.from_file(str(path))
            for joint in spec.joints:  # MuJoCo takes it as one without limits
                if joint.limited == mujoco.mjtLimited.mjLIMITED_AUTO and joint.range[0] > joint.range[1]:
                    low, high = joint.range
                    raise InputError(
                        f"{str(path)!r}: joint {joint.name!r} has the range {low:g} to {high:g}; give the lower first."
                    )
            spec.compiler.fusestatic = False  # bodies keep their names
            # Nothing moves by forces here: inertias that no body can have shall not refuse a hand.
            spec.compiler.balanceinertia, spec.compiler.boundmass, spec.compiler.boundinertia = True, 1e-6, 1e-12
            return spec.compile()
    finally:
        mujoco.set_mju_user_warning(before)

"""Hands by name: those that are shipped, and those that are described here and whose models other packages bring."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Final

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.icub import icub_left_hand, icub_right_hand
from surehold.grasping.hand.model import Hand

__all__ = ["HANDS", "hand_named"]

_SHIPPED: Final[dict[str, Callable[[], Hand]]] = {"icub-left": icub_left_hand, "icub-right": icub_right_hand}
_DESCRIBED: Final = ("shadow", "panda")  # files in assets/hands
#: Names of the hands.
HANDS: Final = (*_SHIPPED, *_DESCRIBED)


@cache
def hand_named(name: str) -> Hand:
    """Return a hand by name. "shadow" and "panda" need the packages gymnasium-robotics and robosuite, and MuJoCo.

    Raises
    ------
    InputError
        If the name is unknown, or a package that brings the model is not installed.
    """
    if name in _SHIPPED:
        return _SHIPPED[name]()
    if name not in _DESCRIBED:
        raise _unknown(name)
    from surehold.grasping.hand.files import packaged_hand

    return packaged_hand(Path(__file__).parents[1] / "assets" / "hands" / f"{name}.yaml")


def _unknown(name: str) -> InputError:
    """Return the error for a name that is none; of a file it says how to load one."""
    error, suffix = unknown_name("hand", name, HANDS), Path(name).suffix.lower()
    if not suffix:
        return error
    call = f"packaged_hand({name!r})" if suffix in (".yaml", ".yml") else f"load_hand({name!r}, DESCRIPTION)"
    return InputError(f"{error} Load a hand's file first: surehold.grasping.hand.files.{call}.")

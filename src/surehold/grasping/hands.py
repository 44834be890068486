"""Hands by name."""

from collections.abc import Callable
from typing import Final

from surehold.errors import unknown_name
from surehold.grasping.hand import Hand
from surehold.grasping.icub_hand import icub_left_hand, icub_right_hand

__all__ = ["HANDS", "hand_named"]

_BUILDERS: Final[dict[str, Callable[[], Hand]]] = {"icub-left": icub_left_hand, "icub-right": icub_right_hand}
#: Names of the shipped hands.
HANDS: Final = tuple(_BUILDERS)


def hand_named(name: str) -> Hand:
    """Return a shipped hand by name.

    Raises
    ------
    InputError
        If no hand of that name is shipped.
    """
    if name not in _BUILDERS:
        raise unknown_name("hand", name, HANDS)
    return _BUILDERS[name]()

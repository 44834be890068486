"""Names among which a user of grasps chooses, in the order of messages.

Outside of `surehold.grasping`, whose extra may be missing, because the command line names them in every help.
"""

from typing import Final

__all__ = ["CLOSING_MODES", "COLLISIONS", "CONES", "CONTACT_MODELS", "QUALITIES"]

CONTACT_MODELS: Final = ("graded", "patch", "single")  #: see grasping/closing/contacts.py
CLOSING_MODES: Final = ("adaptive", "synergy")  #: whether links beyond a touching one go on
QUALITIES: Final = (
    "epsilon",
    "signed_epsilon",
    "volume",
    "simox",
    "task",
    "closure",
    "min_weight",
    "balance",
)  #: see grasping/wrench/quality.py
CONES: Final = ("polyhedral", "round")  #: of friction
COLLISIONS: Final = ("penalty", "zero")  #: worth of a hand that collides while open: a penalty growing with depth, or 0

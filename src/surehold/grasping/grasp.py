"""The outcome of one trial: what became of it, where the hand is, its contacts and what they are worth."""

from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from surehold.grasping.closing.contacts import Contacts
from surehold.grasping.poses import Pose
from surehold.grasping.wrench.wrench_space import WrenchQuality

__all__ = ["STATUSES", "Grasp", "Status"]

Array = NDArray[np.float64]
Status = Literal["ok", "no contact", "initial collision", "not closed"]

#: What became of a trial. "ok": force closure. "no contact": fewer than two contacts. "initial collision": the open
#: hand is inside the object. "not closed": contacts that do not resist every wrench.
STATUSES: Final = ("ok", "no contact", "initial collision", "not closed")


@dataclass(frozen=True, eq=False)
class Grasp:
    """Outcome of one trial. Points and normals are in the frame of the object."""

    status: Status  #: see `STATUSES`
    quality: float  #: the measure asked for; without two contacts 0, less of signed_epsilon; a collision's 0 or less
    pose: Pose  #: from the palm frame to the object's frame
    s1: float | tuple[float, ...]  #: posture variable [rad]; all amplitudes of a preshape that has several
    joints: Array = field(
        repr=False
    )  #: (f, j) joint angles [rad] or shifts [m] at the end, in the hand's order; a collision leaves it open
    open_joints: Array = field(repr=False)  #: (f, j) joint angles or shifts of the open hand
    contacts: Contacts = field(repr=False)  #: of the quality; empty after a collision
    touching: tuple[str, ...] = field(repr=False)  #: names of the links that were stopped by the object
    penetration: float  #: how deep the open hand is inside the object [m]; 0 without a collision
    wrench: WrenchQuality | None = field(repr=False, default=None)  #: details of the measure; None without two contacts

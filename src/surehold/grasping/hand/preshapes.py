"""Preshapes from a description: open and closed joints, what the posture moves, and the joints that follow others."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.model import CLOSED, Preshape

__all__ = ["described_preshape"]

Array = NDArray[np.float64]
_S1_TRIES: Final = 6


def described_preshape(name: str, hand: HandConfig, joints: tuple[str, ...], lower: Array, upper: Array) -> Preshape:
    """Return a preshape of a hand with these joints (f j,) and ranges (f, j).

    Raises
    ------
    InputError
        If it names joints that are unknown or follow others, leaves a range, or does not close.
    """
    config = hand.preshapes[name]

    def values(given: Mapping[str, float], what: str, rest: Array) -> Array:
        for joint in given:
            if joint not in joints:
                raise unknown_name(f"joint of {name}.{what}", joint, [known for known in joints if known])
            if joint in hand.coupling:
                raise InputError(
                    f"hand '{hand.name}': '{joint}' follows '{hand.coupling[joint].follows}'; "
                    f"take it out of {name}.{what}."
                )
            low, high = lower.ravel()[joints.index(joint)], upper.ravel()[joints.index(joint)]
            if what != "posture" and not low - 1e-3 <= given[joint] <= high + 1e-3:
                raise InputError(
                    f"hand '{hand.name}': {name}.{what}.{joint} is {given[joint]:g}, outside its range "
                    f"{low:.4g} to {high:.4g} (radians or meters)."
                )
        q = rest.copy().ravel()
        for i, joint in enumerate(joints):
            if joint in given:
                q[i] = given[joint]
        for follower, coupling in hand.coupling.items():
            for joint in (follower, coupling.follows):
                if joint not in joints:
                    raise unknown_name("joint of coupling", joint, [known for known in joints if known])
            if coupling.follows in hand.coupling:
                raise InputError(
                    f"hand '{hand.name}': '{follower}' follows '{coupling.follows}', which follows too; "
                    "name the joint that leads them all."
                )
            offset = 0.0 if what == "posture" else coupling.offset
            q[joints.index(follower)] = coupling.factor * q[joints.index(coupling.follows)] + offset
        return q.reshape(lower.shape)

    rest = np.clip(0.0, lower, upper)
    opened = values(config.open, "open", rest)
    closed = values(config.closed, "closed", opened)
    if np.array_equal(opened, closed):
        raise InputError(f"preshape '{name}' of hand '{hand.name}' does not close: open and closed are equal.")
    posture, limits = np.zeros_like(opened), (0.0, 0.0)
    if config.posture is not None:
        posture = values(config.posture.joints, "posture", np.zeros_like(opened))
        limits = (config.posture.range[0], config.posture.range[1])
    tries = np.round(np.linspace(*limits, _S1_TRIES + 2)[1:-1], 3).tolist() if limits[0] < limits[1] else [0.0]
    return Preshape(opened, (closed - opened) / CLOSED, posture, limits, limits, tuple(tries))

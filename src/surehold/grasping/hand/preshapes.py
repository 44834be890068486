"""Preshapes from a description: open and closed joints, what the posture moves, and the joints that follow others."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.hand.coupling import JointCouplings
from surehold.grasping.hand.model import CLOSED, Preshape
from surehold.grasping.hand.rest import RestingModel

__all__ = ["described_preshape"]

Array = NDArray[np.float64]
_S1_TRIES: Final = 6


def described_preshape(name: str, rest: RestingModel, couplings: JointCouplings, joints: tuple[str, ...]) -> Preshape:
    """Return a preshape of a hand whose joints, those that no finger has as "", are `joints` (f j,).

    Raises
    ------
    InputError
        If it names joints that are unknown or follow others, leaves a range, or does not close.
    """
    config, hand = rest.config.preshapes[name], rest.config
    known = {joint for joint in joints if joint} | couplings.leaders()

    def checked(given: Mapping[str, float], what: str) -> dict[str, float]:
        for joint, value in given.items():
            if joint not in known:
                raise unknown_name(f"joint of {name}.{what}", joint, [own for own in rest.joint_names if own in known])
            if joint in hand.coupling:
                raise InputError(
                    f"hand '{hand.name}': '{joint}' follows '{hand.coupling[joint].follows}'; "
                    f"take it out of {name}.{what}."
                )
            low, high = rest.range(rest.joint_ids[joint])
            if what != "posture" and not low - 1e-3 <= value <= high + 1e-3:
                raise InputError(
                    f"hand '{hand.name}': {name}.{what}.{joint} is {value:g}, outside its range "
                    f"{low:.4g} to {high:.4g} (radians or meters)."
                )
        return dict(given)

    def of_fingers(q: Array) -> Array:
        return np.array([q[rest.joint_ids[joint]] if joint else 0.0 for joint in joints]).reshape(len(rest.fingers), -1)

    still = np.array([np.clip(0.0, *rest.range(j)) if rest.moves(j) else 0.0 for j in range(rest.model.njnt)])
    named, ends = checked(config.open, "open"), checked(config.closed, "closed")
    opened = couplings.posture(named, still, f"{name}.open")
    closed = couplings.posture(named | ends, opened, f"{name}.closed")
    start, end = of_fingers(opened), of_fingers(closed)
    if np.array_equal(start, end):
        raise InputError(f"preshape '{name}' of hand '{hand.name}' does not close: open and closed are equal.")
    posture, limits = np.zeros_like(start), (0.0, 0.0)
    if config.posture is not None:
        per_unit = checked(config.posture.joints, "posture")
        moved = {joint: opened[rest.joint_ids[joint]] + per_unit.get(joint, 0.0) for joint in named | ends | per_unit}
        posture = of_fingers(couplings.posture(moved, opened, f"{name}.posture")) - start
        limits = (config.posture.range[0], config.posture.range[1])
    tries = np.round(np.linspace(*limits, _S1_TRIES + 2)[1:-1], 3).tolist() if limits[0] < limits[1] else [0.0]
    return Preshape(start, (end - start) / CLOSED, posture, limits, limits, tuple(tries))

"""Exploring without ROS in it: ask, have the trial made, tell, until the study stops."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from surehold_ros.client import Refused, StudyClient


@dataclass(frozen=True)
class Made:
    """What the robot says of a trial."""

    value: float
    failed: bool = False
    reached: Mapping[str, float] = field(default_factory=dict)


def explore(
    client: StudyClient,
    robot: str,
    make: Callable[[dict[str, Any]], Made],
    *,
    trials: int = 0,
    progress: Callable[[int, dict[str, Any], Made], Any] = lambda made, asked, outcome: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> tuple[int, str]:
    """Make trials; returns how many, and why it ended. `trials` 0 is no limit."""
    made = 0
    while not cancelled():
        if trials and made >= trials:
            return made, f"{trials} trials were made"
        try:
            asked = client.ask(robot)
        except Refused as refused:
            if refused.code == 409:
                return made, str(refused)
            raise
        outcome = make(asked)
        failed = outcome.failed or not isfinite(outcome.value)
        client.tell(asked["id"], None if failed else outcome.value, failed=failed, reached=outcome.reached)
        made += 1
        progress(made, asked, outcome)
    return made, "cancelled"

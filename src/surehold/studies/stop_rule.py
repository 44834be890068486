"""When a study has had enough: a budget of trials, a time, or nothing left to gain."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from math import isfinite
from typing import Any

from surehold.amounts import amount
from surehold.errors import InputError

__all__ = ["StopRule"]


@dataclass(frozen=True)
class StopRule:
    """Asking ends as soon as one of the parts that are set says so."""

    trials: int | None = None
    """trials in all: finished or under way"""
    until: float | None = None
    """point in time, seconds since 1970 (UTC)"""
    improvement: float | None = None
    """improvement of the outcome under input noise that is worth a trial, in the units of the values"""
    asks: int = 3
    """so many trials in a row must have promised less than that"""

    def __post_init__(self) -> None:
        if self.trials is not None and not _whole(self.trials, 1):
            raise InputError(f"budget is {self.trials!r} trials; give a whole number of 1 or more.")
        if not _whole(self.asks, 1):
            raise InputError(f"asks is {self.asks!r}; give a whole number of 1 or more.")
        if self.until is not None and not (_number(self.until) and 0.0 <= self.until < 1e11):
            raise InputError(f"time limit is {self.until!r}; give a time within the coming millennia.")
        if self.improvement is not None and not (_number(self.improvement) and self.improvement >= 0.0):
            raise InputError(f"improvement is {self.improvement!r}; give a finite number of 0 or more.")

    def reason(self, trials: int, now: float, promises: Sequence[float]) -> str:
        """Return why asking ends, empty where it goes on.

        Parameters
        ----------
        trials
            Trials finished or under way.
        now
            Seconds since 1970 (UTC).
        promises
            What the latest trials, and the one that would be asked next, promised; oldest first.
        """
        if self.trials is not None and trials >= self.trials:
            return f"the budget of {amount(self.trials, 'trial')} is used up"
        if self.until is not None and now >= self.until:
            return f"its time ended at {_moment(self.until)}"
        last = promises[-self.asks :]
        if self.improvement is not None and len(last) == self.asks and max(last) < self.improvement:
            return (
                f"the last {self.asks} times no trial promised an improvement of {self.improvement:g} "
                f"(the largest: {max(last):.3g})"
            )
        return ""

    def __str__(self) -> str:
        """Return in words when asking ends."""
        parts = [
            *([f"after {amount(self.trials, 'trial')} in all"] if self.trials is not None else []),
            *([f"at {_moment(self.until)}"] if self.until is not None else []),
            *(
                [f"when {self.asks} trials in a row promise less than {self.improvement:g}"]
                if self.improvement is not None
                else []
            ),
        ]
        return f"ends {', or '.join(parts)}" if parts else "never ends by itself"

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any] | None) -> "StopRule":
        """Return the rule that `as_dict` described; None is the rule that never stops."""
        return cls(**(data or {}))


def _whole(value: Any, least: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value)


def _moment(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")

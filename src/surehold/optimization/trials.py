"""The record of trials: what was commanded, what was reached, what came of it, and what is still under way.

Legend: u (d,) a point of the unit cube, x the same point in the box's units; t trials told, p pending.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box

__all__ = ["OUTLIER_DISTANCE", "Trials", "same"]

_SEPARATION: Final = 1e-6  # points closer than this in every coordinate of the unit cube are the same trial

#: Ranges of all other values by which an outlier lies below them.
OUTLIER_DISTANCE: Final = 5.0


def same(u: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which of the points (k, d) of the unit cube are the same trial as u (d,): (k,)."""
    return np.all(np.abs(others - u) < _SEPARATION, axis=-1)


class Trials:
    """All trials of one optimizer, in the order in which they were told."""

    def __init__(self, box: Box):
        self._box = box
        self._commanded: list[NDArray[np.float64]] = []
        self._reached: list[NDArray[np.float64]] = []
        self._values: list[float] = []
        self._pending: list[NDArray[np.float64]] = []

    def __len__(self) -> int:
        """Number of trials told, t."""
        return len(self._values)

    @property
    def commanded(self) -> NDArray[np.float64]:
        """Commanded inputs in the unit cube, (t, d)."""
        return np.array(self._commanded).reshape(-1, self._box.dimension)

    @property
    def reached(self) -> NDArray[np.float64]:
        """Reached inputs in the unit cube, (t, d): the commanded ones where nothing else was told."""
        return np.array(self._reached).reshape(-1, self._box.dimension)

    @property
    def reported(self) -> NDArray[np.bool_]:
        """Whether the reached input of each trial was told and is another one, (t,)."""
        return np.any(self.commanded != self.reached, axis=1)

    @property
    def values(self) -> NDArray[np.float64]:
        """Values, (t,); NaN for failed trials."""
        return np.array(self._values, dtype=np.float64)

    @property
    def successful(self) -> NDArray[np.bool_]:
        """Whether each trial gave a value, (t,)."""
        return np.isfinite(self.values)

    @property
    def pending(self) -> NDArray[np.float64]:
        """Inputs asked for and not told yet, in the unit cube, (p, d)."""
        return np.array(self._pending).reshape(-1, self._box.dimension)

    @property
    def outliers(self) -> NDArray[np.bool_]:
        """Whether each value lies so far below the others that it is no measurement of the response, (t,).

        Such as a reading of -30 among values from 0 to 1, or a penalty of -1000 for a crash: it, and all that is lower,
        lies below the others by more than `OUTLIER_DISTANCE` times their whole range. A third of the values or more
        are no outliers, and where the others are all equal nothing can be said.
        """
        values = self.values
        told = np.sort(values[self.successful])
        n = len(told)
        unit = told / max(float(np.abs(told).max()), 1e-300) if n else told  # differences of the largest overflow
        gap, above = np.diff(unit), (unit[-1:] - unit)[1:]
        apart = np.flatnonzero((gap > OUTLIER_DISTANCE * above) & (above > 0.0) & (3 * np.arange(1, n) < n))
        return values < told[apart[-1] + 1] if len(apart) else np.zeros(len(values), dtype=bool)

    @property
    def modelled(self) -> NDArray[np.float64]:
        """Values with failed trials and outliers counted as the lowest other value, (t,); needs one value at least."""
        values = self.values
        sound = self.successful & ~self.outliers
        return np.where(sound, values, values[sound].min())

    def ask(self, u: NDArray[np.float64]) -> None:
        """Record that a trial at u (d,) is under way."""
        self._pending.append(u)

    def tell(self, x: ArrayLike, y: float | None, failed: bool, reached: ArrayLike | None) -> None:
        """Record the outcome of a trial; see `Optimizer.tell`. Nothing is recorded where an argument is bad."""
        commanded = self._inside("x", x)
        actual = commanded if reached is None else self._inside("reached", reached)
        if failed and y is not None:
            raise InputError(f"a failed trial has no value, but y is {y!r}; leave one of the two out.")
        value = np.nan if failed else _finite(y)
        self._commanded.append(commanded)
        self._reached.append(actual)
        self._values.append(value)
        index = self._waiting(commanded)
        if index is not None:
            del self._pending[index]

    def restore(self, X: ArrayLike, y: ArrayLike, reached: ArrayLike, pending: ArrayLike) -> None:
        """Take over stored trials; see `Optimizer.restore`. Nothing is taken over where an argument is bad."""
        commanded, actual, waiting = (
            self._all_inside(name, points) for name, points in (("X", X), ("reached", reached), ("pending", pending))
        )
        values = np.asarray(y, dtype=np.float64)
        if values.shape != (len(commanded),) or len(actual) != len(commanded):
            raise InputError(
                f"y has shape {values.shape} and reached {len(actual)} rows, but X has {len(commanded)} rows; give one "
                "value and one reached input a trial."
            )
        if np.isinf(values).any():
            raise InputError(f"y holds infinity at row {int(np.argmax(np.isinf(values)))}; give NaN for failed trials.")
        self._commanded, self._reached, self._pending = list(commanded), list(actual), list(waiting)
        self._values = values.tolist()

    def equal(self, other: "Trials") -> bool:
        """Tell whether the same trials have been told, in the same order; pending ones do not matter."""
        return (
            np.array_equal(self.values, other.values, equal_nan=True)
            and np.array_equal(self.commanded, other.commanded)
            and np.array_equal(self.reached, other.reached)
        )

    def forget(self, x: ArrayLike) -> None:
        """Drop the pending trial at x (d,); raises InputError if there is none."""
        index = self._waiting(self._box.to_unit(x))
        if index is None:
            raise InputError(f"x = {self._box.as_dict(x)} is not pending; see Optimizer.pending.")
        del self._pending[index]

    def _waiting(self, u: NDArray[np.float64]) -> int | None:
        matches = np.flatnonzero(same(u, self.pending))
        return int(matches[0]) if len(matches) else None

    def _all_inside(self, name: str, X: ArrayLike) -> NDArray[np.float64]:
        """Return points (k, d) as points of the cube."""
        points = np.asarray(X, dtype=np.float64)
        points = points.reshape(-1, self._box.dimension) if points.size == 0 else points
        U = self._box.to_unit(points)
        if U.ndim != 2:
            raise InputError(f"{name} has shape {U.shape}; give one row a trial, (t, {self._box.dimension}).")
        if not (np.isfinite(U).all() and self._box.contains(points)):
            bad = next(p for p in points if not (np.isfinite(p).all() and self._box.contains(p)))
            raise InputError(f"{name} holds {self._box.as_dict(bad)}, which is not inside {self._box}.")
        return np.clip(U, 0.0, 1.0)

    def _inside(self, name: str, x: ArrayLike) -> NDArray[np.float64]:
        u = self._box.to_unit(x)
        if u.ndim != 1:
            raise InputError(
                f"{name} has shape {u.shape}; tell one trial at a time, of shape ({len(self._box.names)},)."
            )
        if not np.all(np.isfinite(u)):
            raise InputError(f"{name} is {np.asarray(x).tolist()}; every coordinate must be a finite number.")
        if not self._box.contains(x):
            raise InputError(f"{name} = {self._box.as_dict(x)} lies outside {self._box}; tell a point inside the box.")
        return np.clip(u, 0.0, 1.0)


def _finite(y: float | None) -> float:
    if y is None:
        raise InputError("the trial has no value; give y, or failed=True for a trial that gave nothing.")
    try:
        value = np.asarray(y, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"y is {y!r}; give one finite number, or failed=True.") from None
    if value.size != 1 or not np.isfinite(value).all():
        raise InputError(f"y is {y!r}; give one finite number, or failed=True for a trial that gave nothing.")
    return float(value.reshape(()))

"""The record of trials: what was commanded, what was reached, what came of it, and what is still under way.

Legend: u (d,) a point of the unit cube, x the same point in the box's units; t trials told, p pending.

A trial is known by its number, or by its place: what is told at x belongs to the nearest pending trial within
`ROUNDED` box widths. Numbers count from 0; one that was forgotten is given out again before any new one.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.defaults import ROUNDED
from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.optimization.known_coordinates import Fixed
from surehold.optimization.limits import Limit, checked_outputs
from surehold.optimization.stored_trials import checked_columns
from surehold.optimization.trial_inputs import astray_in_words, check_levels, check_place, trial_input, trial_inputs
from surehold.optimization.values import (
    number_of,
    outliers_among,
    shares_won,
)

__all__ = ["AskedTrial", "Trials", "same"]

_SEPARATION: Final = 1e-6  # points closer than this in every coordinate of the unit cube are the same trial


@dataclass(frozen=True)
class AskedTrial:
    """A trial that has been asked for: give it to `Optimizer.tell` in place of x."""

    number: int
    """0 for the first of all"""
    x: NDArray[np.float64]
    """(d,), in the box's units"""
    parameters: dict[str, Any] = field(default_factory=dict)
    """the same by name"""


def same(u: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which of the points (k, d) of the unit cube are the same trial as u (d,): (k,)."""
    return np.all(np.abs(others - u) < _SEPARATION, axis=-1)


class Trials:
    """All trials of one optimizer, in the order in which they were told.

    `limits` are those of further outputs that every trial tells, watched ones included. `counted`: whether values are
    shares of executions that succeeded, among which there are no outliers. `fixed` are variables that an answer keeps.
    """

    def __init__(self, box: Box, limits: tuple[Limit, ...] = (), counted: bool = False, fixed: Fixed | None = None):
        self._box = box
        self._fixed: Final = fixed
        self.limits: Final = limits
        self._outputs: list[tuple[float, ...]] = []
        self._executions: list[int] = []
        self._deviations: list[float] = []
        self._counted: Final = counted
        self._pairs: list[tuple[int, int]] = []
        self._commanded: list[NDArray[np.float64]] = []
        self._reached: list[NDArray[np.float64]] = []
        self._values: list[float] = []
        self._numbers: list[int] = []
        self._pending: dict[int, NDArray[np.float64]] = {}

    def __len__(self) -> int:
        """Number of trials told, t."""
        return len(self._values)

    @property
    def commanded(self) -> NDArray[np.float64]:
        """Commanded inputs in the unit cube, (t, d)."""
        return np.array(self._commanded).reshape(-1, self._box.dimension)

    @property
    def reached(self) -> NDArray[np.float64]:
        """Reached inputs (t, d), the unit cube being the box; the commanded ones where nothing else was told."""
        return np.array(self._reached).reshape(-1, self._box.dimension)

    @property
    def reported(self) -> NDArray[np.bool_]:
        """Whether the reached input of each trial was told and is another one, (t,).

        Of variables that nobody sets the condition alone is told: that says nothing of how far the others strayed.
        """
        return np.any((self.commanded != self.reached) & self._set, axis=1)

    @property
    def values(self) -> NDArray[np.float64]:
        """Values, (t,); NaN for failed trials."""
        return np.array(self._values, dtype=np.float64)

    @property
    def outputs(self) -> NDArray[np.float64]:
        """Further outputs in the order of `limits`, (t, o); NaN where one was not measured."""
        return np.array(self._outputs, dtype=np.float64).reshape(len(self), len(self.limits))

    @property
    def executions(self) -> NDArray[np.intp]:
        """Executions that each value is the mean of, (t,)."""
        return np.array(self._executions, dtype=np.intp)

    @property
    def deviations(self) -> NDArray[np.float64]:
        """Standard deviations of the observation noise that were told with the values, (t,); 0 where none was."""
        return np.array(self._deviations, dtype=np.float64)

    @property
    def pairs(self) -> NDArray[np.intp]:
        """Rows of trials that were compared, (p, 2), the preferred one first."""
        return np.array(self._pairs, dtype=np.intp).reshape(-1, 2)

    @property
    def numbers(self) -> NDArray[np.intp]:
        """Numbers of the trials told, (t,)."""
        return np.array(self._numbers, dtype=np.intp)

    @property
    def successful(self) -> NDArray[np.bool_]:
        """Whether each trial gave a value, (t,)."""
        return np.isfinite(self.values)

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Whether each trial was commanded at the values of fixed variables, (t,)."""
        return np.ones(len(self), dtype=bool) if self._fixed is None else self._fixed.keeps(self.commanded)

    @property
    def eligible(self) -> NDArray[np.bool_]:
        """Whether each trial gave a value at an input that can be commanded again, (t,).

        Those that reached a place outside of the box teach the model, but are no answer; where all of them did, the
        nearest points of the box are: see `places`. Conditions that nobody sets may lie anywhere. Those at other values
        of fixed variables teach, and are no answer either.
        """
        successful = self.successful & self.kept
        inside = successful & np.all((self.reached >= 0.0) & (self.reached <= 1.0) | ~self._set, axis=1)
        return inside if inside.any() else successful

    def why_no_answer(self, k: int) -> str:
        """Return why trial k, which gave a value, is none of the `eligible` ones; empty where it is one."""
        if self.eligible[k]:
            return ""
        return (
            "reached a place outside of the box." if self.kept[k] else "was made at another value of a fixed variable."
        )

    @property
    def astray(self) -> str:
        """What a user should know of inputs that were reached far outside of the box; empty where none was."""
        return astray_in_words(self._box, self.reached)

    @property
    def places(self) -> NDArray[np.float64]:
        """Reached inputs (t, d), those outside of the unit cube replaced by the nearest points of it."""
        return np.clip(self.reached, 0.0, 1.0)

    @property
    def _set(self) -> NDArray[np.bool_]:
        """Which coordinates are commanded, (d,): not those of variables that nobody sets."""
        held = self._box.uncontrolled
        return np.ones(self._box.dimension, dtype=bool) if held is None else ~held.held

    @property
    def pending(self) -> NDArray[np.float64]:
        """Inputs asked for and not told yet, in the unit cube, (p, d)."""
        return np.array(list(self._pending.values())).reshape(-1, self._box.dimension)

    @property
    def pending_numbers(self) -> list[int]:
        """Numbers of the pending trials."""
        return list(self._pending)

    @property
    def outliers(self) -> NDArray[np.bool_]:
        """Whether each value lies so far below the others that it is no measurement of the response, (t,).

        See `values.outliers_among`; shares of successes have none.
        """
        return np.zeros(len(self), dtype=bool) if self._counted else outliers_among(self.values)

    @property
    def modelled(self) -> NDArray[np.float64]:
        """Values with failed trials and outliers counted as the lowest other value, (t,); NaN if every trial failed."""
        values = self.values
        sound = self.successful & ~self.outliers
        if not sound.any():
            return values
        return np.where(sound, values, values[sound].min())

    @property
    def next_number(self) -> int:
        """The lowest number that no trial told or pending has."""
        used = {*self._numbers, *self._pending}
        return next(number for number in range(len(used) + 1) if number not in used)

    def ask(self, number: int, u: NDArray[np.float64]) -> int:
        """Record that a trial at u (d,) is under way, and return its number: another one where that is taken."""
        number = self.next_number if number in self._pending or number in self._numbers else number
        self._pending[number] = u
        return number

    def tell(
        self,
        x: Any,
        y: float | None,
        failed: bool | str,
        reached: Any,
        outputs: Mapping[str, float | None] | None = None,
        executions: int = 1,
        deviation: float = 0.0,
    ) -> None:
        """Record the outcome of a trial; see `Optimizer.tell`. Nothing is recorded where an argument is bad."""
        if failed not in (False, True, "rig"):
            raise unknown_name("kind of failure", failed, ("True", "rig"))
        number, commanded, actual = self._commanded_by(x)
        if reached is not None:
            actual = trial_input(self._box, "reached", reached)
        if failed and y is not None:
            raise InputError(f"a failed trial has no value, but y is {y!r}; leave one of the two out.")
        value = np.nan if failed else number_of(y)
        measured = checked_outputs(self.limits, outputs, bool(failed))
        if failed != "rig":
            self._commanded.append(commanded)
            self._reached.append(actual)
            self._values.append(value)
            self._outputs.append(measured)
            self._executions.append(executions)
            self._deviations.append(deviation)
            self._numbers.append(self.next_number if number is None else number)
        if number is not None:
            del self._pending[number]
        if reached is not None and failed != "rig" and (astray := astray_in_words(self._box, actual[None, :])):
            warnings.warn(astray, stacklevel=3)

    def compare(self, better: Any, worse: Any) -> None:
        """Record that an input was preferred to another one; see `Optimizer.tell_preference`.

        The value of a trial is the share of its comparisons that it won. Nothing is recorded where one is bad.
        """
        places = [self._place_of(x) for x in (better, worse)]
        if same(*places):
            raise InputError(f"x = {self._box.as_dict(self._box.from_unit(places[0]))} is compared with itself.")
        rows: list[int] = []
        for x, u in zip((better, worse), places, strict=True):
            known = np.flatnonzero(same(u, self.commanded))
            if not len(known):
                self.tell(x, 0.0, False, None)
            rows.append(int(known[0]) if len(known) else len(self) - 1)
        self._pairs.append((rows[0], rows[1]))
        self._take_shares()

    def _place_of(self, x: Any) -> NDArray[np.float64]:
        """Return the place in the cube of x, which may have been told."""
        if isinstance(x, AskedTrial) and x.number in self._numbers:
            place = self._commanded[self._numbers.index(x.number)]
            check_place(self._box, x.number, x.x, place)
            return place
        return self._commanded_by(x)[1]

    def _take_shares(self) -> None:
        shares, made = shares_won(self.pairs, len(self))
        self._values, self._executions = shares.tolist(), made.tolist()

    def restore(
        self,
        X: ArrayLike,
        y: ArrayLike,
        reached: ArrayLike,
        pending: ArrayLike,
        numbers: ArrayLike | None = None,
        outputs: ArrayLike | None = None,
        executions: ArrayLike | None = None,
        deviations: ArrayLike | None = None,
        pairs: ArrayLike = (),
    ) -> None:
        """Take over stored trials; see `Optimizer.restore`. Nothing is taken over where an argument is bad."""
        inputs = trial_inputs(self._box, "X", X, inside=True)
        waiting = trial_inputs(self._box, "pending", pending, inside=True)
        actual = trial_inputs(self._box, "reached", reached, inside=False)
        self.restore_cube(inputs, y, actual, waiting, numbers, outputs, executions, deviations, pairs)

    def restore_cube(
        self,
        commanded: ArrayLike,
        y: ArrayLike,
        reached: ArrayLike,
        pending: ArrayLike,
        numbers: ArrayLike | None,
        outputs: ArrayLike | None = None,
        executions: ArrayLike | None = None,
        deviations: ArrayLike | None = None,
        pairs: ArrayLike = (),
    ) -> None:
        """Take over trials whose inputs are points of the unit cube, as they are."""
        stored = checked_columns(
            self._box.dimension,
            len(self.limits),
            self._counted,
            commanded=commanded,
            y=y,
            reached=reached,
            pending=pending,
            numbers=numbers,
            outputs=outputs,
            executions=executions,
            deviations=deviations,
            pairs=pairs,
        )
        told = len(stored.values)
        self._outputs = [tuple(row) for row in stored.outputs.tolist()]
        self._executions, self._deviations = stored.executions.tolist(), stored.deviations.tolist()
        self._commanded, self._reached = list(stored.commanded), list(stored.reached)
        self._values, self._numbers = stored.values.tolist(), stored.numbers[:told].tolist()
        self._pending = dict(zip(stored.numbers[told:].tolist(), stored.pending, strict=True))
        self._pairs = [(int(better), int(worse)) for better, worse in stored.pairs]
        if self._pairs:
            self._take_shares()

    def equal(self, other: "Trials") -> bool:
        """Tell whether the same trials have been told, in the same order; pending ones do not matter."""
        return (
            np.array_equal(self.values, other.values, equal_nan=True)
            and np.array_equal(self.commanded, other.commanded)
            and np.array_equal(self.reached, other.reached)
            and np.array_equal(self.outputs, other.outputs, equal_nan=True)
            and np.array_equal(self.executions, other.executions)
            and np.array_equal(self.deviations, other.deviations)
            and np.array_equal(self.pairs, other.pairs)
        )

    def of_output(self, k: int) -> "Trials":
        """Return the trials that measured output k, with that as their value."""
        return self._with(self.outputs[:, k])

    def without_failed(self) -> "Trials":
        """Return the trials that gave a value."""
        return self._with(self.values, self.deviations)

    def _with(self, values: NDArray[np.float64], deviations: NDArray[np.float64] | None = None) -> "Trials":
        some = np.isfinite(values)
        found = Trials(self._box)
        spread = None if deviations is None else deviations[some]
        found.restore_cube(
            self.commanded[some], values[some], self.reached[some], (), self.numbers[some], deviations=spread
        )
        return found

    def forget(self, x: Any) -> None:
        """Drop the pending trial at x (d,), or an `AskedTrial`; raises InputError if there is none."""
        number = self._numbered(x) if isinstance(x, AskedTrial) else self._waiting(self._box.to_unit(x))
        if number is None:
            raise InputError(f"x = {self._box.as_given(x)} is not pending; see Optimizer.pending.")
        del self._pending[number]

    # --- which trial, and where ---------------------------------------------------------------------------------------

    def _commanded_by(self, x: Any) -> tuple[int | None, NDArray[np.float64], NDArray[np.float64]]:
        """Return the number of the pending trial that x belongs to, if any, and the commanded and the reached input."""
        if isinstance(x, AskedTrial):
            number = self._numbered(x)
            return number, self._pending[number], self._pending[number]
        u = trial_input(self._box, "x", x)
        number = self._waiting(u)
        if np.all((u >= 0.0) & (u <= 1.0)):
            if number is None:  # what was asked for may have been rounded by the rig
                check_levels(self._box, "x", x)
            return number, u, u
        if number is None:
            raise InputError(
                f"x = {self._box.as_given(x)} lies outside {self._box}; tell a point inside the box, or, where a trial "
                "was commanded inside and went astray, tell(x, y, reached=...)."
            )
        return number, self._pending[number], u  # rounded beyond the border

    def _numbered(self, trial: AskedTrial) -> int:
        if trial.number not in self._pending:
            raise InputError(
                f"trial {trial.number} is not pending: it has been told or forgotten, or belongs to another optimizer."
            )
        check_place(self._box, trial.number, trial.x, self._pending[trial.number])
        return trial.number

    def _waiting(self, u: NDArray[np.float64]) -> int | None:
        """Return the number of the nearest pending trial within `ROUNDED`, of equals the one asked for first."""
        if not self._pending or u.ndim != 1:
            return None
        distances = np.abs(self.pending - u).max(axis=1)
        nearest = int(np.argmin(distances))
        return list(self._pending)[nearest] if distances[nearest] <= ROUNDED else None

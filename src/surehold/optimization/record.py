"""The record of an optimizer as its user tells and reads it: in the box's units, names and signs.

Legend: t trials told, failed ones included; p pending; d variables; o further outputs
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from inspect import signature
from typing import Any, Final, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization import saving
from surehold.optimization.box import Box
from surehold.optimization.known_coordinates import fixed_of
from surehold.optimization.limits import Limit
from surehold.optimization.noise.estimation import noise_from_reached, noise_from_repeats
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.numerics.threads import computing
from surehold.optimization.points import column_of
from surehold.optimization.success import counted
from surehold.optimization.trials import AskedTrial, Trials
from surehold.optimization.values import number_of, told_noise

__all__ = ["Record"]


class Record(ABC):
    """What an optimizer has been told.

    Parameters
    ----------
    box
        As of the optimizer.
    settings
        All arguments of the optimizer but the box, checked.
    limits
        Of the further outputs that trials tell.
    """

    def __init__(self, box: Box, settings: Mapping[str, Any], limits: tuple[Limit, ...]):
        self.box: Final = box
        self.direction: Final[str] = settings["direction"]
        self.outcome: Final[str] = settings["outcome"]
        self._settings: Final = settings
        self._sign: Final = 1.0 if self.direction == "maximize" else -1.0
        self._noise_told: Final = settings["noise"] == "told"
        self._conditions_measured: Final = box.uncontrolled is not None and settings["conditions"] == "measured"
        self._fixed: Final = fixed_of(box, settings["fixed"])
        self._trials = Trials(box, limits, self.outcome != "value", self._fixed)

    @abstractmethod
    def _replaced(self) -> None:
        """Forget what was concluded from the trials: they are others from now on."""

    @property
    def X(self) -> NDArray[np.float64]:
        """Inputs commanded so far, failed ones included, (t, d), in the box's units."""
        return self.box.from_unit(self._trials.commanded)

    @property
    def y(self) -> NDArray[np.float64]:
        """Values told so far, (t,); NaN for failed trials."""
        return self._sign * self._trials.values

    @property
    def pending(self) -> NDArray[np.float64]:
        """Inputs asked for and not told yet, (p, d), in the box's units."""
        return self.box.from_unit(self._trials.pending)

    @property
    def outputs(self) -> dict[str, NDArray[np.float64]]:
        """Further outputs told so far by name, (t,) each; NaN where one was not measured."""
        return {limit.name: self._trials.outputs[:, k] for k, limit in enumerate(self._trials.limits)}

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Limits of the further outputs, in the order of `constraints`; those that are only watched are among them."""
        return self._trials.limits

    @property
    def reached(self) -> NDArray[np.float64]:
        """Inputs truly reached (t, d), in the box's units: the commanded ones where nothing else was told."""
        return self.box.from_unit(self._trials.reached)

    def tell(
        self,
        x: Any,
        y: float | None = None,
        *,
        failed: bool | Literal["rig"] = False,
        reached: Any = None,
        constraints: Mapping[str, float | None] | None = None,
        success: bool | None = None,
        successes: int | None = None,
        of: int | None = None,
        noise: float | None = None,
    ) -> None:
        """Record the outcome y of a trial at x, or that it gave nothing.

        Parameters
        ----------
        x
            Where: an `AskedTrial`, or the point (d,) in the box's units; a dictionary or a Series of pandas is read by
            its names. If it is pending it is so no more; a trial that was never asked for is welcome too. A point
            belongs to the nearest pending trial within 0.01 box widths in every variable, so that a rig may round it;
            the model learns from the point as it is told. One beyond a bound by no more than the rounding of single
            precision is on the bound (see `Box.rounding`).
        y
            One finite number.
        failed
            True: the place gave nothing, and is avoided from then on, see `failures`. "rig": the place is not at fault
            (a camera hung, a person came in the way). The trial leaves no trace, and its number is asked for again.
        reached
            Where the trial truly was, (d,), where that is known; inside of the box or not. The model learns from
            there; more than 1e6 box widths away counts as 1e6. `recommend` answers inputs inside the box only.
        constraints
            {name: value} of the further outputs: every one that has a limit, unless the trial failed; None for one that
            could not be measured.
        success, successes, of
            In place of y where `outcome` is "success": True or False, or so many successes of so many executions. A
            failed trial counts as one that did not succeed.
        noise
            Standard deviation of the observation noise in y, where the optimizer was made with `noise="told"`; of the
            mean of n readings, that of one by the root of n.

        Raises
        ------
        InputError
            If x or reached has the wrong shape, other names or is not finite, or x lies outside the box, or,
            where it was not asked for, between the levels of a variable; if an `AskedTrial` has been told before, or is
            another optimizer's; if y is missing, not finite or not a number; if a failed trial comes with a value; if
            an output is missing, unknown or not finite. Nothing told before is lost.
        """
        if failed and self.outcome == "success":  # what a failed trial does not say was not measured
            constraints = {limit.name: None for limit in self.limits} | dict(constraints or {})
        y, executions, failed = counted(self.outcome, y, success, successes, of, failed)
        y = None if y is None else self._sign * number_of(y)
        if self._conditions_measured and failed != "rig":
            reached = self._with_conditions(x, reached)
        deviation = told_noise(noise, wanted=self._noise_told and not failed)
        self._trials.tell(x, y, failed, reached, constraints, executions, deviation)

    def tell_preference(self, better: Any, worse: Any) -> None:
        """Record that one input was judged better than another, where `outcome` is "preference".

        Both are what `tell` takes as x: asked for, told before, or new. Of two that are equally good tell nothing, or
        both orders. A new input is told by its first comparison; compare it with the best so far, `recommend().x`.

        Raises InputError where an input is bad, or both are one; or where `outcome` is another.
        """
        if self.outcome != "preference":
            raise InputError("this optimizer is told no preferences; make Optimizer(..., outcome='preference').")
        self._trials.compare(better, worse)
        self._replaced()

    def _with_conditions(self, x: Any, reached: Any) -> Any:
        """Return the reached input, of which only the uncontrolled variables must be said."""
        held = self.box.uncontrolled
        names = [] if held is None else [n for n, h in zip(self.box.names, held.held, strict=True) if h]
        if reached is None or (isinstance(reached, Mapping) and not set(names) <= set(reached)):
            raise InputError(
                f"the trial says nothing about {', '.join(names)}, which nobody sets; tell "
                f"reached={{{', '.join(f'{name!r}: value' for name in names)}}}."
            )
        commanded = self.box.as_dict(x.x if isinstance(x, AskedTrial) else x)
        return {**commanded, **reached} if isinstance(reached, Mapping) else reached

    def forget(self, x: Any) -> None:
        """Drop a pending trial, an `AskedTrial` or its x (d,), that will never be told; its number is asked for again.

        Raises InputError if it is not pending.
        """
        self._trials.forget(x)

    def restore(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        reached: ArrayLike | None = None,
        pending: ArrayLike | None = None,
        numbers: ArrayLike | None = None,
        outputs: ArrayLike | None = None,
        of: ArrayLike | None = None,
        noise: ArrayLike | None = None,
        preferences: ArrayLike = (),
    ) -> None:
        """Replace all trials by stored ones: X (t, d) with values y (t,), NaN for failed ones, and pending (p, d).

        `reached` (t, d) are the inputs that were truly reached, X where None. `numbers` (t + p,) are those of the
        trials, the pending ones last; 0, 1, 2, ... where None. `outputs` (t, o) are the further outputs in the order of
        `constraints`, NaN where not measured. `of` (t,) are the executions of which y is the share of successes, 1 each
        where None. `noise` (t,) are the standard deviations told. `preferences` (p, 2) are rows of X that
        were compared, the better one first; y is counted from them then. What is asked next is what an optimizer asks
        that was told these trials in this order. One that had asked for them itself knows them in the unit cube, where
        X is they but for rounding: that may lead a search elsewhere. `save` and `load` keep the last bit.

        Raises
        ------
        InputError
            If shapes do not fit, an input is not finite, X or pending lie outside the box, or a value is infinite.
        """
        values = self._sign * column_of("y", y)
        if self.outcome == "success":
            values = np.where(np.isnan(values), 0.0, values)  # a failed trial did not succeed
        trials = Trials(self.box, self._trials.limits, self.outcome != "value", self._fixed)
        trials.restore(
            X,
            values,
            X if reached is None else reached,
            () if pending is None else pending,
            numbers,
            outputs,
            of,
            noise,
            preferences,
        )
        if not trials.equal(self._trials):
            self._replaced()
        self._trials = trials

    def estimate_input_noise(self) -> InputNoise:
        """Return the input noise that the trials told so far show.

        From the reached inputs if enough trials told them; else from values that differ between trials of one commanded
        input, taking the noise for the same share of the box in every variable and observations for exact.

        Raises
        ------
        InputError
            If there are neither; it says what to tell.
        """
        told, reported = self._trials.successful, self._trials.reported
        held = self.box.uncontrolled
        if reported.any():
            numbers = self.box.numbers
            if numbers is None:
                raise InputError("all variables are choices, which carry no input noise.")
            shown = [self.box.names.index(name) for name in numbers.names]
            commanded, reached = self._trials.commanded[reported], self._trials.reached[reported]
            if held is not None:  # conditions differ, which is no noise
                reached[:, held.held] = commanded[:, held.held]
            commanded, reached = commanded[:, shown], reached[:, shown]
            return noise_from_reached(numbers, commanded, reached)
        if self._conditions_measured:
            raise InputError(
                "no trial tells where it went but for its conditions, by which values of one input differ, too: tell "
                "reached= with all variables."
            )
        with computing():
            return noise_from_repeats(self._trials.commanded[told], self._trials.values[told])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write settings and trials, pending ones included, into a JSON file, for `load`.

        Raises InputError where it cannot be written.
        """
        saving.write(path, self.box, self._settings, self._trials)

    @classmethod
    def load(cls, path: str | os.PathLike[str], **settings: Any) -> Self:
        """Return the optimizer that `save` has written: it asks and recommends what that one would.

        Settings that are given replace stored ones; those that a file cannot hold must be: a surrogate that is an
        object, input noise that varies. (The chains of the thesis presets start anew.) What was told stays as it was
        told: values where `direction` is replaced, and the outputs of `constraints` that keep their names.

        Raises
        ------
        InputError
            If the file cannot be read or holds no optimizer, or such a setting is missing; for another box.

        Examples
        --------
        >>> import tempfile
        >>> from surehold import Box, Optimizer
        >>> optimizer = Optimizer(Box({"x": (0.0, 1.0)}), seed=3)
        >>> optimizer.tell(optimizer.ask(), 0.5)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     optimizer.save(f"{folder}/run.json")
        ...     again = Optimizer.load(f"{folder}/run.json")
        >>> bool(again.ask() == optimizer.ask())
        True
        """
        if "box" in settings:
            raise InputError(
                "box cannot be replaced: stored inputs are points of it. Make an Optimizer of the other box, and tell "
                "it X and y of the stored one, or restore them."
            )
        box, found, trials = saving.read(path, settings)
        known = tuple(signature(cls).parameters)[1:]
        for name in found:
            if name not in known:
                raise unknown_name(f"setting of an optimizer, in {os.fspath(path)!r},", name, known)
        optimizer = cls(box, **found)
        optimizer._trials = trials
        return optimizer

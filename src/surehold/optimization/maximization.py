"""A whole run: ask, try, tell, until the budget is spent."""

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.amounts import amount
from surehold.errors import InputError, SureholdError
from surehold.optimization.box import Box
from surehold.optimization.evaluation import Evaluation, in_processes, one_by_one
from surehold.optimization.limits import returned_outputs
from surehold.optimization.optimizer import Optimizer, check_settings
from surehold.optimization.progress import progress_bar
from surehold.optimization.recommendation import Recommendation, in_digits, outside_in_words, place

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

__all__ = ["Result", "Trial", "maximize", "minimize"]

_PATIENCE: Final = 3  # failures after which a run is given up where nothing has succeeded yet


@dataclass(frozen=True)
class Trial:
    """One finished trial, as passed to the callback.

    Attributes
    ----------
    index
        0 for the first that finished; of a stored study its id.
    x : (d,)
        In the box's units.
    y
        Value; NaN where the trial failed.
    failure
        Why it failed, empty where it did not.
    best
        Best value so far, NaN while there is none.
    recommendation
        What would be recommended now; None during the initial design.
    seconds
        Time that asking took.
    outputs
        Further outputs, such as {"torque": 3.1}.
    parameters
        x as {name: value}.
    """

    index: int
    x: NDArray[np.float64]
    y: float
    failure: str
    best: float
    recommendation: Recommendation | None
    seconds: float
    outputs: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        what = self.failure or f"y={self.y:.6g}"
        return f"Trial(index={self.index}, {place(self.x, self.parameters)}, {what})"


@dataclass(frozen=True)
class Result:
    """What a run has found.

    Attributes
    ----------
    optimizer
        Holds all trials and the model; can be asked further.
    trials
        In the order in which they finished.
    recommendation
        The answer.
    interrupted
        Whether Ctrl-C ended the run before its budget.
    stopped
        What ended the run before its budget: "Ctrl-C", "callback" or "timeout"; empty where nothing did.
    """

    optimizer: Optimizer
    trials: tuple[Trial, ...]
    recommendation: Recommendation
    interrupted: bool
    stopped: str = ""

    @property
    def X(self) -> NDArray[np.float64]:
        """Inputs (t, d), in the box's units."""
        return self.optimizer.X

    @property
    def y(self) -> NDArray[np.float64]:
        """Values (t,); NaN for failed trials."""
        return self.optimizer.y

    @property
    def best_index(self) -> int:
        """Index of the trial with the best value, of feasible ones where there are any."""
        y = np.where(self.optimizer.feasible, self.y, np.nan)
        y = y if np.isfinite(y).any() else self.y
        return int(np.nanargmin(y) if self.optimizer.direction == "minimize" else np.nanargmax(y))

    def to_dataframe(self) -> "DataFrame":
        """Return the trials as a table of pandas: variables, value, further outputs, failure, best and seconds.

        Whether a trial is feasible is among them where outputs have limits. The index is `Trial.index`. Raises
        SureholdError where pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise SureholdError("to_dataframe needs pandas; install it: pip install pandas.") from None
        box = self.optimizer.box
        columns = [variable.name for variable in box.variables]
        index = pandas.Index([trial.index for trial in self.trials], name="trial")
        table = pandas.DataFrame([box.as_dict(trial.x) for trial in self.trials], index, columns)
        rows: list[tuple[str, list[Any]]] = [("value", [trial.y for trial in self.trials])]
        named = dict.fromkeys(name for trial in self.trials for name in trial.outputs)
        rows += [(name, [trial.outputs.get(name, np.nan) for trial in self.trials]) for name in named]
        if any(not limit.watched for limit in self.optimizer.limits):
            rows.append(("feasible", self.optimizer.feasible[: len(self.trials)].tolist()))
        rows += [(name, [getattr(trial, name) for trial in self.trials]) for name in ("failure", "best", "seconds")]
        for name, values in rows:
            table[name if name not in table else f"trial {name}"] = values
        return table

    def plot(self, function: Callable[[Any], float] | None = None) -> "Figure":
        """Return one picture of the run, a figure of matplotlib; see `surehold.reports.plots.plot`."""
        from surehold.reports.plots import plot

        return plot(self, function)

    def report(
        self,
        folder: str | os.PathLike[str],
        function: Callable[[Any], float] | None = None,
        title: str = "Optimization",
    ) -> Path:
        """Write the run as a page with its data and figures; see `surehold.reports.plots.write_report`."""
        from surehold.reports.plots import write_report

        return write_report(self, Path(folder), function, title=title)

    def __repr__(self) -> str:
        failed = int(np.isnan(self.y).sum())
        parts = (
            [amount(len(self.y), "trial")]
            + [f"{failed} failed"] * bool(failed)
            + [f"stopped by {self.stopped}"] * bool(self.stopped)
        )
        return f"<Result of {', '.join(parts)}; {self.recommendation!r}>"

    def _repr_html_(self) -> str:
        from html import escape

        best = self.recommendation
        rows = [(name, f"{v:.6g}" if isinstance(v, float) else str(v)) for name, v in best.parameters.items()]
        rows += [(name, in_digits(getattr(best, name), best.std, 6)) for name in ("mean", "quantile", "observed")]
        rows.insert(-2, ("std", f"{best.std:.6g}"))
        if best.by_risk is not None:
            rows.insert(-3, (f"{self.optimizer.risk}", in_digits(best.by_risk, best.std, 6)))
        cells = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
        said = (best.refused, outside_in_words(best.outside), best.warning)
        refused = "".join(f"<p>{escape(text)}</p>" for text in said if text)
        return f"<table><caption>Recommended after {amount(len(self.y), 'trial')}</caption>{cells}</table>{refused}"


def maximize(
    f: Callable[[Any], float],
    box: Box,
    n_trials: int = 100,
    *,
    callback: Callable[[Trial], Any] | None = None,
    timeout: float | None = None,
    n_jobs: int = 1,
    tolerate_failures: bool = False,
    progress: bool | None = None,
    **settings: Any,
) -> Result:
    """Maximize f over the box in `n_trials` trials, so that the answer holds under the input noise.

    Parameters
    ----------
    f
        Takes x (d,) in the box's units, or a dictionary {name: value} where the box has logarithms, whole numbers or
        choices; returns a number, with `constraints` a number and a dictionary of the further outputs,
        (y, {"torque": 3.1}); outputs that `constraints` does not name are kept with the trial, unmodelled. A trial
        that raises, or gives anything but one finite number, is recorded as failed and the run goes on. With
        `outcome="success"` it returns True or False, and anything else ends the run.
    n_trials
        Budget, initial design included.
    callback
        Called with each finished trial. Where it returns True, or raises StopIteration, the run ends and its result is
        returned.
    timeout
        Seconds after which no further trial is begun; None: no limit.
    n_jobs
        Trials made at the same time, each in a process of its own; 1 makes them in this one. A new trial is asked for
        as soon as one has finished, so that what is asked depends on how long trials take.
    tolerate_failures
        Whether to go on where the first three trials fail, for functions that fail almost everywhere. By default such
        a run is given up: mostly it is the function that is wrong, and no trial would succeed.
    progress
        Whether a progress bar is shown once a run takes more than two seconds; by default where there is no callback
        and the output is a terminal.
    **settings
        Of `Optimizer`: input_noise, surrogate, criterion, n_initial, initial_points, guess, fixed, allowed,
        constraints, seed, noise, preset, ...

    Ctrl-C ends the run and keeps what was done.

    Raises
    ------
    InputError
        For bad settings, more initial trials than trials, or a function that cannot be called with one array.
    SureholdError
        If every trial failed, or the first three did; the message quotes the last failure.
    KeyboardInterrupt
        If Ctrl-C comes before any trial has given a value.

    Examples
    --------
    >>> box = Box({"x": (-1.0, 2.0)})
    >>> result = maximize(lambda x: -((x[0] - 0.5) ** 2), box, n_trials=12, seed=0)
    >>> bool(abs(result.recommendation.x[0] - 0.5) < 0.01)
    True
    """
    if not callable(f):
        raise InputError(f"f is {f!r}; give a function that takes x (d,) and returns a number.")
    if callback is not None and not callable(callback):
        raise InputError(f"callback is {callback!r}; give a function that takes a Trial, or None.")
    n_trials, n_jobs = _count("n_trials", n_trials), _count("n_jobs", n_jobs)
    if timeout is not None and (isinstance(timeout, bool) or not isinstance(timeout, (int, float)) or not timeout > 0):
        raise InputError(f"timeout is {timeout!r}; give a number of seconds above 0, or None.")
    optimizer = _optimizer(box, n_trials, settings)
    deadline = np.inf if timeout is None else perf_counter() + timeout
    trials: list[Trial] = []
    stopped = ""
    evaluations = one_by_one(optimizer, f, n_trials) if n_jobs == 1 else in_processes(optimizer, f, n_trials, n_jobs)
    try:
        with progress_bar(n_trials, callback is None if progress is None else progress) as advance:
            for evaluation in evaluations:
                trial = _told(optimizer, evaluation, len(trials))
                trials.append(trial)
                if not tolerate_failures and len(trials) == _PATIENCE < n_trials and all(t.failure for t in trials):
                    raise _given_up(optimizer.box, trials)
                advance(trial.best)
                if callback is not None and _ends(callback, trial):
                    stopped = "callback"
                    break
                if perf_counter() >= deadline and len(trials) < n_trials:
                    stopped = "timeout"
                    break
    except KeyboardInterrupt:
        if not np.any(np.isfinite(optimizer.y)):
            raise
        stopped = "Ctrl-C"
    finally:
        _close(evaluations)
    if trials and all(trial.failure for trial in trials):
        raise SureholdError(f"all {len(trials)} trials failed; the last one: {trials[-1].failure}")
    last = trials[-1].recommendation if trials and len(trials) == len(optimizer.y) else None
    return Result(optimizer, tuple(trials), last or optimizer.recommend(), stopped == "Ctrl-C", stopped)


def minimize(f: Callable[[Any], float], box: Box, n_trials: int = 100, **settings: Any) -> Result:
    """Minimize f over the box; arguments, result and errors as of `maximize`, all values in the sign of f.

    Examples
    --------
    >>> result = minimize(lambda x: (x[0] - 0.5) ** 2, Box({"x": (-1.0, 2.0)}), n_trials=12, seed=0)
    >>> bool(abs(result.recommendation.x[0] - 0.5) < 0.01), bool(result.recommendation.mean < 0.001)
    (True, True)
    """
    if settings.get("direction", "minimize") != "minimize":
        raise InputError(f"direction is {settings['direction']!r}, but minimize minimizes; leave it out.")
    turned: dict[str, Any] = {**settings, "direction": "minimize"}
    return maximize(f, box, n_trials, **turned)


def _count(name: str, value: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{name} is {value!r}; give a whole number of 1 or more.")
    return int(value)


def _optimizer(box: Box, n_trials: int, settings: dict[str, Any]) -> Optimizer:
    if settings.get("outcome") == "preference":
        raise InputError("a function gives no preferences; make an Optimizer, and tell_preference(better, worse).")
    if settings.get("noise") == "told":
        raise InputError(
            "a function tells no noise with its value; give noise='inferred' or its deviation, or make an Optimizer, "
            "and tell(x, y, noise=...)."
        )
    if settings.get("conditions") == "measured" and getattr(box, "uncontrolled", None) is not None:
        raise InputError(
            "a function is called at the conditions that are asked for, and tells none; leave conditions out, or make "
            "an Optimizer, and tell(x, y, reached=...)."
        )
    check_settings(settings, maximize)
    optimizer = Optimizer(box, **settings)
    if settings.get("n_initial") is None and optimizer.n_initial > n_trials:
        fewer: dict[str, Any] = {**settings, "n_initial": n_trials}
        optimizer = Optimizer(box, **fewer)
    if optimizer.n_initial > n_trials:
        raise InputError(
            f"n_initial is {optimizer.n_initial}, but n_trials is {n_trials}; "
            "give at least as many trials as initial ones."
        )
    return optimizer


def _told(optimizer: Optimizer, evaluation: Evaluation, index: int) -> Trial:
    asked, y, failure, outputs, seconds = evaluation
    told, wrong = ({}, "") if failure else returned_outputs(optimizer.limits, outputs)
    if wrong:
        y, failure, outputs = np.nan, wrong, {}
    try:
        if optimizer.outcome == "success" and not failure:
            if y not in (0.0, 1.0):
                raise InputError(f"the function returned {y:g}, but outcome='success' needs True or False (or 1 or 0).")
            optimizer.tell(asked, success=bool(y), constraints=told or None)
        else:
            optimizer.tell(asked, None if failure else y, failed=bool(failure), constraints=told or None)
    except InputError as error:  # of what the function returned; the run is not lost for it
        if optimizer.outcome == "success":
            raise
        y, failure, outputs = np.nan, str(error).rstrip("."), {}
        optimizer.tell(asked, failed=True)
    values = np.where(optimizer.feasible, optimizer.y, np.nan)
    best = np.nan
    if np.any(np.isfinite(values)):
        best = float(np.nanmin(values) if optimizer.direction == "minimize" else np.nanmax(values))
    modelled = len(values) >= optimizer.n_initial and np.isfinite(optimizer.y).any()
    answer = optimizer.recommend() if modelled else None
    return Trial(index, asked.x, y, failure, best, answer, seconds, outputs, asked.parameters)


def _ends(callback: Callable[[Trial], Any], trial: Trial) -> bool:
    try:
        ends = callback(trial)
    except StopIteration:
        return True
    return isinstance(ends, (bool, np.bool_)) and bool(ends)


def _close(evaluations: Iterator[Evaluation]) -> None:
    close = getattr(evaluations, "close", None)
    if close is not None:
        close()


def _given_up(box: Box, trials: list[Trial]) -> SureholdError:
    last = trials[-1]
    return SureholdError(
        f"the first {len(trials)} trials failed, so the run is given up; the last one, at x = {box.as_dict(last.x)}: "
        f"{last.failure}. Mend the function, or, if it fails almost everywhere, say tolerate_failures=True."
    )

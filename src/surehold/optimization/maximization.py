"""A whole run: ask, try, tell, until the budget is spent."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, SureholdError
from surehold.optimization.box import Box
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.recommendation import Recommendation

__all__ = ["Result", "Trial", "evaluate", "maximize"]


@dataclass(frozen=True)
class Trial:
    """One finished trial, as passed to the callback."""

    index: int
    """0 for the first"""
    x: NDArray[np.float64]
    """(d,), in the box's units"""
    y: float
    """NaN where the trial failed"""
    failure: str
    """why it failed, empty where it did not"""
    best: float
    """highest value so far, NaN while there is none"""
    recommendation: Recommendation | None
    """what would be recommended now; None during the initial design"""
    seconds: float
    """time that asking took"""


@dataclass(frozen=True)
class Result:
    """What a run has found."""

    optimizer: Optimizer
    """holds all trials and the model; can be asked further"""
    trials: tuple[Trial, ...]
    recommendation: Recommendation
    interrupted: bool
    """whether Ctrl-C ended the run before its budget"""

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
        """Index of the trial with the highest value."""
        return int(np.nanargmax(self.y))


def maximize(
    f: Callable[[NDArray[np.float64]], float],
    box: Box,
    n_trials: int = 100,
    *,
    callback: Callable[[Trial], Any] | None = None,
    **settings: Any,
) -> Result:
    """Maximize f over the box in `n_trials` trials, so that the answer holds under the input noise.

    Parameters
    ----------
    f
        Takes x (d,) in the box's units, returns a number. A trial that raises, or gives anything but one finite
        number, is recorded as failed and the run goes on.
    n_trials
        Budget, initial design included.
    callback
        Called with each finished trial.
    **settings
        Of `Optimizer`: input_noise, surrogate, criterion, n_initial, seed, noise, preset, ...

    Ctrl-C ends the run and keeps what was done.

    Raises
    ------
    InputError
        For bad settings, or more initial trials than trials.
    SureholdError
        If every trial failed; the message quotes the last failure.
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
    if isinstance(n_trials, bool) or not isinstance(n_trials, (int, np.integer)) or n_trials < 1:
        raise InputError(f"n_trials is {n_trials!r}; give a whole number of 1 or more.")
    if settings.get("n_initial") is None and isinstance(box, Box):
        settings["n_initial"] = min(Optimizer.default_n_initial(box), n_trials)
    optimizer = Optimizer(box, **settings)
    if optimizer.n_initial > n_trials:
        raise InputError(
            f"n_initial is {optimizer.n_initial}, but n_trials is {n_trials}; "
            "give at least as many trials as initial ones."
        )
    trials: list[Trial] = []
    interrupted = False
    try:
        while len(trials) < n_trials:
            trial = _try_once(optimizer, f, trials)
            trials.append(trial)
            if callback is not None:
                callback(trial)
    except KeyboardInterrupt:
        if not np.any(np.isfinite(optimizer.y)):
            raise
        interrupted = True
    if not np.any(np.isfinite(optimizer.y)):
        raise SureholdError(f"all {len(trials)} trials failed; the last one: {trials[-1].failure}")
    last = trials[-1].recommendation if trials and len(trials) == len(optimizer.y) else None
    return Result(optimizer, tuple(trials), last or optimizer.recommend(), interrupted)


def _try_once(optimizer: Optimizer, f: Callable[[NDArray[np.float64]], float], trials: list[Trial]) -> Trial:
    started = perf_counter()
    x = optimizer.ask()
    seconds = perf_counter() - started
    y, failure = evaluate(f, x)
    if failure:
        optimizer.tell(x, failed=True)
    else:
        optimizer.tell(x, y)
    values = optimizer.y
    best = float(np.nanmax(values)) if np.any(np.isfinite(values)) else np.nan
    modelled = len(values) >= optimizer.n_initial and np.isfinite(best)
    recommendation = optimizer.recommend() if modelled else None
    return Trial(len(trials), x, y, failure, best, recommendation, seconds)


def evaluate(f: Callable[[NDArray[np.float64]], float], x: NDArray[np.float64]) -> tuple[float, str]:
    """Return f(x) and an empty text, or NaN and why there is no finite number."""
    try:
        value = np.asarray(f(x.copy()), dtype=np.float64)
    except Exception as error:  # whatever a user's function raises is the trial's outcome, not the run's end
        return np.nan, f"{type(error).__name__}: {error}"
    if value.size != 1:
        return np.nan, f"returned an array of shape {value.shape} instead of one number"
    if not np.isfinite(value).all():
        return np.nan, f"returned {float(value.reshape(()))}"
    return float(value.reshape(())), ""

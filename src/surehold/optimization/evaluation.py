"""Trying inputs: a user's function called here, one trial after the other, or in processes of its own."""

import os
from collections.abc import Callable, Iterator, Mapping
from time import perf_counter
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, SureholdError
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.points import numbers_of
from surehold.optimization.trials import AskedTrial
from surehold.optimization.values import LARGEST
from surehold.store.parent import end_with
from surehold.store.uninterrupted import raise_interruption

__all__ = ["Evaluation", "evaluate", "in_processes", "one_by_one"]

_NOTICED = 10.0  # s
_NOT_ONE_NUMBER = "can be converted to Python scalars"  # NumPy's words where math.sin(x) is called with an array


class Evaluation(NamedTuple):
    """What came of a trial."""

    asked: AskedTrial
    y: float
    """NaN where it failed"""
    failure: str
    """why it failed, empty where it did not"""
    outputs: Mapping[str, Any]
    """further outputs, such as {"torque": 3.1}"""
    seconds: float
    """time that asking took"""


def evaluate(f: Callable[[Any], Any], x: NDArray[np.float64] | dict[str, Any]) -> tuple[float, str, Mapping[str, Any]]:
    """Return f(x) and an empty text, or NaN and why there is no finite number; and further outputs.

    f returns a number, or a number and a dictionary of further outputs.

    Raises
    ------
    InputError
        If f cannot be called with one array, or one dictionary, at all: no other x would be better.
    """
    try:
        value = f(x.copy())
    except Exception as error:  # whatever a user's function raises is the trial's outcome, not the run's end
        raise_interruption(error)
        if isinstance(error, TypeError) and _in_the_call(error.__traceback__):
            what = f"dictionary of {', '.join(x)}" if isinstance(x, dict) else f"array x of shape {x.shape}"
            use = f"x[{next(iter(x))!r}]" if isinstance(x, dict) else "x[0]"
            raise InputError(
                f"the function cannot be called with one {what}: {error}; write it as f(x), and use {use}."
            ) from None
        hint = "" if isinstance(x, dict) or _NOT_ONE_NUMBER not in str(error) else f"; x has shape {x.shape}, take x[0]"
        return np.nan, f"{type(error).__name__}: {error}{hint}", {}
    outputs: Mapping[str, Any] = {}
    if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], Mapping):
        value, outputs = value
    return *_number(value), outputs


def _number(value: Any) -> tuple[float, str]:
    if value is None:
        return np.nan, "returned None instead of a number (is a return missing?)"
    try:
        array = numbers_of(value)
    except (TypeError, ValueError, OverflowError) as error:
        return np.nan, f"{type(error).__name__}: {error}"
    if array.size != 1:
        return np.nan, f"returned an array of shape {array.shape} instead of one number"
    number = float(array.reshape(()))
    return (number, "") if abs(number) <= LARGEST else (np.nan, f"returned {number}")


def argument(optimizer: Optimizer, asked: AskedTrial) -> NDArray[np.float64] | dict[str, Any]:
    """Return what a function is called with: x (d,), or {name: value} where the box is not plain."""
    return asked.x if optimizer.box.plain else asked.parameters


def _in_the_call(traceback: TracebackType | None) -> bool:
    """Tell whether an error was raised before a line of the user's function ran."""
    while traceback is not None and traceback.tb_next is not None:
        traceback = traceback.tb_next
    name = "" if traceback is None else str(traceback.tb_frame.f_globals.get("__name__", ""))
    return name.partition(".")[0] == "surehold"


def one_by_one(optimizer: Optimizer, f: Callable[..., Any], n_trials: int) -> Iterator[Evaluation]:
    """Ask and try `n_trials` times; whoever iterates tells."""
    for _ in range(n_trials):
        started = perf_counter()
        asked = optimizer.ask_trial()
        seconds = perf_counter() - started
        yield Evaluation(asked, *evaluate(f, argument(optimizer, asked)), seconds)


def in_processes(optimizer: Optimizer, f: Callable[..., Any], n_trials: int, n_jobs: int) -> Iterator[Evaluation]:
    """Ask and try `n_trials` times, up to `n_jobs` at once, each as soon as another has finished.

    Whoever iterates tells. Where the iterator is closed early, what still runs is ended.

    Raises
    ------
    SureholdError
        If f cannot be sent to a process, or a process dies.
    """
    from concurrent.futures import FIRST_COMPLETED, Future, wait
    from concurrent.futures.process import BrokenProcessPool
    from pickle import PicklingError

    from joblib.externals.loky import ProcessPoolExecutor

    pool = ProcessPoolExecutor(n_jobs, initializer=end_with, initargs=(os.getpid(),))
    running: dict[Future[tuple[float, str, Mapping[str, Any]]], tuple[AskedTrial, float]] = {}
    begun = 0
    try:
        while begun < n_trials or running:
            while begun < n_trials and len(running) < n_jobs:
                started = perf_counter()
                asked = optimizer.ask_trial()
                seconds = perf_counter() - started
                running[pool.submit(evaluate, f, argument(optimizer, asked))] = (asked, seconds)
                begun += 1
            done = min(wait(running, return_when=FIRST_COMPLETED).done, key=lambda future: running[future][0].number)
            asked, seconds = running.pop(done)
            yield Evaluation(asked, *done.result(), seconds)
    except PicklingError as error:
        raise SureholdError(f"the function cannot be sent to a process: {error}. Say n_jobs=1.") from None
    except BrokenProcessPool as error:
        raise SureholdError(f"a process that made a trial has died: {error}. Say n_jobs=1 to see why.") from None
    finally:
        for asked, _ in running.values():
            optimizer.forget(asked)
        waiting = [future for future in running if future.cancel()]
        wait(waiting, timeout=_NOTICED)  # the pool's thread fails where trials vanish that it has not looked at yet
        pool.shutdown(wait=True, kill_workers=len(waiting) < len(running))

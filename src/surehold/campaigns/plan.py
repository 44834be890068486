"""What a campaign runs: problems x methods x seeds, with budgets and scoring. Plain data; nothing here computes.

A plan is written in YAML (`plan_file.load_plan`) or built in Python from the classes below. The seed of a run decides
its initial design, its observation noise and the perturbations that score it, all of them the same for every method:
runs of one seed are paired.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

from surehold.errors import InputError, unknown_name
from surehold.optimization.surrogates.named import DEFAULT_SURROGATE

__all__ = ["Cell", "MethodSetup", "Plan", "ProblemSetup", "Task", "share_of"]
_MOST_RUNS, _MOST_TRIALS = 10_000, 100_000  # more is a slip of the pen: lists of runs and trials are held in memory


@dataclass(frozen=True)
class ProblemSetup:
    """A problem of a plan, its budget and how answers are scored."""

    function: str
    """name of `problems.named`, "grasp", `package.module:function` or `path/file.py:function`"""
    trials: int
    """budget, initial design included"""
    initial: int
    """trials of the initial design, a Latin hypercube"""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    """of a grasp (object, facet, variables, contact, ...); bounds of an own function, `NAME=LOWER:UPPER,...`"""
    input_noise: float | Literal["own"] | None = None
    """standard deviation in unit-cube units, in every variable; "own": what a robust problem states, with its risk and
    its score; None: answers are not scored under noise"""
    requeries: int = 100
    """perturbed re-queries that score an answer"""
    observation_noise: float = 0.0
    """s: what is told is f(x) - |e|, e ~ N(0, s^2)"""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """of the optimizer on this problem, such as a preset; settings of the method come before these"""


@dataclass(frozen=True)
class MethodSetup:
    """A method of a plan."""

    optimizer: str = "surehold"
    """"surehold", or another library's (see `methods.METHODS`)"""
    robust: bool = False
    """whether the method is told of the input noise"""
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Cell:
    """One problem with one method: what is repeated with many seeds."""

    problem: str
    """label in the plan"""
    method: str
    """label in the plan"""
    on: ProblemSetup
    by: MethodSetup

    def as_data(self) -> dict[str, Any]:
        """Return all settings, JSON-ready."""
        on, by = self.on, self.by
        own = {**on.settings, **by.settings} if by.optimizer == "surehold" else dict(by.settings)
        if by.optimizer == "surehold" and own.get("preset") is None and own.get("surrogate") is None:
            own["surrogate"] = DEFAULT_SURROGATE  # another version has another: its runs are not these
        return {
            **_source(on.function),
            "function": on.function,
            "arguments": dict(on.arguments),
            "trials": on.trials,
            "initial": on.initial,
            "input_noise": on.input_noise,
            "requeries": on.requeries,
            "observation_noise": on.observation_noise,
            "optimizer": by.optimizer,
            "robust": by.robust,
            "settings": {name: _plain(value) for name, value in own.items() if value is not None},
        }

    @property
    def digest(self) -> str:
        """Fingerprint of the settings: runs of equal digest and seed are the same run."""
        text = json.dumps(self.as_data(), sort_keys=True, default=list)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


class Task(NamedTuple):
    """One run to be made."""

    cell: Cell
    seed: int


@dataclass(frozen=True)
class Plan:
    """Problems x methods x seeds.

    Raises
    ------
    InputError
        If there is no problem, no method or no run, or a budget or noise is out of range.
    """

    name: str
    title: str
    problems: Mapping[str, ProblemSetup]
    methods: Mapping[str, MethodSetup]
    runs: int = 30
    """seeds 0, 1, ..., runs - 1"""
    note: str = ""
    """shown in the report"""

    def __post_init__(self) -> None:
        if not self.problems or not self.methods:
            raise InputError(f"plan '{self.name}' has no {'methods' if self.problems else 'problems'}; name one.")
        for label in (*self.problems, *self.methods):
            if not label.strip():
                raise InputError(f"a problem or method in plan '{self.name}' is named {label!r}; give it a label.")
            if "," in label:
                raise InputError(
                    f"label '{label}' in plan '{self.name}' has a comma, which separates labels; leave it out."
                )
        _whole(f"runs of plan '{self.name}'", self.runs, _MOST_RUNS)
        for label, on in self.problems.items():
            where = f"of problem '{label}' in plan '{self.name}'"
            for name in ("trials", "initial", "requeries"):
                _whole(f"{name} {where}", getattr(on, name), _MOST_TRIALS)
            if on.initial > on.trials:
                raise InputError(f"initial {where} is {on.initial}, but trials is {on.trials}; give at most as many.")
            if on.input_noise not in (None, "own") and not 0.0 < float(on.input_noise) < 1.0:
                raise InputError(f"input_noise {where} is {on.input_noise!r}; give a share of the box, such as 0.03.")
            if not 0.0 <= on.observation_noise < float("inf"):
                raise InputError(f"observation_noise {where} is {on.observation_noise!r}; give 0 or more.")
            for name, by in self.methods.items():
                if by.robust and on.input_noise is None:
                    raise InputError(f"method '{name}' is robust, but input_noise {where} is missing; give it.")

    def cells(self, only: Iterable[str] = ()) -> list[Cell]:
        """Return every problem with every method; with `only`, of the problems and methods with these labels.

        Raises
        ------
        InputError
            For a label that is neither a problem nor a method.
        """
        wanted = set(only)
        for label in wanted:
            if label not in self.problems and label not in self.methods:
                raise unknown_name(f"problem or method of plan '{self.name}'", label, [*self.problems, *self.methods])
        problems = [label for label in self.problems if label in wanted] or list(self.problems)
        methods = [label for label in self.methods if label in wanted] or list(self.methods)
        return [Cell(p, m, self.problems[p], self.methods[m]) for p in problems for m in methods]

    def tasks(self, runs: int | None = None, shard: tuple[int, int] = (1, 1), only: Iterable[str] = ()) -> list[Task]:
        """Return the runs in the order they are made: seed by seed, so that all cells grow alike.

        Parameters
        ----------
        runs
            Number of seeds; the plan's if None.
        shard
            (i, n): the i-th of n shares, by seed, so that paired runs stay together.
        only
            Labels of problems and methods, see `cells`.

        Raises
        ------
        InputError
            For fewer than one run, or a share that does not exist.
        """
        count = _whole("runs", self.runs if runs is None else runs, _MOST_RUNS)
        i, n = shard
        if not 1 <= i <= n:
            raise InputError(f"shard is {i}/{n}; give i/n with i from 1 to n, such as 2/8.")
        cells = self.cells(only)
        return [Task(cell, seed) for seed in range(i - 1, count, n) for cell in cells]


def share_of(text: str) -> tuple[int, int]:
    """Return (i, n) of a share written "i/n".

    Raises
    ------
    InputError
        If the text has another form, or i is not between 1 and n.

    Examples
    --------
    >>> share_of("2/8")
    (2, 8)
    """
    first, slash, second = text.partition("/")
    try:
        if not slash:
            raise ValueError
        i, n = int(first), int(second)
    except ValueError:
        raise InputError(f"shard {text!r} is not of the form i/n; write for example --shard 2/8.") from None
    if not 1 <= i <= n:
        raise InputError(f"shard is {i}/{n}; give i/n with i from 1 to n, such as 2/8.")
    return i, n


def _source(function: str) -> dict[str, str]:
    """Return a fingerprint of the file of one's own function: of another text the runs are not these."""
    place = Path(function.rpartition(":")[0])
    if place.suffix != ".py":
        return {}
    try:
        return {"function_file": hashlib.sha256(place.read_bytes()).hexdigest()[:12]}
    except OSError:  # where the function is loaded it is told what is wrong with the file
        return {}


def _plain(value: Any) -> Any:
    return "inf" if value == float("inf") else value  # JSON has no infinity


def _whole(name: str, value: Any, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise InputError(f"{name} is {str(value)[:60]}; give a whole number from 1 to {most:,}.")
    return value

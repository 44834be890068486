"""What the workers of a study try: the problem that is written into the study, or a function of the user's own."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from surehold.errors import InputError
from surehold.optimization.evaluation import evaluate
from surehold.problems.function import exit_in_words
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings

__all__ = ["Outcome", "problem_of", "trial_function"]


class Outcome(NamedTuple):
    """What came of a trial."""

    value: float
    """NaN where it failed"""
    failure: str
    """why it failed, empty where it did not"""
    outputs: Mapping[str, Any] = {}
    """further outputs"""


def trial_function(f: Callable[[Any], Any], space: SearchSpace) -> Callable[[Mapping[str, Any]], Outcome]:
    """Return what makes one trial from its parameters; it never raises.

    f takes the numbers x (d,) in the order of the parameters; where a parameter is logarithmic, a whole number, in
    steps or a choice, it takes the parameters {name: value} instead, as from `surehold.maximize`.
    """
    named = space.box is None or not space.box.plain

    def attempt(parameters: Mapping[str, Any]) -> Outcome:
        try:
            if named:
                return Outcome(*evaluate(lambda _: f(dict(parameters)), np.empty(0)))
            return Outcome(*evaluate(f, np.array([parameters[n] for n in space.distributions], dtype=np.float64)))
        except InputError as error:  # cannot be called at all
            return Outcome(np.nan, str(error))
        except SystemExit as end:  # it would end the worker, and each one that takes the trial up
            return Outcome(np.nan, exit_in_words(end))

    return attempt


def problem_of(settings: StudySettings, function: str = "") -> Callable[[Any], Any]:
    """Return the problem that is written into a study, or the function named instead.

    Raises
    ------
    InputError
        If there is neither, or it cannot be loaded.
    """
    from surehold.problems import load_function
    from surehold.problems.named import named_function

    if function:
        return load_function(function)
    described = dict(settings.problem)
    if "function" in described:
        place = described["function"].rpartition(":")[0]
        if place.endswith(".py") and not Path(place).exists():
            raise InputError(
                f"the study's function was in {place!r}, which does not exist; where its folder was moved, say where "
                "it is now: --function path/file.py:function."
            )
        return load_function(described["function"])
    if "synthetic" in described:
        return named_function(described["synthetic"])
    if "grasp" in described:
        from surehold.problems.grasp.description import described_grasp

        # Older studies do not name the simulator's preset; theirs was the optimizer's.
        before = "thesis" if settings.optimizer.get("preset") == "thesis" else ""
        return described_grasp({"preset": before, **described["grasp"]})
    raise InputError(
        "the study says nothing about what its trials are; a robot makes them (surehold study ask, tell), or give "
        "--function package.module:function."
    )

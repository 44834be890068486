"""The columns in which the trials of a study are exported: what became of each, its parameters, what was reached."""

from typing import NamedTuple

from surehold.errors import InputError
from surehold.optimization.limits import limits_of
from surehold.studies.settings import StudySettings

__all__ = ["ExportColumns", "check_columns", "columns_of"]


class ExportColumns(NamedTuple):
    """Names of columns, in their order."""

    outcome: list[str]
    """id, state, value, and of a study about success of how many executions"""
    outputs: dict[str, str]
    """of each further output"""
    parameters: dict[str, str]
    reached: dict[str, str]
    """of each parameter, what was truly reached"""
    making: list[str]
    """when, by whom, and a note"""

    @property
    def all(self) -> list[str]:
        """Return all columns."""
        return [*self.outcome, *self.outputs.values(), *self.parameters.values(), *self.reached.values(), *self.making]


def columns_of(settings: StudySettings) -> ExportColumns:
    """Return the columns of a study.

    A parameter of an older study that is named as a column of its results, which `check_columns` refuses now, has
    "parameter_" before its own.
    """
    found = _named(settings)
    names = found.all
    for name in found.parameters:
        while names.count(found.parameters[name]) > 1:
            found.parameters[name] = f"parameter_{found.parameters[name]}"
            names = found.all
    return found


def check_columns(settings: StudySettings) -> None:
    """Raise InputError where a parameter has the name of a column of the results, which would be lost."""
    found = _named(settings)
    names = found.all
    for name in found.parameters:
        if names.count(name) > 1:
            own = ", ".join((*found.outcome, *found.outputs.values(), *found.making))
            raise InputError(
                f"parameter '{name}' has the name of a column of the study's export, whose own are {own}, and "
                "reached_NAME of each parameter; choose another name."
            )


def _named(settings: StudySettings) -> ExportColumns:
    """Return the columns, each parameter under its own name."""
    names = list(settings.space.distributions)
    of = ["of"] if settings.optimizer.get("outcome") == "success" else []
    return ExportColumns(
        ["id", "state", "value", *of],
        {limit.name: f"output_{limit.name}" for limit in limits_of(settings.optimizer.get("constraints"))},
        {name: name for name in names},
        {name: f"reached_{name}" for name in names},
        ["begun", "finished", "worker", "note"],
    )

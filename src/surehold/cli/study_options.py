"""What the commands of `surehold study` share."""

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from surehold.studies.robot import RobotStudy

__all__ = ["Json", "Name", "Storage", "opened", "quiet", "say"]

Name = Annotated[str, typer.Argument(help="Name of the study.")]
Storage = Annotated[
    str,
    typer.Option(
        envvar="SUREHOLD_STORAGE",
        help="A journal file, sqlite:///file.db or postgresql://user@host/database; by default runs/NAME/journal.log.",
        show_default=False,
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Answer in JSON, one object.")]


def opened(name: str, storage: str) -> "RobotStudy":
    """Return a study that exists; what goes wrong with it raises InputError."""
    from surehold.studies.robot import RobotStudy

    quiet()
    return RobotStudy.open(name, storage)


def quiet() -> None:
    """Let Optuna speak of nothing but what is wrong."""
    from optuna import logging

    logging.set_verbosity(logging.WARNING)


def say(found: dict[str, Any], text: str, as_json: bool) -> None:
    """Print what was found as JSON or as text."""
    typer.echo(json.dumps(found, allow_nan=False) if as_json else text)

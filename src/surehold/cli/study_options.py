"""What the commands of `surehold study` share."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

if TYPE_CHECKING:
    from surehold.studies.robot import RobotStudy

__all__ = ["Json", "Name", "Outputs", "Storage", "nothing_said", "opened", "quiet", "say", "write_out"]

Name = Annotated[str, typer.Argument(help="Name of the study.")]
Storage = Annotated[
    str,
    typer.Option(
        envvar="SUREHOLD_STORAGE",
        help="A journal file, sqlite:///file.db or postgresql://user@host/database; by default runs/NAME/journal.log.",
        show_default=False,
    ),
]
Outputs = Annotated[
    str,
    typer.Option(
        help="Further outputs, NAME=VALUE,...; none as the value of one that could not be measured.", show_default=False
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Answer in JSON, one object.")]


_UNHEARD: Final = "the answer cannot be written ({}); what was stored before is kept, see: surehold study status."


def opened(name: str, storage: str) -> "RobotStudy":
    """Return a study that exists; what goes wrong with it raises InputError."""
    from surehold.studies.robot import RobotStudy

    quiet()
    return RobotStudy.open(name, storage)


@contextmanager
def nothing_said(as_json: bool) -> Iterator[None]:
    """Print as JSON as well why no trial is handed out in the block."""
    from surehold.studies.robot import NothingToAsk

    try:
        yield
    except NothingToAsk as nothing:
        if as_json:
            state = "paused" if nothing.paused else "stopped"
            write_out(json.dumps({"id": None, "state": state, "reason": str(nothing)}) + "\n")
        raise


def quiet() -> None:
    """Let Optuna speak of nothing but what is wrong."""
    from optuna import logging

    logging.set_verbosity(logging.WARNING)


def say(found: dict[str, Any], text: str, as_json: bool) -> None:
    """Print what was found as JSON or as text.

    Raises
    ------
    SureholdError
        If it cannot be written; what was stored before stays stored.
    """
    write_out((json.dumps(found, allow_nan=False) if as_json else text) + "\n")


def write_out(text: str) -> None:
    """Write text to the standard output, whole; raises SureholdError where that cannot be."""
    from surehold.cli.terminal import speak_plainly
    from surehold.errors import SureholdError

    if sys.stdout is None:  # closed before the start, by >&-
        raise SureholdError(_UNHEARD.format("the standard output is closed"))
    speak_plainly()
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as error:
        with suppress(OSError):  # or Python complains when it flushes at exit
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SureholdError(_UNHEARD.format(error.strerror or error)) from None

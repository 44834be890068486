"""The command line: commands, progress and tables; no logic of its own."""

import sys
import warnings
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

__all__ = ["completed", "main"]

_PACKAGE: Final = Path(__file__).parents[1]
_of_python: Final = warnings.showwarning


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit.

    0: done; 1: nothing came of it; 2: bad input; 3: nothing found that succeeds; 130: interrupted with nothing to keep.
    Every expected error is one line on the standard error stream, and so is every warning of surehold.
    """
    warnings.showwarning = _warn
    sys.exit(run(sys.argv[1:] if arguments is None else list(arguments)))


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit code."""
    from surehold.errors import InputError, SureholdError
    from surehold.extras import require

    try:
        require("cli", "the command line")
        return _run(arguments)
    except InputError as error:
        _say(str(error))
        return 2
    except SureholdError as error:
        _say(str(error))
        return 1
    except KeyboardInterrupt:
        return _interrupted()


def _run(arguments: list[str]) -> int:
    import typer
    from typer import exceptions

    from surehold.cli.application import application

    _refuse_empty(arguments)
    try:
        code = typer.main.get_command(application())(
            args=completed(arguments), prog_name="surehold", standalone_mode=False
        )
        if code == 130:  # what typer makes of Ctrl-C
            return _interrupted()
        return code if isinstance(code, int) else 0
    except typer.Exit as end:
        return end.exit_code
    except exceptions.TyperException as error:
        message = _in_words(error)
        if type(error).__name__ == "NoArgsIsHelpError":  # of a group alone; typer keeps the class to itself
            typer.echo(message)
            return 0
        command = getattr(getattr(error, "ctx", None), "command_path", "surehold")
        _say(f"{message.rstrip('.')}{'' if message.endswith('?') else '.'} See {command} --help.")
        return int(getattr(error, "exit_code", 2))
    except typer.Abort:
        return _interrupted()


def _refuse_empty(arguments: list[str]) -> None:
    """Raise InputError where an option is given an empty text, as by a variable of the shell that is not set.

    It would count as not given: the run is kept in no study, another model is taken.
    """
    from surehold.errors import InputError

    pairs = [*pairwise(arguments), *(argument.partition("=")[::2] for argument in arguments if "=" in argument)]
    for option, value in pairs:
        if option.startswith("--") and option != "--" and not value.strip():
            raise InputError(f"option {option} is given an empty text; give a value, or leave the option out.")


def _in_words(error: Exception) -> str:
    """Return what typer says of a mistake; of a text that is no number it says neither the text nor plainly why."""
    format_message = getattr(error, "format_message", None)
    message = format_message() if format_message else str(error)
    found = getattr(error.__cause__, "errors", list)()  # of Pydantic
    kind, given = (found[0].get("type", ""), found[0].get("input")) if found else ("", "")
    number = {"int": "whole number", "float": "number"}.get(kind.partition("_")[0])
    if number and ": Input should be" in message:
        return f"{message.partition(': Input should be')[0]}: {str(given)[:60]!r} is no {number}"
    return message


def completed(arguments: list[str]) -> list[str]:
    """Return arguments in which `--check` of a grasp has its number, 20 where none is given: typer wants one."""
    if arguments[:1] != ["grasp"] or arguments[1:2] == ["rate"] or "--check" not in arguments:
        return arguments
    after = arguments.index("--check") + 1
    alone = not arguments[after : after + 1] or not arguments[after].lstrip("-").isdigit()
    return [*arguments[:after], "20", *arguments[after:]] if alone else arguments


def _interrupted() -> int:
    _say("interrupted; what was finished before is kept.")
    return 130


def _warn(message: Warning | str, category: type[Warning], filename: str, lineno: int, *more: Any) -> None:
    """Show a warning: of surehold's the text alone, for its place says nothing to a user; of other code also that."""
    if _PACKAGE in Path(filename).parents and category is UserWarning:
        print(f"warning: {' '.join(str(message).split())}", file=sys.stderr)  # noqa: T201
    else:
        _of_python(message, category, filename, lineno, *more)


def _say(message: str) -> None:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)  # noqa: T201

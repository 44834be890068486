"""Options that several commands share, and how their text is read."""

from typing import Annotated

import typer

from surehold.errors import InputError, unknown_name
from surehold.optimization.noise.input_noise import InputNoise

__all__ = [
    "METHODS",
    "Initial",
    "Method",
    "Noise",
    "Open",
    "Out",
    "Preset",
    "Seed",
    "Study",
    "StudyStorage",
    "Trials",
    "checked_method",
    "noise_of",
]

METHODS = {
    "ubo": "knows the input noise and looks for what holds",
    "bo": "plain Bayesian optimization; the noise only scores its answer",
}

Method = Annotated[str, typer.Option(help="ubo: knows the input noise; bo: plain Bayesian optimization.")]
Seed = Annotated[int, typer.Option(help="Same seed, same run.")]
Out = Annotated[
    str,
    typer.Option(
        help="Folder for the results, written over; by default a new one, runs/NAME-METHOD-seedN.", show_default=False
    ),
]
Open = Annotated[bool, typer.Option("--open", help="Open the report in the browser at the end.")]
Preset = Annotated[str, typer.Option(help="Settings by name, such as thesis.", show_default=False)]
Study = Annotated[
    str,
    typer.Option(help="Keep the run as a study of this name, and resume it where it exists.", show_default=False),
]
StudyStorage = Annotated[
    str,
    typer.Option(
        "--storage",
        help="Of the study: a journal file, sqlite:///file.db or postgresql://user@host/database; by default "
        "SUREHOLD_STORAGE, or runs/STUDY/journal.log.",
        show_default=False,
    ),
]
Trials = Annotated[int | None, typer.Option(help="Number of trials, the initial ones included.")]
Initial = Annotated[int | None, typer.Option(help="Number of trials of the initial design.")]
Noise = Annotated[
    str | None,
    typer.Option(
        help="Input noise: a share of every range (0.03), or NAME=DEVIATION,... in the variables' units, or none."
    ),
]


def checked_method(method: str) -> str:
    """Return the method, or raise InputError with the valid ones."""
    if method not in METHODS:
        raise unknown_name("method", method, METHODS)
    return method


def noise_of(text: str, method: str) -> InputNoise | None:
    """Return the input noise that `--noise` describes.

    Raises
    ------
    InputError
        If the text is neither a number, NAME=DEVIATION pairs nor "none", or method ubo is left without noise.
    """
    if text.strip().lower() == "none":
        if method == "ubo":
            raise InputError("method 'ubo' needs input noise; give --noise, such as 0.03, or choose --method bo.")
        return None
    if "=" not in text:
        return InputNoise.unit(_number(text))
    deviations: dict[str, float] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name:
            raise InputError(f"--noise {text!r} is not of the form NAME=DEVIATION,NAME=DEVIATION, such as dx=0.003.")
        if name in deviations:
            raise InputError(f"--noise names {name!r} twice; give each variable once.")
        deviations[name] = _number(value)
    return InputNoise(deviations)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(
            f"--noise {text!r} is not a number; give a share of every range, such as 0.03, or NAME=DEVIATION pairs."
        ) from None

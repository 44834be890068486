"""Options that several commands share, and how their text is read."""

import math
from typing import Annotated, Any

import typer

from surehold.errors import InputError, unknown_name
from surehold.optimization.noise.input_noise import InputNoise

__all__ = [
    "METHODS",
    "REQUERIES",
    "Allowed",
    "Constraint",
    "Failures",
    "Feasible",
    "First",
    "Guess",
    "Initial",
    "Method",
    "Noise",
    "Open",
    "Out",
    "Preset",
    "Requeries",
    "RiskMeasure",
    "Safety",
    "Seed",
    "Study",
    "StudyStorage",
    "Surrogate",
    "Trials",
    "checked_method",
    "lasting",
    "limits_given",
    "noise_of",
    "numbers_given",
    "risk_of",
]

METHODS = {
    "ubo": "knows the input noise",
    "bo": "is plain Bayesian optimization",
}

Method = Annotated[str, typer.Option(help="ubo: knows the input noise; bo: plain Bayesian optimization.")]
Seed = Annotated[int, typer.Option(help="Same seed, same run.")]
Out = Annotated[
    str,
    typer.Option(help="Folder for the results, written over; by default one of its own in runs/.", show_default=False),
]
Open = Annotated[bool, typer.Option("--open", help="Open the report in the browser at the end.")]
Surrogate = Annotated[
    str,
    typer.Option(
        help="The model: two_scales (default), gp, tgp, local_global; with --outcome success: probit (default), "
        "beta_process.",
        show_default=False,
    ),
]
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
REQUERIES = 100  # perturbed re-queries of a point; they score and are no part of the budget
Requeries = Annotated[
    int, typer.Option(help="Executions with the noise of each point that is shown, after the trials; 0: none.")
]
Constraint = Annotated[
    list[str] | None,
    typer.Option(
        help="A limit of a further output, 'torque<=3' or '1<=torque<=3'; a name alone is recorded only. Repeatable.",
        show_default=False,
    ),
]
Allowed = Annotated[
    list[str] | None,
    typer.Option(help="What may be tried, a linear constraint: 'a + 2*b <= 3'. Repeatable.", show_default=False),
]
Failures = Annotated[
    str,
    typer.Option(
        help="What a failed trial teaches: modelled (where trials fail; default up to 200 trials) or lowest (it "
        "counts as the lowest value).",
        show_default=False,
    ),
]
Feasible = Annotated[
    float | None, typer.Option(help="Probability with which the answer keeps all constraints.", show_default=False)
]
Safety = Annotated[
    float | None,
    typer.Option(
        help="Probability with which every trial after the --first ones, which are trusted, keeps all constraints.",
        show_default=False,
    ),
]
First = Annotated[
    list[str] | None,
    typer.Option(help="To be tried first, NAME=VALUE,... of all variables. Repeatable.", show_default=False),
]
Guess = Annotated[
    str,
    typer.Option(
        help="Where the optimum may be, NAME=VALUE,... of some variables: two of three initial trials keep these.",
        show_default=False,
    ),
]
RiskMeasure = Annotated[
    str,
    typer.Option(
        "--risk",
        help="What is asked of the outcome under the noise: mean, mean-std, mean-variance, var, cvar or worst; with a "
        "parameter cvar=0.05 (share of worst outcomes) or mean-std=2.",
        show_default=False,
    ),
]
Noise = Annotated[
    str | None,
    typer.Option(
        help="Input noise: a share of every range (0.03), or NAME=DEVIATION,... in the variables' units; none with bo."
    ),
]


def lasting(storage: str) -> str:
    """Return the URL of a storage; raises InputError for that of a process, which no later command finds again."""
    if storage == "memory":
        raise InputError(
            "--storage memory is gone when this command ends; give a file, such as study.log or sqlite:///study.db."
        )
    return storage


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
        share = _number(text)
        if share == 0.0:
            raise InputError("--noise 0 is no input noise; give what the input strays, such as 0.03, or none.")
        return InputNoise.unit(share)
    deviations: dict[str, float] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name:
            raise InputError(f"--noise {text!r} is not of the form NAME=DEVIATION,NAME=DEVIATION, such as dx=0.003.")
        if name in deviations:
            raise InputError(f"--noise names {name!r} twice; give each variable once.")
        deviations[name] = _number(value)
    return InputNoise(deviations)


def risk_of(text: str, method: str, preset: str = "", outcome: str = "value") -> Any:
    """Return the `Risk` that `--risk` describes, None where nothing is said.

    Raises InputError for an unknown measure, a wrong parameter, and beside what has no use for one: a method that knows
    no noise, a preset of the thesis, outcomes that are no values.
    """
    from surehold.optimization.acquisition.risk_measures import Risk

    if not text:
        return None
    risk = Risk.parse(text)
    if risk.name == "mean":
        return risk
    if method == "bo":
        raise InputError(
            f"--risk {text} is of the outcome under input noise, which method 'bo' does not know; use ubo."
        )
    if preset:
        raise InputError(
            f"--risk {text}: --preset {preset} chooses trials as the thesis does, by the mean; leave one out."
        )
    if outcome not in ("value", "quality"):
        raise InputError(f"--risk {text} is of values; with --outcome {outcome} the probability is what counts.")
    return risk


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(
            f"--noise {text!r} is not a number; give a share of every range, such as 0.03, or NAME=DEVIATION pairs."
        ) from None


def limits_given(
    constraint: list[str] | None,
    allowed: list[str] | None,
    feasible: float | None = None,
    failures: str = "",
    safety: float | None = None,
    first: list[str] | None = None,
    guess: str = "",
) -> dict[str, Any]:
    """Return the settings of an `Optimizer` that the options stand for, those that were not given left out.

    Raises InputError where a text is not understood, or an output is named twice.
    """
    from surehold.optimization.constraints.linear import Linear
    from surehold.optimization.limits import limits_of, parsed_limit

    limits: dict[str, Any] = {}
    for text in constraint or ():
        name, pair = parsed_limit(text)
        if name in limits:
            raise InputError(f"--constraint names {name!r} twice; give both limits at once, such as '1<={name}<=3'.")
        limits[name] = list(pair)
    limits_of(limits)
    for text in allowed or ():
        Linear.parse(text)
    given: dict[str, Any] = {"constraints": limits, "allowed": list(allowed or ()), "failures": failures}
    given["initial_points"] = [_values(text, "--first") for text in first or ()]
    given["guess"] = _values(guess, "--guess") if guess else {}
    shares = {"feasible": feasible, "safety": safety}  # of which 0 is refused
    return {k: v for k, v in given.items() if v} | {k: v for k, v in shares.items() if v is not None}


def _values(text: str, option: str) -> dict[str, float | str]:
    """Return {name: value} of an option NAME=VALUE,...; what is no number is a choice."""
    from surehold.studies.parameter_text import parse_assignments

    return {name: _number_or_choice(value) for name, value in parse_assignments(text, option).items()}


def _number_or_choice(text: str) -> float | str:
    """Return the number that a text is, and 2 as 2: a choice is found by its text, and 2.0 is another one."""
    try:
        number = float(text)
    except ValueError:
        return text
    if not math.isfinite(number):
        return text
    return int(number) if str(int(number)) == text else number


def numbers_given(text: str) -> dict[str, float | None] | None:
    """Return {name: value} of --constraints NAME=VALUE,...; None where there is none, None as the value of "none".

    Raises InputError for values that are no numbers.
    """
    from surehold.studies.parameter_text import parse_assignments

    if not text:
        return None
    try:
        given = parse_assignments(text, "--constraints")
        return {name: None if value.lower() == "none" else float(value) for name, value in given.items()}
    except InputError:
        raise
    except ValueError:
        raise InputError(f"--constraints {text!r} holds what is no number; write torque=3.1,force=none.") from None

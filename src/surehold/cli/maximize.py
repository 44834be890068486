"""`surehold maximize PROBLEM` and `surehold minimize PROBLEM`: a synthetic function or the user's own."""

from typing import Annotated, Any, NamedTuple

import typer

from surehold.cli.options import (
    REQUERIES,
    Allowed,
    Constraint,
    Failures,
    Feasible,
    First,
    Guess,
    Initial,
    Method,
    Noise,
    Open,
    Out,
    Preset,
    Requeries,
    RiskMeasure,
    Safety,
    Seed,
    Study,
    StudyStorage,
    Surrogate,
    Trials,
    checked_method,
    limits_given,
    noise_of,
    risk_of,
)

__all__ = ["maximize"]


class Defaults(NamedTuple):
    """What a problem is run with when the user says nothing."""

    trials: int
    initial: int | None
    """None: as the optimizer chooses"""
    noise: str


DEFAULTS = {
    "rkhs": Defaults(50, 5, "0.01"),
    "gm": Defaults(120, 30, "0.1"),
    "gf": Defaults(60, 20, "0.03"),
    "gf-stretched": Defaults(60, 20, "0.03"),
}
OWN = Defaults(60, None, "0.03")


def maximize(
    context: typer.Context,
    problem: Annotated[
        str,
        typer.Argument(
            help="rkhs, gm, needle-2, nes-polynomial, ...; package.module:function or path/file.py:function."
        ),
    ],
    bounds: Annotated[
        str,
        typer.Option(help="Bounds of your own function, NAME=LOWER:UPPER,...", show_default=False),
    ] = "",
    method: Method = "ubo",
    trials: Trials = None,
    initial: Initial = None,
    noise: Noise = None,
    risk: RiskMeasure = "",
    seed: Seed = 0,
    surrogate: Surrogate = "",
    preset: Preset = "",
    out: Out = "",
    study: Study = "",
    storage: StudyStorage = "",
    tolerate_failures: Annotated[
        bool,
        typer.Option("--tolerate-failures", help="Go on although the first three trials all failed; a --study does."),
    ] = False,
    constraint: Constraint = None,
    allowed: Allowed = None,
    feasible: Feasible = None,
    failures: Failures = "",
    safety: Safety = None,
    first: First = None,
    guess: Guess = "",
    outcome: Annotated[
        str, typer.Option(help="What a trial gives: value, or success (your function returns True or False).")
    ] = "value",
    requeries: Requeries = REQUERIES,
    open_report: Open = False,
) -> None:
    """Find a maximum that still holds when the input is off.

    The command `minimize` is this one, too: the name by which it is called says which.
    """
    checked_method(method)
    direction = context.info_name or "maximize"
    chosen = problem_of(problem, bounds)
    defaults = defaults_of(problem)
    noise_text = defaults.noise if noise is None else noise
    input_noise = own_noise(problem) if noise_text == "own" else noise_of(noise_text, method)
    asked = risk_of(risk, method, preset, outcome)
    if asked is None and method == "ubo" and not preset and outcome == "value":
        asked = own_risk(problem)

    from surehold.cli.session import NO_SUCCESS, Kept, folder_for, run_session
    from surehold.optimization.optimizer import Optimizer

    border = {"border": "clip"} if method == "ubo" and getattr(chosen, "clips", False) else {}
    kept = Kept(study, storage, {"function": problem} if ":" in problem else {"synthetic": problem})
    budget = defaults.trials if trials is None else trials
    start = initial
    if start is None:
        start = min(defaults.initial or Optimizer.default_n_initial(chosen.box), budget)
    limits = {
        "constraints": ", ".join(constraint or ()),
        "allowed": ", ".join(allowed or ()),
        "feasible": feasible,
        "failures": failures,
        "safety": safety,
        "first": "; ".join(first or ()),
        "guess": guess,
        "outcome": "" if outcome == "value" else outcome,
    }
    report = run_session(
        chosen,
        title=f"{direction.capitalize()} {chosen.name}",
        method=method,
        noise=input_noise,
        trials=budget,
        initial=start,
        seed=seed,
        preset=preset,
        folder=folder_for(chosen.name, method, seed, out, study),
        requeries=requeries,
        open_report=open_report,
        settings={
            "problem": problem,
            "bounds": bounds or None,
            "input noise": noise_text,
            "surrogate": surrogate or "default",
            **border,
            **{option: given for option, given in limits.items() if given not in ("", None)},
        },
        direction=direction,
        outcome=outcome,
        risk=asked,
        tolerate_failures=tolerate_failures,
        kept=kept,
        required=limits_given(constraint, allowed, feasible, failures, safety, first, guess)
        | ({"surrogate": surrogate} if surrogate else {})
        | border,
    )
    if not report.succeeded:
        raise typer.Exit(NO_SUCCESS)


def defaults_of(problem: str) -> Defaults:
    """Return the defaults of a problem: a robust one has its published budget, and its own noise."""
    from surehold.problems.named import has_own_noise, robust_problem

    if not has_own_noise(problem):
        return DEFAULTS.get(problem, OWN)
    robust = robust_problem(problem)
    return Defaults(robust.trials or OWN.trials, robust.initial or None, "none" if robust.noise is None else "own")


def own_noise(problem: str) -> Any:
    """Return the input noise that a robust problem states.

    Raises
    ------
    InputError
        If it states none.
    """
    from surehold.errors import InputError
    from surehold.problems.named import has_own_noise, robust_problem

    noise = robust_problem(problem).noise if has_own_noise(problem) else None
    if noise is None:
        raise InputError(f"problem '{problem}' states no input noise of its own; give --noise, such as 0.03.")
    return noise


def own_risk(problem: str) -> Any:
    """Return the measure of the outcome under input noise that a robust problem states; None where it states none."""
    from surehold.problems.named import has_own_noise, robust_problem

    robust = robust_problem(problem) if has_own_noise(problem) else None
    return None if robust is None or robust.noise is None else robust.measure


def problem_of(text: str, bounds: str) -> Any:
    """Return the function of that name, or the user's own function within its bounds.

    Raises
    ------
    InputError
        If the name or the reference is wrong, bounds are missing, or bounds are given for a synthetic function.
    """
    from surehold.errors import InputError
    from surehold.problems.function import Function, load_function, parse_bounds
    from surehold.problems.named import NAMES, named_function, unknown_function

    if ":" not in text:
        if text not in NAMES:
            raise unknown_function("problem", text)
        if bounds:
            raise InputError(f"problem '{text}' has its own bounds; leave --bounds out.")
        return named_function(text)
    if not bounds:
        raise InputError(f"--bounds are missing for {text!r}; give for example --bounds dx=-0.05:0.05,dy=0:1.")
    box = parse_bounds(bounds)
    return Function(load_function(text), box, text.rpartition(":")[2])

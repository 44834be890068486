"""`surehold study`: studies that survive, for robots in any language: every command can answer in JSON."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from surehold.amounts import amount
from surehold.cli import study_people, study_service
from surehold.cli.options import Allowed, Constraint, Failures, Feasible, First, Guess, RiskMeasure, Safety, Surrogate
from surehold.cli.study_options import Json, Name, Outputs, Storage, nothing_said, opened, quiet, say, write_out

__all__ = ["studies"]

_NOISE = "0.03"


def studies() -> typer.Typer:
    """Return the group of commands."""
    group = typer.Typer(
        help="Studies whose trials a robot, a person or workers make: stored, resumable, shared.",
        no_args_is_help=True,
        rich_markup_mode=None,
    )
    commands: list[tuple[str, Callable[..., Any]]] = [
        ("create", create),
        ("ask", ask),
        ("tell", tell),
        ("recommend", recommend),
        ("status", status),
        ("export", export),
        *study_people.commands(),
        *study_service.commands(),
    ]
    for name, command in commands:
        # A negative value is no option: tell NAME 3 -0.5
        settings = {"ignore_unknown_options": True} if name in ("tell", "add") else {}
        group.command(name, context_settings=settings)(command)
    return group


def create(
    name: Name,
    parameters: Annotated[
        str,
        typer.Option(
            help="dx=-0.05:0.05,force=0.1:100:log,fingers=2:5:int,turn=0:1:step=0.25,grip=pinch/power",
            show_default=False,
        ),
    ] = "",
    noise: Annotated[
        str | None,
        typer.Option(
            help=f"Input noise: a share of every range ({_NOISE} by default), or NAME=DEVIATION,... in their units, or "
            "none.",
            show_default=False,
        ),
    ] = None,
    units: Annotated[str, typer.Option(help="NAME=UNIT,..., such as dx=m,turn=rad.", show_default=False)] = "",
    problem: Annotated[
        str,
        typer.Option(
            help="What workers try: rkhs, gm, gf, gf-stretched, package.module:function or path/file.py:function.",
            show_default=False,
        ),
    ] = "",
    seed: Annotated[int, typer.Option(help="Same seed, same suggestions.")] = 0,
    initial: Annotated[int | None, typer.Option(help="Trials of the initial design.")] = None,
    surrogate: Surrogate = "",
    criterion: Annotated[str, typer.Option(help="As in surehold.Optimizer.", show_default=False)] = "",
    risk: RiskMeasure = "",
    border: Annotated[
        str,
        typer.Option(
            help="What executions do that would leave the box: extend (they leave it, the model is asked there; "
            "default), clip (they stop at the border) or keep (that parameter stays as commanded).",
            show_default=False,
        ),
    ] = "",
    observation_noise: Annotated[
        str, typer.Option(help="Of the values: none, inferred, heteroscedastic, or a standard deviation.")
    ] = "none",
    preset: Annotated[str, typer.Option(help="Settings by name, such as thesis.", show_default=False)] = "",
    direction: Annotated[str, typer.Option(help="Of the values: maximize or minimize.")] = "maximize",
    constraint: Constraint = None,
    allowed: Allowed = None,
    feasible: Feasible = None,
    failures: Failures = "",
    safety: Safety = None,
    first: First = None,
    guess: Guess = "",
    outcome: Annotated[
        str, typer.Option(help="Of a trial: value, or success (tell success, failure or 7/10).")
    ] = "value",
    storage: Storage = "",
    as_json: Json = False,
) -> None:
    """Create a study."""
    from surehold.cli.options import lasting, limits_given, noise_of, risk_of
    from surehold.errors import InputError
    from surehold.studies.parameter_text import parse_assignments
    from surehold.studies.robot import RobotStudy
    from surehold.studies.settings import StudySettings

    space, described = _space_of(parameters, problem)
    optimizer: dict[str, Any] = {"seed": seed}
    optimizer |= {} if initial is None else {"n_initial": initial}
    optimizer |= {} if outcome == "value" else {"outcome": outcome}
    asked = risk_of(risk, "ubo", preset, outcome)
    optimizer |= {} if asked is None or asked.name == "mean" else {"risk": asked}
    optimizer |= {} if observation_noise == "none" else {"noise": _number_or_word(observation_noise)}
    named = (("surrogate", surrogate), ("criterion", criterion), ("preset", preset), ("border", border))
    optimizer |= {k: v for k, v in named if v}
    optimizer |= limits_given(constraint, allowed, feasible, failures, safety, first, guess)
    input_noise = noise_of(_NOISE if noise is None else noise, "bo")
    if space.box is None or space.box.numbers is None:
        if input_noise is not None and noise is not None:
            raise InputError(f"--noise is {noise}, but all parameters are choices, which carry none; leave it out.")
        input_noise = None
    for option, given in (("risk", risk), ("border", border)):
        if input_noise is None and option in optimizer:
            raise InputError(f"--{option} {given} is of executions under input noise, and there is none; give --noise.")
    settings = StudySettings(
        space, input_noise, parse_assignments(units, "--units") if units else {}, optimizer, described, direction
    )
    quiet()
    study = RobotStudy.create(name, settings, lasting(storage))
    found = {"name": name, "storage": study.storage.shown, **settings.to_json()}
    say(found, f"Created study {name} in {study.storage.shown}: {', '.join(space.distributions)}.", as_json)


def ask(
    name: Name,
    worker: Annotated[
        str, typer.Option(help="Who makes the trial; asked again before it was told, that one gets the same trial.")
    ] = "",
    storage: Storage = "",
    as_json: Json = False,
) -> None:
    """Hand out the next trial: its id and parameters."""
    study = opened(name, storage)
    with nothing_said(as_json):
        asked = study.ask(worker or None)
    found = {"id": asked.id, "parameters": asked.parameters, "units": asked.units, "again": asked.again}
    found |= {} if asked.pose is None else {"pose": asked.pose}
    lines = [f"trial {asked.id}{' (handed out again)' * asked.again}"]
    lines += [f"  {key} = {value} {asked.units.get(key, '')}".rstrip() for key, value in asked.parameters.items()]
    say(found, "\n".join(lines), as_json)


def tell(
    name: Name,
    id: Annotated[int, typer.Argument(help="Of the trial, as ask printed it.")],
    value: Annotated[
        str | None,
        typer.Argument(help="Outcome: a number; or success, failure, or 7/10.", show_default=False),
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="The trial gave nothing.")] = False,
    rig: Annotated[
        bool, typer.Option("--rig", help="The rig failed, not the place: nothing is learnt, it is asked for again.")
    ] = False,
    reached: Annotated[
        str, typer.Option(help="What was truly reached, where it differs: NAME=VALUE,...", show_default=False)
    ] = "",
    constraints: Outputs = "",
    contacts: Annotated[
        str,
        typer.Option(
            help="JSON file, {contacts: [{point, normal}, ..]} in the object's frame [m]: what the hand touched, of a "
            "study made by explore --study.",
            show_default=False,
        ),
    ] = "",
    storage: Storage = "",
    as_json: Json = False,
) -> None:
    """Tell what came of a trial; the same answer twice is harmless, another one is refused."""
    from surehold.cli.options import numbers_given
    from surehold.errors import InputError
    from surehold.studies.parameter_text import parse_assignments

    if failed and rig:
        raise InputError(
            "--failed says that the place gave nothing, --rig that it is not at fault; give one of the two."
        )
    places = parse_assignments(reached, "--reached") if reached else None
    outputs = numbers_given(constraints)
    touched = None
    if contacts:
        from surehold.problems.grasp.told_contacts import contact_rows

        touched = contact_rows(contacts)
    study = opened(name, storage)
    told = study.tell(id, value, failed="rig" if rig else failed, reached=places, constraints=outputs, contacts=touched)
    outcome = told.state if told.value is None else f"value {told.value!r}"
    outcome += f" of {told.of} executions" * (told.of > 1)
    found = {"id": told.id, "state": told.state, "value": told.value, "already": told.already, "of": told.of}
    say(found, f"trial {told.id}: {outcome}{', as told before' * told.already}", as_json)


def recommend(name: Name, storage: Storage = "", as_json: Json = False) -> None:
    """Recommend the trial that still holds when the input is off, and note it in the study."""
    from surehold.optimization.recommendation import outliers_in_words, outside_in_words

    study = opened(name, storage)
    best = study.recommend()
    lines = [f"trial {best.trial}: expect {best.expected}"]
    units = study.settings.units
    lines += [f"  {key} = {value} {units.get(key, '')}".rstrip() for key, value in best.parameters.items()]
    lines += [f"  expected {key} {value:.4g}" for key, value in best.outputs.items()]
    lines += [f"{best.feasible:.1%} of executions keep all constraints"] if study.sampler.outputs else []
    said = (
        best.infeasible,
        best.refused,
        outside_in_words(best.outside),
        outliers_in_words(best.outliers),
        best.warning,
    )
    lines += filter(None, said)
    say(best.as_dict() | {"units": dict(units)}, "\n".join(lines), as_json)


def status(name: Name, storage: Storage = "", as_json: Json = False) -> None:
    """Show the state of a study, and the trials under way."""
    from surehold.studies.status import status as status_of

    found = status_of(opened(name, storage))
    lines = [
        f"study {name} in {found['storage']}: {found['state']}{' - ' * bool(found['reason'])}{found['reason']}",
        f"  {amount(found['trials'], 'trial')}: {found['complete']} complete, {found['failed']} failed, "
        f"{found['running']} running, {found['waiting']} waiting",
    ]
    if found["best_value"] is not None:
        extreme = "highest" if found["direction"] == "maximize" else "lowest"
        lines.append(f"  {extreme} value {found['best_value']:.6g} (trial {found['best_trial']})")
    for pending in found["pending"]:
        age = "" if pending["seconds"] is None else f", {pending['seconds']:.0f} s"
        who = f", {pending['worker']}" if pending["worker"] else ""
        lines.append(
            f"  trial {pending['id']} {pending['state']}{age}{who}{', dead' * (pending['worker_alive'] is False)}"
        )
    say(found, "\n".join(lines), as_json)


def export(
    name: Name,
    out: Annotated[str, typer.Option(help="File to write; by default the standard output.", show_default=False)] = "",
    storage: Storage = "",
    as_json: Json = False,
) -> None:
    """Write all trials as CSV, or with --json as JSON with the settings."""
    from surehold.store.atomic import write_file
    from surehold.studies.status import to_csv, to_json

    study = opened(name, storage)
    text = to_json(study) if as_json else to_csv(study)
    if out:
        write_file(Path(out), text)
    else:
        write_out(text)


def _space_of(parameters: str, problem: str) -> tuple[Any, dict[str, Any]]:
    """Return the search space, and the description of what workers try."""
    from surehold.errors import InputError
    from surehold.problems import load_function
    from surehold.problems.named import NAMES, named_function, unknown_function
    from surehold.studies.parameter_text import parse_search_space
    from surehold.studies.search_space import SearchSpace

    if problem and ":" not in problem:
        if problem not in NAMES:
            raise unknown_function("problem", problem)
        if parameters:
            raise InputError(f"problem '{problem}' has its own parameters; leave --parameters out.")
        return SearchSpace(named_function(problem).box), {"synthetic": problem}
    if not parameters:
        raise InputError("--parameters are missing; give for example --parameters dx=-0.05:0.05,dy=0:1.")
    if problem:
        load_function(problem)
    return parse_search_space(parameters), {"function": problem} if problem else {}


def _number_or_word(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text

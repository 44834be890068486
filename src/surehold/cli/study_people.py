"""People in the loop: look ahead, veto, add, pause, resume, set a stop rule, bring earlier trials along."""

import time
from collections.abc import Callable
from typing import Annotated, Any, Final

import typer

from surehold.amounts import amount
from surehold.cli.study_options import Json, Name, Outputs, Storage, nothing_said, opened, say
from surehold.errors import InputError

__all__ = ["commands"]

_SHOWN: Final = 10  # trials that a line names

Id = Annotated[int, typer.Argument(help="Of the trial, as ask printed it.")]
Reason = Annotated[str, typer.Option(help="Why; shown to whoever asks.", show_default=False)]


def commands() -> list[tuple[str, Callable[..., Any]]]:
    """Return the commands by name."""
    return [
        ("next", next_trial),
        ("veto", veto),
        ("add", add),
        ("pause", pause),
        ("resume", resume),
        ("stop", stop),
        ("import", import_trials),
    ]


def next_trial(name: Name, storage: Storage = "", as_json: Json = False) -> None:
    """Show what would be asked next, and what it promises, without asking."""
    study = opened(name, storage)
    with nothing_said(as_json):
        parameters, promise = study.next(), study.promise()
    lines = [
        "next:",
        *(f"  {key} = {value} {study.settings.units.get(key, '')}".rstrip() for key, value in parameters.items()),
    ]
    if promise is not None:
        lines.append(f"expected improvement under the input noise: {promise:.3g}")
    say({"parameters": parameters, "expected_improvement": promise}, "\n".join(lines), as_json)


def veto(name: Name, id: Id, reason: Reason = "", storage: Storage = "", as_json: Json = False) -> None:
    """Forbid a trial that was handed out; the model avoids it as it does a failed one."""
    opened(name, storage).veto(id, reason)
    say({"id": id, "state": "vetoed"}, f"trial {id}: vetoed", as_json)


def add(
    name: Name,
    at: Annotated[str, typer.Option(help="Where the trial was made: NAME=VALUE,... for every parameter.")],
    value: Annotated[
        str | None, typer.Argument(help="Outcome: a number; or success, failure, or 7/10.", show_default=False)
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="The trial gave nothing.")] = False,
    constraints: Outputs = "",
    storage: Storage = "",
    as_json: Json = False,
) -> None:
    """Add a trial that was made by hand."""
    from surehold.cli.options import numbers_given
    from surehold.studies.parameter_text import parse_assignments

    outputs = numbers_given(constraints)
    id = opened(name, storage).add(parse_assignments(at, "--at"), value, failed=failed, constraints=outputs)
    say({"id": id}, f"trial {id}: added", as_json)


def pause(name: Name, reason: Reason = "", storage: Storage = "", as_json: Json = False) -> None:
    """Hand out nothing until `resume`; trials under way can be told."""
    opened(name, storage).pause(reason)
    say({"name": name, "state": "paused"}, f"study {name}: paused", as_json)


def resume(name: Name, storage: Storage = "", as_json: Json = False) -> None:
    """Hand out trials again after `pause`."""
    opened(name, storage).resume()
    say({"name": name, "state": "open"}, f"study {name}: open", as_json)


def stop(
    name: Name,
    trials: Annotated[int | None, typer.Option(help="After so many trials in all.")] = None,
    hours: Annotated[float | None, typer.Option(help="After so many hours from now.")] = None,
    improvement: Annotated[
        float | None, typer.Option(help="When no trial promises such an improvement under the input noise ...")
    ] = None,
    asks: Annotated[
        int | None, typer.Option(help="... so many times in a row; 3 by default.", show_default=False)
    ] = None,
    storage: Storage = "",
    as_json: Json = False,
) -> None:
    """Set when asking ends, in place of what was set before; without options it never does."""
    from surehold.studies.stop_rule import StopRule

    study = opened(name, storage)
    if hours is not None and not 0.0 < hours < 1e6:
        raise InputError(f"--hours is {hours:g}; give a number above 0, such as 8.")
    if asks is not None and improvement is None:
        raise InputError(f"--asks {asks} is how often trials promise less than --improvement; give that, too.")
    until = None if hours is None else time.time() + 3600.0 * hours
    study.set_stop_rule(StopRule(trials, until, improvement, **({} if asks is None else {"asks": asks})))
    reason = study.stopped()
    found = {"name": name, "stop_rule": study.stop_rule.as_dict(), "stopped": bool(reason), "reason": reason}
    say(found, f"study {name}: {'stopped, ' + reason if reason else f'open, {study.stop_rule}'}", as_json)


def import_trials(
    name: Name,
    file: Annotated[str, typer.Argument(help="A CSV file with a header.", show_default=False)] = "",
    study: Annotated[str, typer.Option("--study", help="Or another study, by its name ...", show_default=False)] = "",
    source: Annotated[
        str, typer.Option("--from", help="... in this storage; by default runs/STUDY/journal.log.", show_default=False)
    ] = "",
    columns: Annotated[
        str, typer.Option(help="PARAMETER=COLUMN,... for those named differently.", show_default=False)
    ] = "",
    value: Annotated[str, typer.Option(help="Column of the value.")] = "value",
    skip_bad: Annotated[bool, typer.Option("--skip-bad", help="Leave rows out that do not fit.")] = False,
    storage: Storage = "",
    as_json: Json = False,
) -> None:
    """Take trials over that were made before, from a CSV file or another study; each is taken once."""
    from surehold.errors import InputError, unknown_name
    from surehold.studies import warm_start
    from surehold.studies.choice_cells import ChoiceCells
    from surehold.studies.parameter_text import parse_assignments

    if bool(file) == bool(study):
        raise InputError("give either a CSV file or --study NAME to take trials over from.")
    target = opened(name, storage)
    names = {parameter: parameter for parameter in target.settings.space.distributions}
    for parameter, column in (parse_assignments(columns, "--columns") if columns else {}).items():
        if parameter not in names:
            raise unknown_name("parameter", parameter, names)
        names[parameter] = column
    outputs = [limit.name for limit in target.limits]
    if file:
        found = warm_start.trials_of_csv(file, names, value, outputs, ChoiceCells(target.settings.space).read)
    else:
        former = warm_start.former_study(study, source, target)
        found = warm_start.trials_of_study(former, names, target.settings.direction, outputs)
    made = warm_start.import_trials(target, found, skip_bad=skip_bad)
    count = made.values + len(made.failed)
    lines = [f"{amount(count, 'trial')} imported into {name}"]
    if count:
        lines[0] += f": {made.values} with a value"
    if made.failed:
        lines[0] += f", {len(made.failed)} failed: {_first(made.failed)}"
    if made.already:
        lines.append(f"imported before and not again: {len(made.already)} ({_first(made.already)})")
    lines += [f"left out: {why}" for why in made.left_out]
    answer = {
        "imported": count,
        "values": made.values,
        "failed": made.failed,
        "already": made.already,
        "left_out": made.left_out,
    }
    say(answer, "\n".join(lines), as_json)


def _first(texts: list[str]) -> str:
    """Return texts in one line, many of them cut short."""
    more = len(texts) - _SHOWN
    return ", ".join(texts[:_SHOWN]) + (f", and {more} more (--json names all)" if more > 0 else "")

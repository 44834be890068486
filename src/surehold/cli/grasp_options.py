"""Options that say what is grasped and with which hand: those of `GraspOptions`, for the commands that grasp."""

from collections.abc import Callable
from inspect import Parameter, signature
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

__all__ = ["object_of", "shown_progress", "takes_grasp_options"]


def takes_grasp_options(command: Callable[..., None], without: tuple[str, ...] = ()) -> Callable[..., None]:
    """Let a command that takes `**options` take each option of a grasp, but those it names itself and `without`."""
    from surehold.problems.grasp.options import OPTIONS

    first, *others, _ = signature(command).parameters.values()
    own = {"object", *without, *(parameter.name for parameter in others)}
    added = []
    for name, option in OPTIONS.items():
        if name in own or option.text is None:
            continue
        kind: Any = str if option.text is list else option.text
        default = ",".join(option.default) if option.text is list else option.default
        hint = Annotated[
            kind | None if default is None else kind, typer.Option(help=option.help, show_default=bool(default))
        ]
        added.append(Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=hint))
    known = [parameter.replace(kind=Parameter.KEYWORD_ONLY) for parameter in others]
    command.__signature__ = signature(command).replace(parameters=[first, *added, *known])  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in (first, *added, *known)}
    return command


def object_of(described: dict[str, Any], console: Console) -> Any:
    """Return the object of a description; of a file the diagnosis is said and the distances are computed.

    Raises
    ------
    InputError
        If the file is refused, or options of a mesh are given for a shipped object.
    """
    from surehold.problems.grasp.description import described_object

    body, diagnosis = described_object(described)
    if body.distances is not None:
        console.print(diagnosis, markup=False, soft_wrap=True)
    elif diagnosis:
        from surehold.grasping.object.distance_field import distance_field_of

        console.print(diagnosis, markup=False, soft_wrap=True)
        with shown_progress("distances to the mesh", console) as progress:
            distance_field_of(body, progress=progress)  # from now on it is in the cache
    return body


class shown_progress:  # used as a function
    """Show a bar while something takes long; the value of the context takes the share that is done."""

    def __init__(self, what: str, console: Console):
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=console, transient=True)
        self._what, self._task = what, None

    def __enter__(self) -> Callable[[float], None]:
        return self._show

    def _show(self, share: float) -> None:
        if not self._progress.console.is_terminal:
            return
        if self._task is None:  # nothing is shown of what is in the cache
            self._progress.start()
            self._task = self._progress.add_task(self._what, total=1.0)
        self._progress.update(self._task, completed=share)

    def __exit__(self, *error: object) -> None:
        if self._task is not None:
            self._progress.stop()

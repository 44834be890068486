"""What runs beside a study: workers, the HTTP service, the dashboard, the report, a server for language models."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from surehold.amounts import amount
from surehold.cli.study_options import Name, Storage, opened

__all__ = ["commands"]


def commands() -> list[tuple[str, Callable[..., Any]]]:
    """Return the commands by name."""
    return [("work", work), ("serve", serve), ("dashboard", dashboard), ("report", report), ("mcp", mcp)]


def work(
    name: Name,
    function: Annotated[
        str, typer.Option(help="package.module:function or path/file.py:function, if not the study's own problem.")
    ] = "",
    trials: Annotated[int | None, typer.Option(help="Trials that this worker makes at most.")] = None,
    lifetime: Annotated[
        float, typer.Option(help="Seconds of silence after which this worker counts as dead and loses its trial.")
    ] = 120.0,
    storage: Storage = "",
) -> None:
    """Make trials until the study stops (see `study stop`); start as many workers as wanted.

    Ends with exit code 1 where all trials of this worker failed.
    """
    from surehold.cli.compilation import announced
    from surehold.cli.interruption import terminable
    from surehold.cli.terminal import terminal
    from surehold.errors import InputError
    from surehold.studies.trial_function import problem_of, trial_function
    from surehold.studies.worker import work as work_on

    if trials is not None and trials < 1:
        raise InputError(f"--trials is {trials}; give 1 or more, or leave it out.")
    study = opened(name, storage)
    console = terminal()

    with terminable(), announced(console):
        attempt = trial_function(problem_of(study.settings, function), study.settings.space)
        count = failures = 0

        def show(asked: Any, outcome: Any) -> None:
            nonlocal count, failures
            count += 1
            failures += bool(outcome.failure)
            said = f"failed: {outcome.failure}" if outcome.failure else f"{outcome.value:.6g}"
            console.print(f"trial {asked.id}{' (again)' * asked.again}: {said}", markup=False, soft_wrap=True)

        try:
            work_on(study, attempt, lifetime=lifetime, most=trials, after=show)
        except KeyboardInterrupt:
            console.print(f"Ended after {amount(count, 'trial')}; the one under way is let go.", markup=False)
            raise SystemExit(130) from None  # typer.Exit(130) reads as an interruption with nothing to keep
    failed = f", {'all' if failures == count else failures} failed" * bool(failures)
    over = f": the study has stopped, {study.stopped()}" if not count and study.stopped() else ""
    console.print(f"Done: {amount(count, 'trial')} by this worker{failed}{over}.", markup=False, soft_wrap=True)
    if failures and failures == count:
        raise typer.Exit(1)


def serve(
    context: typer.Context,
    name: Name,
    port: Annotated[int, typer.Option(help="On the loopback interface; 0 takes a free one.", min=0, max=65535)] = 8765,
    token: Annotated[
        str,
        typer.Option(
            envvar="SUREHOLD_TOKEN",
            help="What callers must send; by default a new one is made. Give it by the environment or by --token-file: "
            "a command line is seen by all users of a machine.",
            show_default=False,
        ),
    ] = "",
    token_file: Annotated[
        str, typer.Option(help="File that holds the token, readable by its owner only (mode 600).", show_default=False)
    ] = "",
    storage: Storage = "",
) -> None:
    """Answer ask, tell and the rest over HTTP, for this machine only."""
    from surehold.studies.service import listening, new_token, service

    study = opened(name, storage)
    if token_file:
        token = token_of(token_file)
    elif token and getattr(context.get_parameter_source("token"), "name", "") == "COMMANDLINE":
        typer.echo(
            "warning: all users of this machine see the token on the command line; give it in SUREHOLD_TOKEN or a file "
            "(--token-file).",
            err=True,
        )
    secret = token or new_token()
    with listening(port) as server:
        application = service(study, secret)
        typer.echo(f"Serving study {name} at {server.address}/ ; Ctrl-C ends it.")
        if not token:
            typer.echo(f"Callers send the header: Authorization: Bearer {secret}")
        server.run(application)


def mcp(name: Name, storage: Storage = "") -> None:
    """Answer a language model by the Model Context Protocol, on standard input and output."""
    from surehold.studies.model_context import model_context_server

    model_context_server(opened(name, storage)).run("stdio")


def token_of(path: str) -> str:
    """Return the token in a file.

    Raises
    ------
    InputError
        If it cannot be read, or others than its owner can read it.
    """
    from surehold.errors import InputError

    try:
        with open(path, encoding="utf-8") as file:
            mode = os.fstat(file.fileno()).st_mode
            text = file.read(10_000).strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"token file {path!r} cannot be read: {getattr(error, 'strerror', None) or error}.") from None
    if os.name == "posix" and mode & 0o077:
        raise InputError(
            f"token file {path!r} can be read by other users (mode {mode & 0o777:o}); close it with: chmod 600."
        )
    if not text:
        raise InputError(f"token file {path!r} is empty; write 16 characters or more into it.")
    return text


def dashboard(
    name: Name,
    port: Annotated[int, typer.Option(help="On the loopback interface; 0 takes a free one.", min=0, max=65535)] = 8080,
    open_page: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    storage: Storage = "",
) -> None:
    """Show the study in optuna-dashboard, with the model and the recommendation."""
    import webbrowser

    from surehold.reports.interactive import interactive_plots
    from surehold.reports.study_report import study_report
    from surehold.studies.dashboard import Dashboard

    study = opened(name, storage)

    def ready(address: str) -> None:
        typer.echo(f"Study {name} at {address} ; Ctrl-C ends it.")
        if open_page:
            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        Dashboard(study, lambda study: interactive_plots(study_report(study))).serve("127.0.0.1", port, ready)


def report(
    name: Name,
    out: Annotated[str, typer.Option(help="Folder; by default runs/NAME.", show_default=False)] = "",
    open_page: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
    storage: Storage = "",
) -> None:
    """Write the report of the study: a page that opens without network, figures, and data."""
    import webbrowser

    from surehold.reports.files import write_run
    from surehold.reports.study_report import study_report

    study = opened(name, storage)
    page = write_run(study_report(study), out or Path("runs") / name)
    typer.echo(f"Report: {page}")
    if open_page:
        webbrowser.open(page.resolve().as_uri())

"""The command `surehold` and its subcommands."""

import typer

from surehold import __version__
from surehold.cli.campaign import campaigns
from surehold.cli.doctor import doctor
from surehold.cli.explore import explore
from surehold.cli.grasp import grasp
from surehold.cli.maximize import maximize
from surehold.cli.scene import scene
from surehold.cli.study import studies

__all__ = ["application"]


def application() -> typer.Typer:
    """Return the command with everything below it."""
    app = typer.Typer(
        name="surehold",
        help="Find, in few trials, the optimum that still holds when the input is off.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.command()(grasp)
    app.command()(explore)
    app.command()(scene)
    for direction, extreme in (("maximize", "maximum"), ("minimize", "minimum")):
        app.command(direction, help=f"Find a {extreme} that still holds when the input is off.")(maximize)
    app.command()(doctor)
    app.add_typer(campaigns(), name="campaign")
    app.add_typer(studies(), name="study")

    def show_version(asked: bool) -> None:
        if asked:
            typer.echo(f"surehold {__version__}")
            raise typer.Exit()

    @app.callback()
    def options(
        version: bool = typer.Option(
            False, "--version", help="Show the version and exit.", is_eager=True, callback=show_version
        ),
    ) -> None: ...

    return app

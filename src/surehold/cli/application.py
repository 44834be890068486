"""The command `surehold` and its subcommands."""

from typing import Any

import typer
from typer.core import TyperGroup

from surehold import __version__
from surehold.cli.campaign import campaigns
from surehold.cli.doctor import doctor
from surehold.cli.explore import explore
from surehold.cli.grasp import grasp
from surehold.cli.grasp_rate import grasp_rate
from surehold.cli.hand import hands
from surehold.cli.maximize import maximize
from surehold.cli.scene import scene
from surehold.cli.study import studies

__all__ = ["application"]


class _Commands(TyperGroup):
    """Commands of which one has two words, beside another whose name is the first of them."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[:2] == ["grasp", "rate"]:
            args = ["grasp rate", *args[2:]]
        return super().resolve_command(ctx, args)


def application() -> typer.Typer:
    """Return the command with everything below it."""
    app = typer.Typer(
        name="surehold",
        cls=_Commands,
        help="Find, in few trials, the optimum that still holds when the input is off.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.command()(grasp)
    app.command("grasp rate")(grasp_rate)
    app.command()(explore)
    app.command()(scene)
    for direction, extreme in (("maximize", "maximum"), ("minimize", "minimum")):
        app.command(direction, help=f"Find a {extreme} that still holds when the input is off.")(maximize)
    app.command()(doctor)
    app.add_typer(campaigns(), name="campaign")
    app.add_typer(hands(), name="hand")
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

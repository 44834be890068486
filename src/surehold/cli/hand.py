"""`surehold hand`: what is made of hands before they grasp."""

import typer

from surehold.cli.hand_new import new
from surehold.cli.hand_show import show
from surehold.cli.hand_synergy import synergy

__all__ = ["hands"]


def hands() -> typer.Typer:
    """Return the command with everything below it."""
    app = typer.Typer(help="Hands: describe one, look at one, learn how one moves.", no_args_is_help=True)
    for command in (new, show, synergy):
        app.command()(command)
    return app

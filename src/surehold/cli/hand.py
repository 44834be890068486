"""`surehold hand`: what is made of hands before they grasp."""

import typer

from surehold.cli.hand_synergy import synergy

__all__ = ["hands"]


def hands() -> typer.Typer:
    """Return the command with everything below it."""
    app = typer.Typer(help="Hands: learn how one moves.", no_args_is_help=True)
    app.command()(synergy)
    return app

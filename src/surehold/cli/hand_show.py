"""`surehold hand show`: a hand open and closed on a page, its joints, and what looks wrong with it."""

import webbrowser
from pathlib import Path
from typing import Annotated, Any

import typer

from surehold.cli.options import Open, Out

__all__ = ["show", "shown_hand"]


def show(
    hand: Annotated[str, typer.Argument(help="A name such as icub-left, a description (.yaml), or a model file.")],
    hand_config: Annotated[str, typer.Option(help="YAML description of a model file.")] = "",
    out: Out = "",
    open_page: Open = False,
) -> None:
    """Look at a hand: open and closed with its axes, joints and ranges; what looks wrong with it is said."""
    from surehold.cli.terminal import terminal
    from surehold.problems.grasp.description import described_hand

    shown_hand(described_hand(hand, hand_config), out, open_page, terminal())


def shown_hand(hand: Any, out: str, open_page: bool, console: Any) -> None:
    """Write the page of a hand into a folder; say its joints and what looks wrong with it."""
    from rich.table import Table

    from surehold.grasping.hand.inspection import hand_faults
    from surehold.reports.hand_page import JOINT_COLUMNS, joint_rows, render_hand
    from surehold.store.atomic import checked_folder, write_file

    folder = checked_folder(out or Path("runs") / f"hand-{hand.name}")
    faults = hand_faults(hand)
    write_file(folder / "hand.html", render_hand(hand, _facts(hand), faults))
    for preshape in hand.preshapes:
        table = Table(title=f"{hand.name}, {preshape}", title_justify="left", show_edge=False, pad_edge=False)
        for column in JOINT_COLUMNS:
            table.add_column(column, overflow="fold")
        for row in joint_rows(hand, preshape):
            table.add_row(*row)
        console.print(table)
        console.print()
    for fault in faults:
        console.print(f"Warning: {fault}", markup=False, soft_wrap=True)
    console.print(f"Page: {folder / 'hand.html'}", markup=False, soft_wrap=True)
    if open_page:
        webbrowser.open((folder / "hand.html").resolve().as_uri())


def _facts(hand: Any) -> list[tuple[str, str]]:
    center = ", ".join(f"{1e3 * c:.0f}" for c in hand.grasp_center)
    source = f" ({hand.sources['finger_force']})" if "finger_force" in hand.sources else ""
    facts = [("grasp center", f"({center}) mm"), ("force of a finger", f"{hand.finger_force:g} N{source}")]
    if hand.friction is not None:
        facts.append(("friction", f"{hand.friction:g}"))
    if hand.model is not None:
        facts = [("model", hand.model.file), ("palm", hand.model.body), *facts]
    return facts

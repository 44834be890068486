"""`surehold hand new`: the description of a hand that nobody has described, from its model."""

import os
import shlex
from pathlib import Path
from typing import Annotated

import typer

from surehold.cli.options import Open

__all__ = ["new"]


def new(
    model: Annotated[str, typer.Argument(help="Model of the hand: .xml of MuJoCo or .urdf.")],
    out: Annotated[
        str, typer.Option(help="The description; by default MODEL.yaml in this folder.", show_default=False)
    ] = "",
    palm: Annotated[
        str, typer.Option(help="Look below this body alone, where a model has more than one hand.", show_default=False)
    ] = "",
    open_page: Open = False,
) -> None:
    """Propose the description of a hand: palm, fingers, how they close; written as YAML, shown as a page."""
    from surehold.cli.hand_show import shown_hand
    from surehold.cli.terminal import terminal
    from surehold.errors import InputError
    from surehold.grasping.hand.description_file import description_text
    from surehold.grasping.hand.files import load_hand
    from surehold.grasping.hand.proposal import propose_hand
    from surehold.store.atomic import write_file

    if Path(model).suffix.lower() in (".yaml", ".yml"):
        raise InputError(
            f"'{model}' is a description, not a model; look at it with: surehold hand show {shlex.quote(model)}. A new "
            "one is proposed from the hand's .xml or .urdf file."
        )
    file = Path(out or f"{Path(model).stem}.yaml")
    if file.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"--out is {str(file)!r}; a description is a .yaml file.")
    if file.exists():
        raise InputError(f"'{file}' exists already; name another file with --out, or remove it.")
    proposal = propose_hand(model, palm)
    hand = load_hand(model, proposal.config)
    write_file(file, description_text(proposal, os.path.relpath(model, file.parent)))
    console = terminal()
    kind = "a gripper" if proposal.gripper else "a hand"
    console.print(
        f"{model}: {kind} of {len(hand.finger_names)} fingers ({', '.join(hand.finger_names)}) on "
        f"{proposal.config.palm.body}; {proposal.opposed} is opposed to the others.",
        markup=False,
        soft_wrap=True,
    )
    shown_hand(hand, "", open_page, console)
    grasp = f"surehold grasp mug --hand {shlex.quote(str(file))}"
    console.print(f"Description: {file}. Grasp with it: {grasp}", markup=False, soft_wrap=True)

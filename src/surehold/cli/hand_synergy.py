"""`surehold hand synergy`: the synergy of recorded postures, and how much of them it explains."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

__all__ = ["synergy"]


def synergy(
    postures: Annotated[Path, typer.Argument(help="CSV file: joint names in the first row, one posture a row.")],
    hand: Annotated[
        str, typer.Option(help="The hand that was recorded: a name such as icub-left, or a model file.")
    ] = "icub-left",
    hand_config: Annotated[str, typer.Option(help="YAML description of a hand's model file.")] = "",
    components: Annotated[
        int, typer.Option(help="Amplitudes: the first one closes the hand, the others are s1, s2, s3.")
    ] = 2,
    degrees: Annotated[bool, typer.Option("--degrees", help="The angles are in degrees, not in radians.")] = False,
    out: Annotated[str, typer.Option(help="The synergy file.")] = "synergy.yaml",
) -> None:
    """Learn how the joints of a hand move together from recorded postures (principal components)."""
    from rich.table import Table

    from surehold.cli.terminal import terminal
    from surehold.grasping.hand.learned_synergy import learn_synergy, write_synergy
    from surehold.grasping.hand.postures import read_postures
    from surehold.problems.grasp.description import described_hand

    gripper = described_hand(hand, hand_config)
    recorded = read_postures(postures, degrees, gripper)
    found = learn_synergy(recorded.joints, recorded.angles, gripper, components)
    write_synergy(out, found)
    console = terminal()
    console.print(
        f"{postures}: {len(recorded.angles)} postures of {len(recorded.joints)} joints of {found.hand}; the components "
        f"explain {100 * found.explained.sum():.1f} % of their variance.",
        markup=False,
        soft_wrap=True,
    )
    table = Table(title=None, show_edge=False, pad_edge=False, header_style="bold")
    for column in ("amplitude", "explained", "deviation", "recorded", "moves most"):
        table.add_column(column, overflow="fold")
    for k, vector in enumerate(found.components):
        strongest = np.argsort(-np.abs(vector), kind="stable")[:3]
        table.add_row(
            "closing" if k == 0 else f"s{k}",
            f"{100 * found.explained[k]:.1f} %",
            f"{found.deviations[k]:.3f}",
            f"{found.ranges[k, 0]:.2f} to {found.ranges[k, 1]:.2f}",
            ", ".join(f"{found.joints[j]} {vector[j]:+.2f}" for j in strongest),
        )
    console.print(table)
    console.print(f"Grasp with it: surehold grasp mug --preshape {out}", markup=False, soft_wrap=True)

"""`surehold grasp rate FILE`: close the hand again in the grasps of a file, and rate them."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from surehold.amounts import amount
from surehold.cli.grasp_options import object_of, shown_progress, takes_grasp_options
from surehold.cli.options import Seed

__all__ = ["Formats", "grasp_rate"]

Formats = Annotated[
    str,
    typer.Option(
        "--format",
        help="Formats in which the grasps are written: isaac (always), graspgen, dexgraspbench; several by commas.",
    ),
]
_UNUSED = ("facet", "variables", "cloud", "camera", "normals", "contacts", "cloud_noise", "prior", "shapes", "plan")


def _grasp_rate(
    file: Annotated[
        Path, typer.Argument(help="A file of grasps: .yaml (Isaac), .json (GraspGen), .npy or a folder of them.")
    ],
    context: typer.Context,
    obj: Annotated[
        str, typer.Option("--object", help="The object, instead of the one that the file names.", show_default=False)
    ] = "",
    samples: Annotated[
        int, typer.Option(help="Also rate each grasp in so many poses that are off by up to 10 mm and 5 degrees.")
    ] = 0,
    seed: Seed = 0,
    check: Annotated[bool, typer.Option("--check", help="Shake the grasps, by physics (MuJoCo).")] = False,
    formats: Formats = "isaac",
    out: Annotated[
        str, typer.Option(help="Folder into which the grasps are written as they are now.", show_default=False)
    ] = "",
    **options: Any,
) -> None:
    """Close the hand again in the grasps of a file, and rate them."""
    from rich.markup import escape
    from rich.table import Table

    from surehold.cli.compilation import announced
    from surehold.cli.grasp_check import friction_in_words, squeeze_in_words, verdict_in_words
    from surehold.cli.terminal import terminal
    from surehold.grasping.formats.gripper import stored_grasp, unknown_frame
    from surehold.grasping.formats.writing import checked_formats, write_grasps
    from surehold.grasping.pose_noise import PoseNoise
    from surehold.grasping.rating import rated_grasps
    from surehold.problems.grasp.stored import described_file, described_simulator, stored_words
    from surehold.store.atomic import checked_folder
    from surehold.store.leftovers import listed_writes

    chosen = checked_formats(formats.split(","))
    if out:
        checked_folder(out)
    console = terminal()
    sources = {name: getattr(context.get_parameter_source(name), "name", "") for name in options}
    given = {name: value for name, value in options.items() if sources[name] == "COMMANDLINE"}
    content, words, hand, found = described_file(file, {"object": obj, **given})
    body = object_of(words, console) if found is None else found

    def build(gripper: Any) -> Any:
        return described_simulator(words, body, gripper)

    rated = []
    with announced(console), shown_progress("grasps", console) as progress:
        simulator = described_simulator(words, body, hand)
        try:
            for one in rated_grasps(simulator, content, build, samples, seed):
                rated.append(one)
                progress(len(rated) / len(content.grasps))
        except KeyboardInterrupt:
            if not rated:
                raise
            console.print(f"Interrupted: {len(rated)} of {len(content.grasps)} grasps are rated.", soft_wrap=True)
    table = Table(title=None, show_edge=False, pad_edge=False, header_style="bold")
    columns = ["grasp", "confidence", "before", "status", "quality"]
    columns += (["off: mean", "closed"] if samples else []) + (["physics"] if check else [])
    roomy = console.width >= sum(map(len, columns)) + 3 * (len(columns) - 1)
    for column in columns:  # words are folded; numbers, too, rather than cropped, where there is no room for them
        table.add_column(column, overflow="fold", no_wrap=roomy and column not in ("grasp", "status"))
    stored, squeeze, verdicts = [], "", []
    for one in rated:
        before = "" if one.stored.quality is None else f"{one.stored.quality:.3f}"
        row = [escape(one.stored.name), f"{one.stored.confidence:.2f}", before, one.grasp.status]
        row.append(f"{one.grasp.quality:.3f}")
        if one.robust is not None:
            row += [f"{one.robust.mean:.3f}", f"{100 * one.robust.closure_rate:.0f} %"]
        if check:
            from surehold.grasping.physics.check import GraspChecker

            checker = GraspChecker(one.simulator)
            squeeze = f"; squeezed with {squeeze_in_words(checker)}"
            verdict = checker.check(one.grasp)
            row.append(verdict.verdict)
            verdicts.append(f"{one.stored.name}: {verdict_in_words(verdict)}")
        table.add_row(*row)
        preshape = one.simulator.hand.preshapes[one.simulator.preshape]
        worth = one.grasp.quality if one.robust is None else one.robust.mean
        stored.append(stored_grasp(hand, one.grasp, preshape, one.stored.name, worth))
    unsaid = "" if content.settings else " The file names no options; those not given have their defaults."
    console.print(
        f"{file}: {amount(len(rated), 'grasp')} of hand {hand.name} on {body.name}, {simulator.quality} with "
        f"{simulator.contact} contacts and friction {friction_in_words(simulator)}{squeeze}.{unsaid}",
        markup=False,
        soft_wrap=True,
    )
    if strange := unknown_frame(hand, content):
        console.print(strange, markup=False, soft_wrap=True)
    console.print(table)
    for verdict in verdicts:
        console.print(verdict, markup=False, soft_wrap=True)
    if samples:
        bounds = PoseNoise()
        console.print(
            f"off: {samples} poses of each grasp that are off by up to {1e3 * bounds.shift:g} mm along and "
            f"{np.degrees(bounds.turn):g} degrees about each axis. The confidence of a run's own file is the mean "
            "under the noise of that run.",
            markup=False,
            soft_wrap=True,
        )
    if out:
        preshape = simulator.hand.preshapes[simulator.preshape]
        with listed_writes(Path(out)):  # not replacing: the grasps of a run get a further format
            written = write_grasps(out, stored, body, hand, preshape, chosen, stored_words(words))
        for path in written:
            console.print(f"written: {path}", markup=False, soft_wrap=True)


grasp_rate = takes_grasp_options(_grasp_rate, _UNUSED)

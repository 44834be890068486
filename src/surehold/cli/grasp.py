"""`surehold grasp OBJECT`: find a grasp that still holds when the hand is off."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from surehold.cli.grasp_options import (
    Closing,
    Friction,
    HandConfigFile,
    HandName,
    MeshFrame,
    MeshMass,
    MeshUnit,
    ObjectName,
    PreshapeName,
    hand_of,
    object_of,
    shown_progress,
)
from surehold.cli.options import (
    Initial,
    Method,
    Noise,
    Open,
    Out,
    Preset,
    Seed,
    Study,
    StudyStorage,
    Trials,
    checked_method,
    noise_of,
)

__all__ = ["grasp"]


def grasp(
    obj: ObjectName,
    facet: Annotated[
        str,
        typer.Option(
            help="The facet that the palm faces, then the one at the thumb; by default right-front, of the drill "
            "bottom-front.",
            show_default=False,
        ),
    ] = "",
    variables: Annotated[str, typer.Option(help="Free variables, of dx,dy,dz,rx,ry,rz,s1.")] = "dx,dy",
    contact: Annotated[str, typer.Option(help="single, patch or graded (soft touch).")] = "graded",
    quality: Annotated[str, typer.Option(help="epsilon, signed_epsilon, volume, simox, task or closure.")] = "epsilon",
    unit: MeshUnit = "",
    mass: MeshMass = None,
    frame: MeshFrame = None,
    friction: Friction = None,
    hand: HandName = "icub-left",
    hand_config: HandConfigFile = "",
    preshape: PreshapeName = "",
    closing: Closing = "adaptive",
    method: Method = "ubo",
    trials: Trials = 100,
    initial: Initial = 40,
    noise: Noise = "0.03",
    seed: Seed = 0,
    preset: Preset = "",
    out: Out = "",
    study: Study = "",
    storage: StudyStorage = "",
    check: Annotated[bool, typer.Option("--check", help="Shake the grasps found, by physics (MuJoCo).")] = False,
    open_report: Open = False,
) -> None:
    """Find a grasp that still holds when the hand is off."""
    checked_method(method)
    input_noise = noise_of(noise or "none", method)

    from surehold.cli.compilation import announced
    from surehold.cli.session import NO_SUCCESS, Kept, folder_for, run_session
    from surehold.cli.terminal import terminal
    from surehold.grasping.formats import grasp_to_dict
    from surehold.problems.grasp.problem import Grasp
    from surehold.reports import gather
    from surehold.reports.run_report import Candidate, RunReport
    from surehold.reports.still import still_picture
    from surehold.store.atomic import write_file

    names = tuple(name.strip() for name in variables.split(",") if name.strip())
    described = {
        "object": obj,
        "facet": facet,
        "variables": list(names),
        "contact": contact,
        "quality": quality,
        "unit": unit,
        "mass": mass,
        "frame": frame,
        "friction": friction,
        "hand": hand,
        "hand config": hand_config,
        "preshape": preshape,
        "closing": closing,
    }
    kept = Kept(study, storage, {"grasp": described})
    console = terminal()
    body, gripper = object_of(obj, unit, mass, frame, console), hand_of(hand, hand_config)
    with announced(console), shown_progress("default pose", console) as progress:
        problem = Grasp(
            body,
            facet,
            names,
            contact=contact,
            quality=quality,
            closing=closing,
            friction=friction,
            hand=gripper,
            preshape=preshape or None,
            preset="thesis" if preset == "thesis" else "",
            progress=progress,
        )
    described["facet"] = problem.facet
    checker = None
    if check:
        from surehold.grasping.physics.check import GraspChecker

        checker = GraspChecker(problem.simulator)  # before the run: without MuJoCo it says so at once
    folder = folder_for(f"{problem.object.name} {problem.facet}", method, seed, out, study)

    def describe(candidate: Candidate) -> Candidate:
        outcome = problem.grasp(candidate.x)
        position = ", ".join(f"{1000 * p:.1f}" for p in outcome.pose.position)
        turn = ", ".join(f"{q:.3f}" for q in outcome.pose.quaternion)
        physics = {} if checker is None else {"physics": checked(checker.check(outcome), console)}
        return replace(
            candidate,
            status=outcome.status,
            pose=f"palm at ({position}) mm, quaternion ({turn}), s1 = {outcome.s1:.2f} rad",
            details={"contacts": str(len(outcome.contacts)), "touching links": touching_links(outcome.touching)}
            | physics,
            scene=replace(
                gather.grasp_scene(problem.simulator.scene(outcome)), neighbors=neighbors_of(problem, candidate)
            ),
        )

    def also_write(report: RunReport, folder: Path) -> None:
        write_grasps(problem, report, folder / "grasps.yaml")
        every = {c.label: {"x": c.x, "grasp": problem.grasp(c.x)} for c in report.candidates}
        text = json.dumps(grasp_to_dict(every), indent=1, allow_nan=False)
        write_file(folder / "grasps.json", text + "\n")
        if report.recommended.scene is not None:
            write_file(folder / "grasp.png", still_picture(report.recommended.scene)[0])

    def outcomes(result: Any) -> Counter[str]:
        return Counter(problem.grasp(x).status for x in result.X)

    report = run_session(
        problem,
        title=f"Grasp the {problem.object.name} from the {problem.facet}",
        method=method,
        noise=input_noise,
        trials=100 if trials is None else trials,
        initial=40 if initial is None else initial,
        seed=seed,
        preset=preset,
        folder=folder,
        open_report=open_report,
        settings={
            "object": problem.object.name,
            "facet": problem.facet,
            "variables": ", ".join(problem.box.names),
            "hand": problem.simulator.hand.name,
            "preshape": problem.simulator.preshape,
            "contact": problem.simulator.contact,
            "quality": problem.simulator.quality,
            "closing": problem.simulator.closing,
            "friction": problem.simulator.friction,
            "input noise": noise,
        },
        describe=describe,
        also_write=also_write,
        units=dict(zip(problem.box.names, problem.units, strict=True)),
        quality_name=f"quality ({problem.simulator.quality})",
        disturbance="the hand is off",
        success_above=0.0,
        outcomes=outcomes,
        advice="Try another --facet, more --variables (dz, rx, ry, rz or s1), another --preshape, or more --trials.",
        kept=kept,
        console=console,
    )
    if not report.succeeded:
        raise typer.Exit(NO_SUCCESS)


def neighbors_of(problem: Any, candidate: Any) -> Any:
    """Return where the hand's grasp center was in a candidate's re-queries, and which were worth less than half."""
    from surehold.reports.run_report import Neighbors

    if not candidate.values.size or len(candidate.points) != candidate.values.size:
        return None
    center = problem.simulator.hand.grasp_center
    points = np.array([problem.pose(x).apply(center) for x in candidate.points])
    return Neighbors(points, candidate.values < 0.5 * candidate.quality)


def touching_links(names: Sequence[str]) -> str:
    """Return how many links of each finger touch, from names such as "index distal" and "palm"."""
    counts = Counter(name.partition(" ")[0] for name in names)
    return ", ".join(f"{finger} {n}" if finger != "palm" else finger for finger, n in counts.items()) or "none"


def checked(outcome: Any, console: Any) -> str:
    """Return what physics says of a grasp, and print it."""
    worst = max(outcome.loads, key=lambda load: load.moved)
    moved = f"moves {1000 * worst.moved:.1f} mm under {worst.load}" if worst.moved < 1.0 else f"lost under {worst.load}"
    text = f"{outcome.verdict}, {moved}"
    console.print(f"physics: {text}")
    return text


def write_grasps(problem: Any, report: Any, path: Path) -> None:
    """Write the candidates of a report as an Isaac grasp file."""
    from surehold.grasping.formats import StoredGrasp, write_isaac_grasps

    def joints(angles: Any) -> dict[str, float]:
        names = problem.simulator.hand.joint_names
        return {name: float(angle) for name, angle in zip(names, angles.ravel(), strict=True) if name}

    stored = []
    for candidate in report.candidates:
        outcome = problem.grasp(candidate.x)
        worth = candidate.mean if candidate.values.size else candidate.quality
        stored.append(
            StoredGrasp(
                candidate.label.replace(" ", "_"),
                min(max(float(worth), 0.0), 1.0),
                outcome.pose.position,
                outcome.pose.quaternion,
                joints(outcome.joints),
                joints(outcome.open_joints),
            )
        )
    write_isaac_grasps(path, stored, problem.object.name, problem.simulator.hand.name)

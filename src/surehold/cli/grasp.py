"""`surehold grasp OBJECT`: find a grasp that still holds when the hand is off."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from surehold.cli.grasp_check import checked, checker_for, friction_in_words
from surehold.cli.grasp_options import object_of, shown_progress, takes_grasp_options
from surehold.cli.grasp_rate import Formats
from surehold.cli.options import (
    REQUERIES,
    Initial,
    Method,
    Noise,
    Open,
    Out,
    Preset,
    Requeries,
    RiskMeasure,
    Seed,
    Study,
    StudyStorage,
    Trials,
    checked_method,
    noise_of,
    risk_of,
)
from surehold.errors import InputError, unknown_name

__all__ = ["Outcomes", "grasp"]

_UNSEEN = 0.004  # m; deviation of a surface that counts as not seen
_OUTCOMES = ("quality", "held")
_PRESETS = ("thesis", "thesis-grasp")  # both with the simulator of the thesis


class Outcomes:
    """A grasp problem that keeps what came of every trial: the report and the files close no hand again.

    With a checker a trial gives 1 if the grasp is held, else 0, instead of its quality.
    """

    def __init__(self, problem: Any, checker: Any = None):
        self.checker = checker
        self.problem, self.name, self.box, self.warm_up = problem, problem.name, problem.box, problem.warm_up
        self._kept: dict[bytes, Any] = {}

    def grasp(self, x: Any) -> Any:
        """Return the outcome of the trial at x (d,)."""
        key = np.asarray(x, dtype=np.float64).tobytes()
        if key not in self._kept:
            self._kept[key] = self.problem.grasp(x)
        return self._kept[key]

    def __call__(self, x: Any) -> float:
        """Return the quality at x (d,), its mean over the shapes with --plan shapes; or whether it is held."""
        if self.checker is not None:
            return float(self.checker.held([self.grasp(x)])[0])
        return self.problem(x) if self.problem.averaged else self.grasp(x).quality


def simulator_preset(preset: str) -> str:
    """Return the preset of the simulator that belongs to one of the optimizer.

    Raises
    ------
    InputError
        If the thesis has that preset for another problem than grasps, or it is unknown.
    """
    if preset and preset not in _PRESETS:
        raise unknown_name("preset of a grasp", preset, _PRESETS)
    return "thesis" if preset else ""


@takes_grasp_options
def grasp(
    obj: Annotated[
        str,
        typer.Argument(
            metavar="[OBJECT]",
            help="mug, bottle, glass, drill, or a mesh file (STL, OBJ, PLY, glTF, GLB); of a point cloud see --cloud.",
        ),
    ] = "",
    method: Method = "ubo",
    trials: Trials = 100,
    initial: Initial = 40,
    noise: Noise = "0.03",
    risk: RiskMeasure = "",
    seed: Seed = 0,
    preset: Preset = "",
    out: Out = "",
    study: Study = "",
    storage: StudyStorage = "",
    check: Annotated[
        int | None,
        typer.Option(
            "--check",
            metavar="[N]",
            help="Shake the grasps found, by physics (MuJoCo), and N of their re-queries each; 20 if no N is given.",
            show_default=False,
        ),
    ] = None,
    outcome: Annotated[
        str, typer.Option(help="What a trial gives: quality, or held (success or failure, by physics).")
    ] = "quality",
    formats: Formats = "isaac",
    requeries: Requeries = REQUERIES,
    open_report: Open = False,
    **options: Any,
) -> None:
    """Find a grasp that still holds when the hand is off."""
    checked_method(method)
    if outcome not in _OUTCOMES:
        raise unknown_name("outcome of a grasp", outcome, _OUTCOMES)
    if outcome == "held" and study:
        raise InputError(f"--outcome held is for runs that are not kept; leave --study {study} out.")
    input_noise = noise_of(noise or "none", method)
    asked = risk_of(risk, method, preset, outcome)

    from surehold.cli.compilation import announced
    from surehold.cli.session import NO_SUCCESS, Kept, folder_for, run_session
    from surehold.cli.terminal import terminal
    from surehold.grasping.formats.writing import checked_formats
    from surehold.grasping.plain_data import grasp_to_dict
    from surehold.problems.grasp.description import described_grasp
    from surehold.problems.grasp.options import checked_words
    from surehold.reports.run_report import Candidate, RunReport
    from surehold.reports.still import still_picture
    from surehold.store.atomic import write_file

    chosen = checked_formats(formats.split(","))
    names = [name.strip() for name in options["variables"].split(",") if name.strip()]
    described = {"object": obj, **options, "variables": names, "preset": simulator_preset(preset)}
    described["quality"] = checked_words(described)["quality"]
    kept = Kept(study, storage, {"grasp": described})
    console = terminal()
    body = object_of(described, console)
    with announced(console), shown_progress("default pose", console) as progress:
        problem = described_grasp(described, body, progress)
    described["facet"] = problem.facet
    checker = checker_for(problem, check, outcome)
    guess = {} if preset else problem.guess
    simox = problem.simulator.quality == "simox"
    folder = folder_for(f"{problem.object.name} {problem.facet}", method, seed, out, study)

    outcomes = Outcomes(problem, checker if outcome == "held" else None)

    def describe(candidate: Candidate) -> Candidate:
        found = outcomes.grasp(candidate.x)
        physics = {} if check is None else checked(checker, outcomes, candidate, check, console)
        return replace(
            candidate,
            status=found.status,
            pose=pose_text(found),
            details=dict(candidate.details)
            | {
                "contacts": str(len(found.contacts)),
                "touching links": touching_links(problem.simulator.hand, found.touching),
            }
            | losses(problem, candidate.x, input_noise, seed)
            | known_at(problem, found.contacts.points)
            | (as_measured(problem, candidate, input_noise) if outcome == "quality" else {})
            | physics,
            scene=replace(drawn(problem, found), neighbors=neighbors_of(problem, candidate)),
        )

    def also_write(report: RunReport, folder: Path) -> None:
        write_grasps(outcomes, report, folder, chosen, described)
        every = {c.label: {"x": c.x, "grasp": outcomes.grasp(c.x)} for c in report.candidates}
        text = json.dumps(grasp_to_dict(every), indent=1, allow_nan=False)
        write_file(folder / "grasps.json", text + "\n")
        if report.recommended.scene is not None:
            write_file(folder / "grasp.png", still_picture(report.recommended.scene)[0])

    def statuses(result: Any) -> Counter[str]:
        return Counter(outcomes.grasp(x).status for x in result.X)

    report = run_session(
        outcomes,
        title=f"Grasp the {problem.object.name} from the {problem.facet}",
        method=method,
        noise=input_noise,
        trials=100 if trials is None else trials,
        initial=40 if initial is None else initial,
        seed=seed,
        preset=preset,
        folder=folder,
        requeries=requeries,
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
            "friction": friction_in_words(problem.simulator) if simox else problem.simulator.friction,
            "input noise": noise,
            "guess": ", ".join(f"{name}={value:.3g}" for name, value in guess.items()) or None,
        },
        describe=describe,
        also_write=also_write,
        units=dict(zip(problem.box.names, problem.units, strict=True)),
        quality_name="held (physics)" if outcome == "held" else quality_name(problem),
        outcome="success" if outcome == "held" else "value",
        disturbance="the hand is off",
        risk=asked,
        success_above=0.0,
        outcomes=statuses,
        advice=advice_for(problem),
        kept=kept,
        required={"guess": guess} if guess else {},
        console=console,
    )
    if not report.succeeded:
        raise typer.Exit(NO_SUCCESS)


def quality_name(problem: Any) -> str:
    """Return the name of what a trial gives."""
    shapes = len(problem.object.draws) if problem.averaged else 0
    return f"quality ({problem.simulator.quality})" + f" over {shapes} shapes" * bool(shapes)


def advice_for(problem: Any) -> str:
    """Return what to try where no grasp succeeds: first what looks wrong with the hand, if anything does."""
    from surehold.grasping.hand.inspection import hand_faults

    faults = hand_faults(problem.simulator.hand, problem.simulator.preshape)
    seen = f"The hand looks wrong: {' '.join(faults)} See it with surehold hand show. " if faults else ""
    told = (
        "" if problem.simulator.quality == "signed_epsilon" else "--quality signed_epsilon (it tells what is missing), "
    )
    others = "another --facet, more --variables (dz, rx, ry, rz or s1), another --preshape"
    return f"{seen}Try {others}, {told}or more --trials."


def drawn(problem: Any, outcome: Any) -> Any:
    """Return the scene of a grasp; an object of unknown shape is colored by how uncertain its surface is."""
    from surehold.grasping.pictures.scene import grasp_scene
    from surehold.reports.scene import drawn_scene
    from surehold.reports.uncertain_shape import LEGEND, shape_meshes

    scene = drawn_scene(grasp_scene(problem.simulator, outcome))
    body = problem.object
    if body.deviation is None:
        return scene
    meshes = shape_meshes(body.vertices, body.faces, body.deviation, see_through=True)
    return replace(scene, meshes=(*meshes, *scene.meshes[1:]), legend=LEGEND)


def pose_text(outcome: Any) -> str:
    """Return where the palm of a grasp is and its posture in words."""
    position = ", ".join(f"{1000 * p:.1f}" for p in outcome.pose.position)
    turn = ", ".join(f"{q:.3f}" for q in outcome.pose.quaternion)
    amplitudes = outcome.s1 if isinstance(outcome.s1, tuple) else (outcome.s1,)
    posture = ", ".join(f"s{i + 1} = {s:.2f} rad" for i, s in enumerate(amplitudes))
    return f"palm at ({position}) mm, quaternion ({turn}), {posture}"


def losses(problem: Any, x: Any, noise: Any, seed: int) -> dict[str, str]:
    """Return what a grasp of an object of unknown shape loses to the pose and to the shape, in words."""
    from surehold.problems.grasp.shape_loss import shape_loss

    if not problem.object.draws or noise is None:
        return {}
    loss = shape_loss(problem, x, noise, seed=seed)
    return {
        "on the mean shape": f"{loss.nominal:.3f}",
        "lost to the pose": f"{loss.pose:.3f}",
        "lost to the unknown shape": f"{loss.shape:.3f}",
        "left under both": f"{loss.robust:.3f}",
    }


def known_at(problem: Any, points: Any) -> dict[str, str]:
    """Return how well an unknown shape is known at the contacts (c, 3) of a grasp, and what to do if it is not."""
    from scipy.spatial import KDTree

    body = problem.object
    if body.deviation is None or not len(points):
        return {}
    deviation = float(np.sqrt(np.mean(body.deviation[KDTree(body.vertices).query(points)[1]] ** 2)))
    advice = "; this side was not seen: scan it, or touch it and give --contacts" if deviation > _UNSEEN else ""
    return {"shape at the contacts": f"known to {1e3 * deviation:.1f} mm{advice}"}


def as_measured(problem: Any, candidate: Any, noise: Any) -> dict[str, str]:
    """Return what measured thresholds say of a candidate's mean under the input noise, where there are any."""
    from surehold.problems.grasp.measured import threshold_in_words

    words = threshold_in_words(problem, candidate.mean, noise)
    return {"held, as measured": words} if words else {}


def neighbors_of(problem: Any, candidate: Any) -> Any:
    """Return where the hand's grasp center was in a candidate's re-queries, and which were worth less than half."""
    from surehold.reports.run_report import Neighbors

    if not candidate.values.size or len(candidate.points) != candidate.values.size:
        return None
    center = problem.simulator.hand.grasp_center
    points = np.array([problem.pose(x).apply(center) for x in candidate.points])
    return Neighbors(points, candidate.values < 0.5 * candidate.quality)


def touching_links(hand: Any, names: Sequence[str]) -> str:
    """Return how many links of each finger touch, such as "index 2, thumb 1, palm"; `names` are those of bodies."""
    joints = len(hand.link_names) // len(hand.finger_names)
    finger_of = {name: hand.finger_names[k // joints] for k, name in enumerate(hand.link_names)}
    counts = Counter(finger_of.get(name, name) for name in dict.fromkeys(names))
    return ", ".join(f"{name} {n}" if name in hand.finger_names else name for name, n in counts.items()) or "none"


def write_grasps(outcomes: Outcomes, report: Any, folder: Path, formats: Sequence[str], words: dict[str, Any]) -> None:
    """Write the candidates of a report as files of grasps."""
    from surehold.grasping.formats.gripper import stored_grasp
    from surehold.grasping.formats.writing import write_grasps as written
    from surehold.problems.grasp.stored import stored_words

    simulator = outcomes.problem.simulator
    hand, preshape = simulator.hand, simulator.hand.preshapes[simulator.preshape]
    stored = []
    for candidate in report.candidates:
        worth = candidate.mean if candidate.values.size else candidate.quality
        outcome = outcomes.grasp(candidate.x)
        stored.append(stored_grasp(hand, outcome, preshape, candidate.label.replace(" ", "_"), worth))
    written(folder, stored, simulator.object, hand, preshape, formats, stored_words(words))

"""`surehold explore OBJECT`: touch an object whose shape is not known, learn it, and end with a grasp."""

import json
import webbrowser
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from surehold.amounts import amount
from surehold.cli.grasp_options import object_of, shown_progress, takes_grasp_options
from surehold.cli.options import Open, Out, Seed, StudyStorage, noise_of
from surehold.errors import InputError, unknown_name

if TYPE_CHECKING:
    from surehold.cli.session import Kept

__all__ = ["explore"]

_COLUMNS = ("touches", "error, mean [mm]", "error, 95 % [mm]", "deviation, mean [mm]", "believed", "true", "best trial")
_SHOWN = (0, 5, 10, 20, 40, 80)
_STARTS = ("box", "view")
_TRIALS = 20
_MOST_TRIALS = 500


@partial(takes_grasp_options, without=("plan",))  # what is known to be unsure is touched, not averaged
def explore(
    obj: Annotated[str, typer.Argument(metavar="[OBJECT]", help="mug, bottle, glass, drill, or a mesh file.")] = "",
    trials: Annotated[
        int | None, typer.Option(help=f"Touches in simulation; {_TRIALS} by default.", show_default=False)
    ] = None,
    start: Annotated[str, typer.Option(help="What is known first: box, or view (of a camera, 1000 points).")] = "box",
    goal: Annotated[str, typer.Option(help="grasp: find a safe one; shape: know the shape.")] = "grasp",
    probe: Annotated[bool, typer.Option("--probe", help="End a trial at the first contact.")] = False,
    noise: Annotated[
        str | None, typer.Option(help="What the hand strays: a share of every range, or NAME=DEVIATION,... [m, rad].")
    ] = "0.03",
    seed: Seed = 0,
    box: Annotated[
        str, typer.Option(help="Of --study: edges of the object's box, x,y,z [m].", show_default=False)
    ] = "",
    study: Annotated[
        str,
        typer.Option(help="Create this study, whose trials a robot makes, of --box or --cloud.", show_default=False),
    ] = "",
    storage: StudyStorage = "",
    out: Out = "",
    open_page: Open = False,
    **options: Any,
) -> None:
    """Touch an object whose shape is not known, learn it, and end with a grasp: in simulation, or with a robot."""
    from surehold.cli.compilation import announced
    from surehold.cli.folders import folder_of, removed_on_error
    from surehold.cli.session import NO_SUCCESS, Kept
    from surehold.cli.terminal import terminal
    from surehold.problems.grasp.exploration import GOALS

    if trials is not None and not 1 <= trials <= _MOST_TRIALS:
        raise InputError(f"--trials is {trials}; give 1 to {_MOST_TRIALS}.")
    if seed < 0:
        raise InputError(f"--seed is {seed}; give a whole number of 0 or more.")
    if start not in _STARTS:
        raise unknown_name("start", start, _STARTS)
    if goal not in GOALS:
        raise unknown_name("goal", goal, GOALS)
    if (options["cloud"] or box) and not study:
        given = "--cloud" if options["cloud"] else "--box"
        raise InputError(
            f"explore touches a known object in simulation; leave {given} out and give --start view, or name a --study "
            "whose trials a robot makes."
        )
    kept = Kept(study, storage)
    input_noise = noise_of(noise or "none", "bo")
    if input_noise is None:
        raise InputError("--noise is none; give what the hand strays, such as 0.03.")
    names = [name.strip() for name in options["variables"].split(",") if name.strip()]
    console = terminal()
    described = {"object": obj, **options, "variables": names}
    if study:
        simulated = {"--trials": trials is not None, "--start": start != "box", "--probe": probe}
        for option, given in (simulated | {"--out": bool(out), "--open": open_page}).items():
            if given:
                raise InputError(f"{option} is of an exploration in simulation; a robot's --study goes without it.")
        console.print(_created(kept, described, box, goal, input_noise, seed), markup=False, soft_wrap=True)
        return
    if not obj:
        raise InputError("no object is given; name one to touch in simulation, or a --study with --box or --cloud.")
    body = object_of(described, console)
    with announced(console):
        run = _Run(described, body, start, goal, probe, input_noise, seed)
    folder = folder_of(out, f"explore-{body.name}-seed{seed}")
    with removed_on_error(folder):
        touches, interrupted = trials or _TRIALS, False
        try:
            with shown_progress("touching", console) as progress:
                run.look()
                for k in range(touches):
                    run.touch()
                    progress((k + 1) / touches)
                    if k + 1 in _SHOWN or k + 1 == touches:
                        console.print(run.look(), markup=False)
        except KeyboardInterrupt:
            if not len(run.exploration.X):
                raise
            interrupted = True
            run.look()
        path = run.write(folder)
    if interrupted:
        console.print(f"Interrupted after {len(run.exploration.X)} of {touches} touches; keeping what was done.")
    console.print(run.answered(), markup=False)
    console.print(f"Page: {path}", markup=False, soft_wrap=True)
    if open_page:
        webbrowser.open(path.resolve().as_uri())
    if goal == "grasp" and not run.true > 0.0:
        console.print("No grasp that holds on the true shape was found; give more --trials.", markup=False)
        raise typer.Exit(NO_SUCCESS)


def _created(kept: "Kept", described: dict[str, Any], box: str, goal: str, noise: Any, seed: int) -> str:
    """Create a study of an unknown shape, and return what to do next."""
    from surehold.cli.study_options import quiet
    from surehold.studies.robot import RobotStudy
    from surehold.studies.search_space import SearchSpace
    from surehold.studies.settings import StudySettings
    from surehold.studies.touch import TouchedShape

    if described["object"] or bool(box) == bool(described["cloud"]):
        raise InputError("a study of an unknown shape takes one of --box x,y,z and --cloud FILE, and no object.")
    words: dict[str, Any] = {**described, "goal": goal}
    if box:
        try:
            words["box"] = [float(word) for word in box.split(",")]
        except ValueError:
            raise InputError(f"--box is {box!r}; give three edges x,y,z in meters, such as 0.08,0.06,0.12.") from None
    quiet()
    problem = TouchedShape(words, noise, seed).problem
    words["facet"] = problem.facet
    units = dict(zip(problem.box.names, problem.units, strict=True))
    made = RobotStudy.create(
        kept.study, StudySettings(SearchSpace(problem.box), noise, units, {"seed": seed}, {"touch": words}), kept.url
    )
    return (
        f"Created study {made.name} in {made.storage.shown}. Ask for a trial: surehold study ask {made.name} --json; "
        f"tell what it gave and touched: surehold study tell {made.name} ID VALUE --contacts FILE.json."
    )


class _Run:
    """An exploration of a known object, and what is shown of it."""

    def __init__(self, described: dict[str, Any], body: Any, start: str, goal: str, probe: bool, noise: Any, seed: int):
        from surehold.grasping.shape.completion import belief_of_cloud
        from surehold.grasping.shape.point_cloud import cleaned
        from surehold.grasping.shape.views import camera_towards, half_view, surface_points
        from surehold.problems.grasp.description import described_grasp
        from surehold.problems.grasp.exploration import Exploration, belief_of_box

        rng = np.random.default_rng(seed)
        if start == "box":
            belief = belief_of_box(body)
        else:
            camera = camera_towards(body, rng.uniform(0.0, 2.0 * np.pi), 0.5)
            cloud = cleaned(half_view(body, camera, 1000, 0.001, rng), camera=camera)
            belief = belief_of_cloud(cloud, name=body.name, mass=body.mass, friction=body.friction, cell=0.004)
        self.problem = described_grasp(described, belief.mean_object())
        self.real = self.problem.on(body)
        self.body, self.probe, self.noise, self.goal = body, probe, noise, goal
        self.exploration = Exploration(self.problem, belief, noise, goal, seed=seed)
        self._places = surface_points(body, 1500, np.random.default_rng(0))[0]
        self._felt = np.empty((0, 6))
        self.views: list[Any] = []
        self.notes: list[str] = []
        self.rows: list[tuple[str, ...]] = []
        self.answer: Any = None
        self.true = 0.0  # worth of the answer

    def touch(self) -> None:
        """Make a trial."""
        from surehold.problems.grasp.touch import touch_trial

        x = self.exploration.ask()
        touch = touch_trial(self.real.simulator, self.problem.pose(x), self.problem.posture(x), self.probe)
        felt = touch.observations
        self.exploration.tell(x, touch.grasp.quality, felt)
        self._felt = np.vstack([self._felt, np.hstack([felt.slope_points, felt.slopes])])

    def look(self) -> str:
        """Keep what is known of the shape now, and return it in words."""
        from surehold.grasping.object.distance_field import distance_field_of
        from surehold.problems.perturbation import robust_score
        from surehold.reports.run_report import Candidate, ContactSet, Scene, SceneMesh
        from surehold.reports.uncertain_shape import shape_meshes

        belief, n = self.exploration.belief, len(self.exploration.X)
        mean = belief.mean_object()
        error = 1e3 * np.abs(distance_field_of(mean).distance(self._places))
        deviation = belief.surface.deviation(mean.vertices)
        self.answer = self.exploration.recommend()
        self.true = robust_score(self.real, self.answer.x, self.noise, n=50).mean
        tried = float(self.exploration.y.max()) if n else np.nan
        beside = (2.4 * float(self.body.box_half_extents[0]) + 0.04, 0.0, 0.0)
        placed = (self.body.vertices + np.asarray(beside)).astype(np.float32)
        truth = SceneMesh("true shape", placed, self.body.faces, "#5f97d3")
        contacts = ContactSet(
            self._felt[:, :3], -self._felt[:, 3:], np.full(len(self._felt), 0.3), np.ones(len(self._felt))
        )
        scene = Scene((*shape_meshes(mean.vertices, mean.faces, deviation), truth), contacts)
        self.views.append(Candidate(f"after {n} touches", self.answer.x, float(n), scene=scene))
        text = (
            f"After {n} touch{'es' * (n != 1)}, {amount(len(self._felt), 'contact')}: surface off by "
            f"{error.mean():.1f} mm, 95 % within {np.quantile(error, 0.95):.1f} mm; grasp believed "
            f"{self.answer.mean:.3f}, true {self.true:.3f}."
        )
        self.notes.append(text)
        shown = (error.mean(), np.quantile(error, 0.95), 1e3 * deviation.mean())
        worth = (self.answer.mean, self.true, tried)
        self.rows.append(
            (str(n), *(f"{v:.1f}" for v in shown), *("none yet" if np.isnan(v) else f"{v:.3f}" for v in worth))
        )
        return text

    def answered(self) -> str:
        """Return the grasp that the exploration ends with, in words."""
        from surehold.cli.grasp import pose_text

        return (
            f"The grasp it ends with: {pose_text(self.real.grasp(self.answer.x))}; mean quality under the hand's noise "
            f"believed {self.answer.mean:.3f}, on the true shape {self.true:.3f}."
        )

    def write(self, folder: Path) -> Path:
        """Write page, numbers and picture, and return the page's path."""
        from surehold.cli.grasp import drawn
        from surehold.grasping.plain_data import grasp_to_dict
        from surehold.reports.run_report import Candidate
        from surehold.reports.scenes_page import render_scenes
        from surehold.reports.still import still_picture
        from surehold.reports.uncertain_shape import LEGEND
        from surehold.store.atomic import write_file

        grasp = self.real.grasp(self.answer.x)
        last = Candidate("the grasp, on the true shape", self.answer.x, -1.0, scene=drawn(self.real, grasp))
        note = f"{grasp.status}, quality {grasp.quality:.3f} with {amount(len(grasp.contacts), 'contact')}."
        goal = "to find a safe grasp" if self.goal == "grasp" else "to know the shape"
        text = (
            f"Touched {goal}. Left what is believed, right the true shape: {LEGEND} The dots are contacts. "
            f"{self.answered()} Below, errors are distances of the true surface to the one believed, the deviation is "
            "what the model says of them, and believed and true are those of the grasp that was best by then."
        )
        views = [*self.views, last]
        title, below = f"Exploring the {self.body.name}", "What the touches taught"
        page = render_scenes(title, text, views, [*self.notes, note], _COLUMNS, self.rows, below)
        write_file(folder / "explore.html", page)
        if self.views[-1].scene is not None:
            write_file(folder / "shape.png", still_picture(replace(self.views[-1].scene, contacts=None))[0])
        found = {
            "object": self.body.name,
            "x": self.answer.x,
            "mean": self.answer.mean,
            "std": self.answer.std,
            "grasp": grasp,
            "trials": {"x": self.exploration.X, "quality": self.exploration.y},
            "contacts": self._felt,
            "after": [dict(zip(_COLUMNS, row, strict=True)) for row in self.rows],
        }
        write_file(folder / "explore.json", json.dumps(grasp_to_dict(found), indent=1, allow_nan=False) + "\n")
        return folder / "explore.html"

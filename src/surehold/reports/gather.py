"""From a finished run to the data of its report: candidates, traces, and the model over one or two variables."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.maximization import Result
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.surrogates.protocol import Posterior, mixture
from surehold.problems.perturbation import RobustScore
from surehold.reports.run_report import (
    Candidate,
    ContactSet,
    ObjectBox,
    RunReport,
    Scene,
    SceneMesh,
    Surface,
    Variable,
)

if TYPE_CHECKING:
    from surehold.grasping.pictures.scene import Scene as GraspScene

__all__ = ["answers", "candidate", "grasp_scene", "report_of", "surfaces_of"]

_OBJECT, _HAND, _TOUCHING = "#5f97d3", "#c3bdb2", "#e0a183"
_LINE, _SQUARE = 301, 81  # grid points along a line, and along each side of a square


def answers(result: Result) -> dict[str, int]:
    """Return the trials to show by label, "highest observed" and "recommended"; one entry if they are the same."""
    highest = result.best_index
    recommended = int(np.argmin(np.abs(result.optimizer.box.to_unit(result.X) - _unit_answer(result)).max(axis=1)))
    if recommended == highest or np.array_equal(result.X[recommended], result.X[highest]):
        return {"recommended": highest}
    return {"highest observed": highest, "recommended": recommended}


def candidate(
    result: Result,
    label: str,
    index: int,
    score: RobustScore | None,
    *,
    status: str = "",
    pose: str = "",
    details: Mapping[str, str] | None = None,
    scene: Scene | None = None,
) -> Candidate:
    """Return the candidate of trial `index` with its re-queries; what the model expects of it where that is known."""
    told = result.recommendation if label == "recommended" else None
    return Candidate(
        label,
        result.X[index],
        float(result.y[index]),
        index,
        np.empty(0) if score is None else score.values,
        np.empty((0, result.X.shape[1])) if score is None else score.points,
        0 if score is None else score.n_failed,
        None if told is None or score is None else told.mean,
        None if told is None or score is None else told.std,
        status,
        pose,
        details or {},
        scene,
    )


def _of_constraints(result: Result) -> list[str]:
    """Return in words whether the recommended input satisfies what was required besides a good value."""
    best, trials = result.recommendation, result.optimizer.feasible
    found = [best.infeasible[:1].upper() + best.infeasible[1:]] if best.infeasible else []
    if best.outputs:
        expected = ", ".join(f"{name} {outcome.mean:.4g}" for name, outcome in best.outputs.items())
        found.append(
            f"Expected of the recommended input besides: {expected}; {best.feasible:.1%} of executions keep all "
            f"limits. {int(trials.sum())} of {len(trials)} trials are feasible."
        )
    return found


def report_of(
    result: Result,
    candidates: Sequence[Candidate],
    *,
    title: str,
    settings: Mapping[str, Any],
    noise: InputNoise | None,
    units: Mapping[str, str] | None = None,
    quality_name: str = "value",
    disturbance: str = "the input is off",
    planned_trials: int | None = None,
    notes: Sequence[str] = (),
    choices: Mapping[str, tuple[str, ...]] | None = None,
    hidden: Collection[str] = (),
    success_above: float | None = None,
    outcomes: Mapping[str, int] | None = None,
    advice: str = "",
) -> RunReport:
    """Return the report of a run: its trials, its candidates, its traces and its model.

    Parameters
    ----------
    noise
        The input noise that the candidates were scored with, whether or not the optimizer knew of it.
    units
        Unit of each variable by name, such as {"dx": "m", "rx": "rad"}.
    choices
        Text of each trial for parameters that are no numbers, by name.
    hidden
        Coordinates of the box that say nothing to a reader: those in which the choices are coded.
    success_above, outcomes, advice
        Of `RunReport`: what counts as a success, and what is said where there was none.

    Raises
    ------
    InputError
        If a unit names a variable that is not there.
    """
    optimizer = result.optimizer
    box = optimizer.box
    for name in units or {}:
        if name not in box.names:
            raise InputError(
                f"unit given for '{name}', which is no variable; the variables are {', '.join(box.names)}."
            )
    shown = [i for i, name in enumerate(box.names) if name not in hidden]
    variables = tuple(
        Variable(name, float(lower), float(upper), (units or {}).get(name, ""))
        for name, lower, upper in zip(box.names, box.lower, box.upper, strict=True)
        if name not in hidden
    )
    y = result.y
    robust = np.full(y.size, np.nan)
    for trial in result.trials:
        if trial.recommendation is not None and trial.index < y.size and optimizer.input_noise is not None:
            robust[trial.index] = trial.recommendation.mean
    return RunReport(
        title=title,
        variables=variables,
        X=result.X[:, shown],
        y=y,
        n_initial=optimizer.n_initial,
        best_trace=_running_maximum(y),
        candidates=tuple(
            replace(
                candidate,
                x=candidate.x[shown],
                noise=None if noise is None else _covariance_at(noise, box, candidate.x)[np.ix_(shown, shown)],
            )
            for candidate in candidates
        ),
        settings=settings,
        seed=optimizer.seed,
        quality_name=quality_name,
        disturbance=disturbance,
        robust_trace=robust if np.isfinite(robust).any() else None,
        success_above=success_above,
        outcomes=outcomes or {},
        advice=advice,
        surfaces=surfaces_of(optimizer.posterior, box, noise, candidates[-1].x, shown),
        interrupted=result.interrupted,
        planned_trials=planned_trials,
        notes=(*notes, *_of_constraints(result)),
        choices=choices or {},
    )


def grasp_scene(scene: "GraspScene") -> Scene:
    """Return a grasp's scene as the page draws it: the object see-through, the links that touch in another color."""
    thing = scene.object
    object_mesh = SceneMesh("object", thing.vertices, thing.faces, _OBJECT, see_through=True, poses=thing.poses)
    touching = set(scene.bodies)
    hand = [
        SceneMesh(mesh.name, mesh.vertices, mesh.faces, _TOUCHING if mesh.name in touching else _HAND, poses=mesh.poses)
        for mesh in scene.hand
    ]
    friction = np.full(len(scene.points), float(scene.friction))
    contacts = ContactSet(scene.points, scene.normals, friction, scene.weights)
    box = ObjectBox(scene.box_center, 2.0 * scene.box_half_extents, scene.box_axes)
    return Scene((object_mesh, *hand), contacts, box)


def surfaces_of(
    posterior: Posterior,
    box: Box,
    noise: InputNoise | None,
    x: NDArray[np.floating],
    shown: Sequence[int] | None = None,
) -> tuple[Surface, ...]:
    """Return the model over one or two of the variables that are shown (by default all), a slice through x if d > 2.

    Where more than two are shown it is over the two most important ones: a variable matters as much as the posterior
    mean varies along it through x.
    """
    center = np.clip(box.to_unit(x), 0.0, 1.0)
    among = list(range(box.dimension) if shown is None else shown)
    if not among:
        return ()
    over = sorted(_most_important(posterior, center, among)) if len(among) > 2 else among
    note = ""
    if len(over) < box.dimension:
        note = f"slice through the recommended point over {' and '.join(box.names[k] for k in over)}"
    if len(among) > 2:
        note += ", the two that matter most"
    surface = _surface(posterior, box, noise, center, tuple(over), _LINE if len(over) == 1 else _SQUARE, note)
    return (replace(surface, variables=tuple(among.index(k) for k in over)),)


def _surface(
    posterior: Posterior,
    box: Box,
    noise: InputNoise | None,
    center: NDArray[np.float64],
    variables: tuple[int, ...],
    points: int,
    note: str,
) -> Surface:
    line = np.linspace(0.0, 1.0, points)
    shape = (points,) * len(variables)
    queries = np.tile(center, (points ** len(variables), 1))
    for k, grid in zip(variables, np.meshgrid(*[line] * len(variables), indexing="ij"), strict=True):
        queries[:, k] = grid.ravel()
    mean, variance = mixture(posterior.moments(queries))
    robust_mean = robust_std = None
    if noise is not None:
        averaged, spread = mixture(Perturbations.of(noise, box, "unscented").outcome(posterior, queries))
        robust_mean, robust_std = averaged.reshape(shape), np.sqrt(spread).reshape(shape)
    axes = tuple(box.lower[k] + line * box.widths[k] for k in variables)
    return Surface(
        variables, axes, mean.reshape(shape), robust_mean, np.sqrt(variance).reshape(shape), robust_std, note
    )


def _covariance_at(noise: InputNoise, box: Box, x: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the covariance (d, d) of the noise at x, in the units of the box."""
    return noise.unit_covariance(box, x) * np.outer(box.widths, box.widths)


def _most_important(posterior: Posterior, center: NDArray[np.float64], among: Sequence[int]) -> list[int]:
    line = np.linspace(0.0, 1.0, 41)
    variation = []
    for k in among:
        queries = np.tile(center, (line.size, 1))
        queries[:, k] = line
        variation.append(float(np.var(mixture(posterior.moments(queries))[0])))
    order = np.argsort(-np.array(variation), kind="stable")
    return [among[i] for i in order[:2]]


def _unit_answer(result: Result) -> NDArray[np.float64]:
    return result.optimizer.box.to_unit(result.recommendation.x)


def _running_maximum(y: NDArray[np.float64]) -> NDArray[np.float64]:
    best = np.maximum.accumulate(np.where(np.isfinite(y), y, -np.inf))
    return np.where(np.isfinite(best), best, np.nan)

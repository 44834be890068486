"""The figures of the thesis that need no runs: functions, kernels, the unscented transformation, models, the metric.

Settings of the models are the thesis'; samples are drawn with a fixed seed.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.campaigns.plan import ProblemSetup
from surehold.campaigns.plan_file import load_plan
from surehold.campaigns.problem_setup import build_problem
from surehold.grasping.pictures.scene import grasp_scene
from surehold.optimization.noise.quadratures import sigma_points
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.protocol import Posterior, mixture
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.synthetic import synthetic_function
from surehold.reports.campaign_report import Band, Line, Panel, Picture, Points
from surehold.reports.run_report import Scene
from surehold.reports.scene import drawn_scene

__all__ = ["grasp_scenes", "illustrations"]

_GRID: Final = np.linspace(0.0, 1.0, 401)
_BLUE, _INK, _RED = "#0a65b3", "#1b1f25", "#c24e00"


def illustrations() -> list[Picture]:
    """Return Figures 3.1, 3.3, 3.4, 4.1, 4.4, 4.7 and 4.9."""
    return [_kernel(), _transformation(), _rkhs(), _functions(), _regression(), _metric(), _unscented_posterior()]


def _kernel() -> Picture:
    distance = np.linspace(0.0, 3.0, 301)

    def covariance(h: NDArray[np.float64]) -> NDArray[np.float64]:  # thesis (3.2)
        r = np.sqrt(5.0) * h
        return (1.0 + r + r**2 / 3.0) * np.exp(-r)

    lines = tuple(
        Line(distance, covariance(distance / scale), f"length-scale {scale:g}", color)
        for scale, color in ((0.5, _RED), (1.0, _INK), (2.0, _BLUE))
    )
    panel = Panel("Covariance by distance", "distance", "covariance", lines)
    return Picture("figure-3.1", "Figure 3.1: Matérn covariance function, ν = 5/2", (panel,))


def _transformation() -> Picture:
    """Propagate N(0.35, 0.2^2) through exp(3 x): the true density beside linearization and sigma points."""
    from scipy.special import ndtri

    center, deviation = 0.35, 0.2

    def bend(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.exp(3.0 * x)

    slope = 3.0 * np.exp(3.0 * center)
    offsets, weights = sigma_points(np.array([[deviation**2]]))[:2]
    values = bend(center + np.asarray(offsets)[:, 0])
    mean = float(weights @ values)
    std = float(np.sqrt(weights @ (values - mean) ** 2))
    quantiles = (np.arange(200_000) + 0.5) / 200_000
    outcome = bend(center + deviation * ndtri(quantiles))
    counts, edges = np.histogram(outcome, 160, range=(0.0, 12.0), density=True)
    y = np.linspace(-3.0, 12.0, 400)
    x = np.linspace(center - 3 * deviation, center + 3 * deviation, 400)
    function = Panel(
        "The function and the sigma points",
        "x",
        "f(x)",
        (
            Line(x, bend(x), "f"),
            Line(x, bend(np.array([center]))[0] + slope * (x - center), "linearized", _RED, dashed=True),
        ),
        points=(Points(center + np.asarray(offsets)[:, 0], values, "sigma points"),),
    )
    densities = Panel(
        "Density of f(x), x ~ N(0.35, 0.2²)",
        "f(x)",
        "density",
        (
            Line((edges[:-1] + edges[1:]) / 2, counts, "true"),
            Line(y, _normal(y, mean, std), "unscented", _BLUE, dashed=True),
            Line(y, _normal(y, float(bend(np.array([center]))[0]), abs(slope) * deviation), "linearized", _RED, True),
        ),
    )
    caption = (
        f"True mean {outcome.mean():.3f}, standard deviation {outcome.std():.3f}; unscented {mean:.3f}, {std:.3f}; "
        f"linearized {float(bend(np.array([center]))[0]):.3f}, {abs(slope) * deviation:.3f}."
    )
    return Picture(
        "figure-3.3", "Figure 3.3: a normal distribution through a nonlinear function", (function, densities), caption
    )


def _rkhs() -> Picture:
    problem = synthetic_function("rkhs")
    panel = Panel("RKHS", "x", "y", (Line(_GRID, _values(problem, _GRID[:, None]), "RKHS"),))
    return Picture("figure-3.4", "Figure 3.4: the RKHS function", (panel,))


def _functions() -> Picture:
    panels = [Panel("(a) RKHS", "x", "y", (Line(_GRID, _values(synthetic_function("rkhs"), _GRID[:, None])),))]
    ticks = np.linspace(0.0, 1.0, 101)
    points = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    for name, title in (("gm", "(b) GM"), ("gf", "(c) GF")):
        z = _values(synthetic_function(name), points).reshape(101, 101)
        panels.append(Panel(title, "x1", "x2", z=z))
    return Picture("figure-4.1", "Figure 4.1: synthetic functions", tuple(panels))


def _regression() -> Picture:
    X = np.random.default_rng(0).random((27, 1))
    panels = tuple(
        _posterior_panel(title, _conditioned(X, surrogate), X, np.zeros((1, 1)), np.ones(1))
        for title, surrogate in (("(a) Gaussian process", "gp"), ("(b) treed Gaussian process", "tgp"))
    )
    return Picture(
        "figure-4.4",
        "Figure 4.4: regression of 27 random samples of RKHS, GP against TGP",
        panels,
        "Mean and two standard deviations of the models with the thesis' settings.",
    )


def _unscented_posterior() -> Picture:
    X = np.random.default_rng(1).random((40, 1))
    posterior = _conditioned(X, "gp")
    offsets, weights = sigma_points(np.array([[0.01**2]]))[:2]
    panels = (
        _posterior_panel("(a) the model", posterior, X, np.zeros((1, 1)), np.ones(1)),
        _posterior_panel("(b) unscented, σx = 0.01", posterior, X, np.asarray(offsets), np.asarray(weights)),
    )
    return Picture(
        "figure-4.9",
        "Figure 4.9: RKHS posterior of 40 random samples, and its unscented transform",
        panels,
        "Mean and two standard deviations; (b) weighs means and variances at the sigma points, thesis (4.1).",
    )


def _metric() -> Picture:
    unit = np.linspace(0.1, 0.25, 241)
    lines = []
    for contact, label, color in (("single", "one contact a link (thesis)", _INK), ("graded", "soft touch", _BLUE)):
        grasp = {"object": "bottle", "variables": ("dx",), "contact": contact, "closing": "synergy", "quality": "simox"}
        problem = build_problem(ProblemSetup("grasp", 1, 1, grasp))
        lines.append(Line(unit, _values(problem, problem.box.from_unit(unit[:, None])), label, color))
    panel = Panel("Bottle, right-front", "dx, as a share of its range", "grasp quality (simox)", tuple(lines))
    return Picture(
        "figure-4.7",
        "Figure 4.7: profile of the grasp quality of the water bottle along dx",
        (panel,),
        "The noise along the first line is what the thesis blames for the treed process' results on grasps.",
    )


def grasp_scenes(answers: dict[str, tuple[list[float], list[float]]] | None = None) -> dict[str, Scene]:
    """Return the scenes of Figures 4.2 and 4.3, and 4.16 where there are answers for the bottle.

    Parameters
    ----------
    answers
        By label, the input (2,) in the unit cube, and the one of its worst re-query.
    """
    problems = load_plan("table-4.4-grasps").problems
    scenes = {}
    for obj in ("bottle", "mug", "glass", "drill"):
        problem = _grasp_of(problems[obj])
        center = problem.box.from_unit(np.full(problem.box.dimension, 0.5))
        figure = "4.2, 4.3" if obj == "glass" else "4.2"
        opened = grasp_scene(problem.simulator, problem.grasp(center), opened=True)
        scenes[f"Figure {figure}: {obj}"] = drawn_scene(opened)
    problem = _grasp_of(problems["bottle"])
    for label, (u, shaken) in (answers or {}).items():
        for word, place in (("", u), (", worst re-query", shaken)):
            x = problem.box.from_unit(np.array(place))
            name = f"Figure 4.16: {label}{word}, {float(np.asarray(problem(x))):.3f}"
            scenes[name] = drawn_scene(grasp_scene(problem.simulator, problem.grasp(x)))
    return scenes


def _grasp_of(on: ProblemSetup) -> GraspProblem:
    problem = build_problem(on)
    assert isinstance(problem, GraspProblem)
    return problem


def _conditioned(X: NDArray[np.float64], surrogate: str) -> Posterior:
    problem = synthetic_function("rkhs")
    optimizer = Optimizer(problem.box, surrogate=surrogate, preset="thesis-rkhs", n_initial=len(X))
    for x in X:
        optimizer.tell(x, float(np.asarray(problem(x))))
    return optimizer.posterior


def _posterior_panel(
    title: str,
    posterior: Posterior,
    X: NDArray[np.float64],
    offsets: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> Panel:
    """Draw sum_i w_i mean(x + offset_i) and sum_i w_i variance(x + offset_i), thesis (4.1)."""
    mean, variance = np.zeros(_GRID.size), np.zeros(_GRID.size)
    for offset, weight in zip(offsets, weights, strict=True):
        m, v = mixture(posterior.moments(_GRID[:, None] + offset))
        mean += weight * m
        variance += weight * v
    std = np.sqrt(np.maximum(variance, 0.0))
    problem = synthetic_function("rkhs")
    split = posterior.regions.lower[:, 0]
    borders = tuple((float(place), "split of the tree") for place in sorted(split[split > 0.0]))
    return Panel(
        title,
        "x",
        "y",
        (Line(_GRID, _values(problem, _GRID[:, None]), "RKHS", _RED, dashed=True), Line(_GRID, mean, "mean", _BLUE)),
        (Band(_GRID, mean - 2 * std, mean + 2 * std, _BLUE),),
        (Points(X[:, 0], _values(problem, X), "samples"),),
        borders,
    )


def _values(problem: Any, X: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(problem(X), dtype=np.float64)


def _normal(y: NDArray[np.float64], mean: float, std: float) -> NDArray[np.float64]:
    return np.exp(-0.5 * ((y - mean) / std) ** 2) / (std * np.sqrt(2.0 * np.pi))

"""Haptic exploration: touch an object whose shape is not known, learn it, and end with a grasp of it.

    x   variables of a grasp problem, (d,)      b   a shape that the belief holds possible, one of B draws
    q   quality of the grasp at x on b          e   input noise      sigma(c)   deviation of the surface at a point c

    safe grasp   a(x) = mean_b q(x, b) + KAPPA std_b q(x, b)                   where a good grasp may be
    shape        a(x) = sum_c sigma(c) over the contacts c of x on the mean shape   where a touch tells most
    answer       the x, of those tried and those thought good, of highest mean_e mean_b q(x + e, b)

`ask` takes the highest a(x) of a Sobol sequence, two of three points of which keep the problem's guess, and of steps
around what is best so far; `tell` adds what was felt.
(Dragiev, Toussaint and Gienger 2013; Castanheira and others 2018 with the unscented criterion in place of the mean.)
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.object.model import GraspObject
from surehold.grasping.shape.belief import ShapeBelief, grid_of
from surehold.grasping.shape.implicit_surface import Observations, spaced, surface_of
from surehold.grasping.shape.prior import PriorShape
from surehold.optimization.known_coordinates import places_of
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.strategy.initial_design import drawn_to
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.perturbation import perturbed_points

__all__ = ["GOALS", "Exploration", "ExploredGrasp", "belief_of_box", "belief_of_size"]

Array = NDArray[np.float64]

GOALS: Final = ("grasp", "shape")
KAPPA: Final = 1.0
_CANDIDATES: Final = 48
_NEAR: Final = 16  # of them around what is best so far
_STEP: Final = 0.06  # of these, in widths of the box
_ANSWERS: Final = 6  # that are compared under the hand noise
_DISTURBED: Final = 12
_SPREAD: Final = (0.25, 0.7)  # of the shape about the box: deviation and length scale, in mean half extents
_CELL: Final = 0.004  # m, of a grid of at most
_NODES: Final = 100_000  # nodes: each trial makes some shapes anew
_FREE_SPACING: Final = 0.008  # free points in the same cube of this edge count once [m]
_MOST_FELT: Final = 600  # contacts that the surface is learnt from: each is four observations, and costs are their cube
_GROWTH: Final = 1.0  # of the grid beyond the box, in deviations: what is told of a box is nearly right


class ExploredGrasp(NamedTuple):
    """What an exploration ends with."""

    x: Array  #: (d,) in the units of the problem's box
    mean: float  #: expected quality under shape and hand noise
    std: float  #: standard deviation of one execution: shape and hand noise
    quantile: float  #: value that 95 % of executions are better than


def belief_of_box(obj: GraspObject, cell: float = _CELL) -> ShapeBelief:
    """Return a belief that knows nothing of an object but its box, name, mass and friction."""
    box = PriorShape("box", obj.box_center, obj.axes, obj.box_half_extents)
    return _of_prior(box, cell, obj.name, obj.mass, obj.friction)


def belief_of_size(edges: Sequence[float], name: str = "box", mass: float | None = None) -> ShapeBelief:
    """Return a belief that knows the edges (3,) of a box [m] alone; its middle is the origin of the object's frame.

    Raises
    ------
    InputError
        If an edge is no length that a hand can grasp.
    """
    half = 0.5 * np.asarray(edges, dtype=np.float64)
    if half.shape != (3,) or not np.all((half > 0.002) & (half < 0.5)):
        raise InputError(f"box is {list(edges)}; give its three edges in meters, each from 0.004 to 1.")
    return _of_prior(PriorShape("box", np.zeros(3), np.eye(3), half), _CELL, name, mass, 0.5)


def _of_prior(box: PriorShape, cell: float, name: str, mass: float | None, friction: float) -> ShapeBelief:
    size = float(np.exp(np.mean(np.log(box.half))))
    surface = surface_of(box, Observations(), _SPREAD[0] * size, _SPREAD[1] * size)
    grid = grid_of(surface, cell, _GROWTH, _NODES)
    return ShapeBelief(surface, grid, name, mass, friction)


def _evenly(felt: Observations) -> Observations:
    """Return the contacts, or, of more than `_MOST_FELT`, one in each cube of a grid."""
    kept, edge = np.arange(len(felt.points)), 0.002
    while len(kept) > _MOST_FELT:
        kept, edge = spaced(felt.points, edge), 1.2 * edge
    names = ("points", "values", "noise", "slope_points", "slopes", "slope_noise")
    return Observations(**{name: getattr(felt, name)[kept] for name in names})


class Exploration:
    """A belief that grows with what a hand feels.

    Parameters
    ----------
    problem
        Poses and simulator settings, relative to the believed object; its own object is not looked at afterwards.
    belief
        What is known before the first touch.
    noise
        Input noise of the hand.
    goal
        "grasp" or "shape".
    shapes
        Draws of the shape, B.
    seed
        Of all draws.

    Raises
    ------
    InputError
        If the goal is unknown.
    """

    def __init__(
        self,
        problem: GraspProblem,
        belief: ShapeBelief,
        noise: InputNoise,
        goal: str = "grasp",
        shapes: int = 4,
        seed: int = 0,
    ):
        if goal not in GOALS:
            raise unknown_name("goal", goal, GOALS)
        self._problem, self._noise, self._goal, self._shapes, self._seed = problem, noise, goal, shapes, seed
        self._guess: Final = places_of(problem.box, "guess", problem.guess)
        self.belief = belief
        self.X: Array = np.empty((0, problem.box.dimension))  #: trials told, in the units of the box
        self.y: Array = np.empty(0)  #: their qualities
        self._known: Final = belief.surface.observations  # before the first touch
        self._felt = Observations()  # since, bounds apart
        self._seen, self._free = belief.free, np.empty((0, 4))

    def ask(self, pending: Array | None = None) -> Array:
        """Return the next trial (d,); `pending` (p, d) are under way."""
        box = self._problem.box
        candidates = self._candidates()
        imagined = self._imagined()
        if self._goal == "shape":
            scores = np.array([self._unknown(imagined, x) for x in candidates])
        else:
            values = np.array([imagined.over_shapes(x) for x in candidates])
            scores = values.mean(axis=1) + KAPPA * values.std(axis=1)
        known = self.X if pending is None else np.vstack([self.X, pending])
        if len(known):  # the same trial tells nothing new
            gaps = np.abs(box.to_unit(candidates)[:, None] - box.to_unit(known)[None]).max(axis=2).min(axis=1)
            scores = np.where(gaps < 1e-3, -np.inf, scores)
        return candidates[int(np.argmax(scores))]

    def tell(self, x: Array, quality: float, felt: Observations) -> None:
        """Add a trial at x (d,): what it was worth, and what was felt, in the object's frame."""
        self.restore(np.asarray(x)[None], np.array([quality]), [felt])

    def restore(self, X: Array, y: Array, felt: Sequence[Observations]) -> None:
        """Add trials at X (n, d), what they were worth (n,), and all that was felt."""
        self.X, self.y = np.vstack([self.X, X]), np.append(self.y, y)
        for each in felt:
            self._felt = self._felt + replace(each, free=np.empty((0, 4)))
            near = self.belief.grid.gap(each.free[:, :3]) < each.free[:, 3].max(initial=0.0)  # others lift no node
            self._free = np.vstack([self._free, each.free[near]])  # active anew: what is learnt may free them
        self._free = self._free[spaced(self._free[:, :3], _FREE_SPACING)]
        if felt:
            told = replace(self._known + _evenly(self._felt), free=self._free)
            self.belief = self.belief.knowing(told, np.vstack([self._seen, self._free]))

    def recommend(self, tried: bool = False) -> ExploredGrasp:
        """Return the grasp that is expected to hold best under shape and hand noise.

        `tried`: of the trials told, of those alone that held, with a value above 0, where there are any.
        """
        imagined = self._imagined()
        held = self.X[self.y > 0.0]
        told = held if len(held) else self.X
        candidates = told if tried else np.vstack([self.X, self._candidates()])
        first = np.array([imagined.over_shapes(x).mean() for x in candidates])
        answers = []
        for k in np.argsort(-first, kind="stable")[:_ANSWERS]:
            points = perturbed_points(candidates[k], self._problem.box, self._noise, _DISTURBED, self._seed)
            values = np.array([imagined.over_shapes(point) for point in points])
            mean, std = float(values.mean()), float(values.std())
            answers.append(ExploredGrasp(candidates[k], mean, std, float(np.quantile(values, 0.05))))
        return max(answers, key=lambda answer: answer.mean)

    def _imagined(self) -> GraspProblem:
        """Return the problem on the shapes that are possible now."""
        rng = np.random.default_rng([self._seed, len(self.X)])
        mean, *draws = self.belief.objects(self._shapes, rng)
        return self._problem.on(replace(mean, draws=tuple(draws)))

    def _candidates(self) -> Array:
        from scipy.stats import qmc

        box = self._problem.box
        rng = np.random.default_rng([self._seed, 1, len(self.X)])
        spread = drawn_to(self._guess, qmc.Sobol(box.dimension, rng=rng).random_base2(6)[:_CANDIDATES])
        if not len(self.X):
            return box.from_unit(spread)
        best = box.to_unit(self.X[np.argsort(-self.y, kind="stable")[:2]])
        near = best[rng.integers(len(best), size=_NEAR)] + _STEP * rng.standard_normal((_NEAR, box.dimension))
        return box.from_unit(np.vstack([np.clip(near, 0.0, 1.0), spread[: _CANDIDATES - _NEAR]]))

    def _unknown(self, imagined: GraspProblem, x: Array) -> float:
        """Return how uncertain the surface is where a grasp would touch the mean shape."""
        contacts = imagined.grasp(x).contacts
        return float(self.belief.surface.deviation(contacts.points[::4]).sum()) if len(contacts) else 0.0

"""Haptic exploration: touch an object whose shape is not known, learn it, and end with a grasp of it.

    x   variables of a grasp problem, (d,)      b   a shape that the belief holds possible, one of B draws
    q   quality of the grasp at x on b          e   input noise      sigma(c)   deviation of the surface at a point c

    safe grasp   a(x) = mean_b q(x, b) + KAPPA std_b q(x, b)                   where a good grasp may be
    shape        a(x) = sum_c sigma(c) over the contacts c of x on the mean shape   where a touch tells most
    answer       the x, of those tried and those thought good, of highest mean_e mean_b q(x + e, b)

`ask` takes the highest a(x) of a Sobol sequence and of steps around what is best so far; `tell` adds what was felt.
(Dragiev, Toussaint and Gienger 2013; Castanheira and others 2018 with the unscented criterion in place of the mean.)
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import unknown_name
from surehold.grasping.object.model import GraspObject
from surehold.grasping.shape.belief import ShapeBelief, grid_of
from surehold.grasping.shape.implicit_surface import Observations, surface_of
from surehold.grasping.shape.prior import PriorShape
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems.grasp.problem import GraspProblem
from surehold.problems.perturbation import perturbed_points

__all__ = ["GOALS", "Exploration", "ExploredGrasp", "belief_of_box"]

Array = NDArray[np.float64]

GOALS: Final = ("grasp", "shape")
KAPPA: Final = 1.0
_CANDIDATES: Final = 48
_NEAR: Final = 16  # of them around what is best so far
_STEP: Final = 0.06  # of these, in widths of the box
_ANSWERS: Final = 6  # that are compared under the hand noise
_DISTURBED: Final = 12
_SPREAD: Final = (0.25, 0.7)  # of the shape about the box: deviation and length scale, in mean half extents
_CELL: Final = 0.004  # m


class ExploredGrasp(NamedTuple):
    """What an exploration ends with."""

    x: Array  #: (d,) in the units of the problem's box
    mean: float  #: expected quality under shape and hand noise
    std: float  #: standard deviation of it over the shapes


def belief_of_box(obj: GraspObject, cell: float = _CELL) -> ShapeBelief:
    """Return a belief that knows nothing of an object but its box, name, mass and friction."""
    box = PriorShape("box", obj.box_center, obj.axes, obj.box_half_extents)
    size = float(np.exp(np.mean(np.log(box.half))))
    surface = surface_of(box, Observations(), _SPREAD[0] * size, _SPREAD[1] * size)
    return ShapeBelief(surface, grid_of(surface, cell), obj.name, obj.mass, obj.friction)


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
        self.belief = belief
        self.X: Array = np.empty((0, problem.box.dimension))  #: trials told, in the units of the box
        self.y: Array = np.empty(0)  #: their qualities
        self._felt = belief.surface.observations  # all of it, bounds apart
        self._free: Array = np.empty((0, 4))

    def ask(self) -> Array:
        """Return the next trial (d,)."""
        box = self._problem.box
        candidates = self._candidates()
        imagined = self._imagined()
        if self._goal == "shape":
            scores = np.array([self._unknown(imagined, x) for x in candidates])
        else:
            values = np.array([imagined.over_shapes(x) for x in candidates])
            scores = values.mean(axis=1) + KAPPA * values.std(axis=1)
        if len(self.X):  # the same trial tells nothing new
            gaps = np.abs(box.to_unit(candidates)[:, None] - box.to_unit(self.X)[None]).max(axis=2).min(axis=1)
            scores = np.where(gaps < 1e-3, -np.inf, scores)
        return candidates[int(np.argmax(scores))]

    def tell(self, x: Array, quality: float, felt: Observations) -> None:
        """Add a trial at x (d,): what it was worth, and what was felt, in the object's frame."""
        self.X = np.vstack([self.X, x])
        self.y = np.append(self.y, quality)
        surface = self.belief.surface
        self._felt = self._felt + replace(felt, free=np.empty((0, 4)))
        self._free = np.vstack([self._free, felt.free])  # bounds become active anew: what is learnt may free them
        learnt = surface_of(surface.prior, replace(self._felt, free=self._free), surface.std, surface.length)
        self.belief = self.belief.with_surface(learnt)

    def recommend(self) -> ExploredGrasp:
        """Return the grasp that is expected to hold best under shape and hand noise."""
        imagined = self._imagined()
        candidates = np.vstack([self.X, self._candidates()])
        # A trial was made on the true shape: its own value counts as one more draw.
        first = np.array([imagined.over_shapes(x).mean() for x in candidates])
        first[: len(self.X)] = 0.5 * (first[: len(self.X)] + self.y)
        best = np.argsort(-first, kind="stable")[:_ANSWERS]
        answers = []
        for x in candidates[best]:
            points = perturbed_points(x, self._problem.box, self._noise, _DISTURBED, self._seed)
            values = np.array([imagined.over_shapes(point) for point in points])
            answers.append(ExploredGrasp(x, float(values.mean()), float(values.mean(axis=0).std())))
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
        spread = qmc.Sobol(box.dimension, rng=rng).random_base2(6)[:_CANDIDATES]
        if not len(self.X):
            return box.from_unit(spread)
        best = box.to_unit(self.X[np.argsort(-self.y, kind="stable")[:2]])
        near = best[rng.integers(len(best), size=_NEAR)] + _STEP * rng.standard_normal((_NEAR, box.dimension))
        return box.from_unit(np.vstack([np.clip(near, 0.0, 1.0), spread[: _CANDIDATES - _NEAR]]))

    def _unknown(self, imagined: GraspProblem, x: Array) -> float:
        """Return how uncertain the surface is where a grasp would touch the mean shape."""
        contacts = imagined.grasp(x).contacts
        return float(self.belief.surface.deviation(contacts.points[::4]).sum()) if len(contacts) else 0.0

"""Grasping as a problem: pose offsets and posture in, quality of the closed grasp out.

    dx, dy, dz   offsets of the hand along the palm's default axes: along the fingers, across them (of a left hand
                 towards the index side), towards the object [m]
    rx, ry, rz   turns about the hand's grasp center, R = R_default Rx Ry Rz [rad]
    s1           posture: opposition of the thumb [rad]
    s2, s3       further amplitudes of a synergy that was learned with more than two components [rad]
    h, b, w      half extents of the object's box across the facet, along the fingers, and along the palm's y [m]

Bounds (after the published grasp experiments): dx within ±(b + 25 mm), dy within ±w, the distance of the grasp center
from the box center within h/3 and h/3 + 40 mm (1 + h / 50 mm), turns within ±45 degrees, s1 where it moves the thumb.
"""

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any, Final, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.grasp import Grasp
from surehold.grasping.hand.synergy import preshape_of
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.poses import Pose, default_pose, facet_axes
from surehold.grasping.simulator import Simulator
from surehold.optimization.box import Box
from surehold.problems.grasp.default_poses import GraspDefault, default_facet, grasp_default
from surehold.problems.grasp.options import (
    AMPLITUDES,
    OPTIONS,
    PLANS,
    THESIS_SIMULATOR,
    VARIABLES,
    GraspOptions,
    default_quality,
)
from surehold.problems.problem import checked_points

__all__ = ["GraspProblem"]

_KNOWN: Final = {**VARIABLES, **AMPLITUDES}


class GraspProblem:
    """The quality of a grasp as a function of some of its seven variables.

    Parameters
    ----------
    obj
        Name of a shipped object ("mug", "bottle", "glass", "drill") or a `GraspObject`. Of one that has `draws`, the
        poses are relative to the object itself.
    facet
        One of the 24 modes, "facet-thumb": the facet of the object's box that the palm faces, then the neighboring
        facet against which the thumb comes to press. By default "right-front", for the drill "bottom-front".
    variables
        Names of the free variables, a subset of `VARIABLES`; their order is the order of the coordinates.
    contact, quality, closing, friction, torsion, cones, task, collision, hand, preshape
        As in `surehold.grasping.Simulator`; these and the following are described in options.py. The quality is by
        default "epsilon", and "signed_epsilon" with more than three variables, where few poses hold.
    plan
        What a grasp of an object that has `draws` is worth: "shapes" (default): the mean over the draws; "mean": that
        on the object itself, the mean shape.
    preset
        "thesis": single contacts, the quality "simox", closing "synergy", polyhedral cones, collisions worth 0, and s1
        within ±pi; "" for none.
    bounds
        `{name: (lower, upper)}` in m and rad for free variables that shall not have the bounds given above.
    fixed
        `{name: value}` in m and rad for variables that are not free and shall not have their default: 0 for the
        offsets, and for s1 what `default` says.
    progress
        Called with the share that is done while the default pose of a mesh or of another hand is searched.

    Attributes
    ----------
    name : such as "mug, right-front"
    box : Box of the free variables
    units : tuple of their units, "m" or "rad"
    averaged : whether the value is the mean over the draws of an object of unknown shape
    default : standoff and s1 of the default pose

    Raises
    ------
    InputError
        If a name is unknown, a variable is named twice or both free and fixed, a bound or value is not finite, or an
        option contradicts the preset.
    """

    def __init__(
        self,
        obj: str | GraspObject = "mug",
        facet: str = "",
        variables: Sequence[str] = ("dx", "dy"),
        *,
        progress: Callable[[float], None] = lambda share: None,
        **options: Unpack[GraspOptions],
    ):
        for name in options:
            if name not in GraspOptions.__annotations__:
                raise unknown_name("option of a grasp", name, GraspOptions.__annotations__)
        given: dict[str, Any] = {name: OPTIONS[name].default for name in GraspOptions.__annotations__} | dict(options)
        preset, bounds, fixed = given.pop("preset"), given.pop("bounds") or {}, given.pop("fixed") or {}
        names = (variables,) if isinstance(variables, str) else tuple(variables)
        for name in [*names, *bounds, *fixed]:
            if name not in _KNOWN:
                raise unknown_name("variable", name, _KNOWN)
        if len(set(names)) != len(names) or not names:
            raise InputError(f"variables are {names}; name one or more of {', '.join(VARIABLES)}, each once.")
        for name in bounds:
            if name not in names:
                raise InputError(f"bounds are given for '{name}', which is not free; add it to the variables {names}.")
        for name, value in fixed.items():
            if name in names:
                raise InputError(f"'{name}' is both free and fixed; take it out of one of the two.")
            if not np.isfinite(value):
                raise InputError(f"'{name}' is fixed at {value!r}; give a finite number in {_KNOWN[name]}.")
        body = shipped_object(obj) if isinstance(obj, str) else obj
        facet = facet or default_facet(body)
        axes = facet_axes(facet)
        self.object: Final[GraspObject] = body
        self._placed: GraspObject = body  # whose box the poses are relative to
        self.facet: Final[str] = facet
        self.name: Final[str] = f"{body.name}, {facet}"
        if given["plan"] not in PLANS:
            raise unknown_name("plan", given["plan"], PLANS)
        if preset not in OPTIONS["preset"].choices:
            raise unknown_name("preset", preset, ["thesis"])
        for name, value in THESIS_SIMULATOR.items() if preset else ():
            if options.get(name, value) != value:
                raise InputError(
                    f"preset '{preset}' sets {name} to {value!r}, but {given[name]!r} is given; leave one of them out."
                )
        self._on_shapes: Final[bool] = given.pop("plan") == "shapes"
        self._settings: dict[str, Any] = given | (THESIS_SIMULATOR if preset else {})
        self._settings["preshape"] = given["preshape"] or None
        self._settings["quality"] = self._settings["quality"] or default_quality(names, preset)
        self._simulator: Simulator | None = None
        self._others: tuple[Simulator, ...] | None = None
        self._simulator = self._build()
        chosen = preshape_of(self._simulator.hand, self._simulator.preshape)
        self._s1_range = chosen.s1_range if preset else chosen.s1_useful
        self.default: Final[GraspDefault] = grasp_default(self.simulator, facet, progress)
        self._fixed: dict[str, float] = dict.fromkeys(VARIABLES, 0.0) | {"s1": self.default.s1} | dict(fixed)
        self._further = dict(zip(AMPLITUDES, chosen.further_ranges, strict=False))
        if "s1" in names and "s1" not in bounds and self._s1_range[0] >= self._s1_range[1]:
            raise InputError(
                f"the preshape '{self._simulator.preshape}' of hand '{self._simulator.hand.name}' has no posture "
                "variable; take s1 out of the variables."
            )
        for name in AMPLITUDES:
            if name in {*names, *fixed} and name not in self._further:
                raise InputError(
                    f"the preshape '{self._simulator.preshape}' of hand '{self._simulator.hand.name}' has no amplitude "
                    f"{name}; take it out, or learn a synergy of more components."
                )
        limits = self._limits(np.abs(axes.T) @ body.box_half_extents) | dict(bounds)
        self.box: Final[Box] = Box({name: limits[name] for name in names})
        self.units: Final[tuple[str, ...]] = tuple(_KNOWN[name] for name in names)

    @property
    def simulator(self) -> Simulator:
        """The simulator that runs the trials."""
        if self._simulator is None:  # in a worker process: the distance field is read from the cache, not sent along
            self._simulator = self._build()
        return self._simulator

    @property
    def guess(self) -> dict[str, float]:
        """What is known of good grasps before any trial, {name: value} of the free variables but dx and dy, m or rad.

        The palm is square to its facet, at the default standoff and posture, or as near to them as the bounds allow;
        where on the facet is not known. `Optimizer(guess=...)` takes it.
        """
        bounds = zip(self.box.names, self.box.lower, self.box.upper, strict=True)
        return {
            name: float(np.clip(self._fixed.get(name, 0.0), lower, upper))
            for name, lower, upper in bounds
            if name not in ("dx", "dy")
        }

    def warm_up(self) -> None:
        """Compile what a trial needs, if it is not yet in the cache: some seconds once for an installation."""
        self.simulator.warm_up()

    def pose(self, x: ArrayLike) -> Pose:
        """Return the pose of the palm in the object's frame at x (d,)."""
        return self._pose(self._values(self._one(x)))

    def posture(self, x: ArrayLike) -> float | tuple[float, ...]:
        """Return the posture variable s1 at x (d,) [rad]; all amplitudes of a preshape that has several."""
        return self._posture(self._values(self._one(x)))

    def grasp(self, x: ArrayLike) -> Grasp:
        """Return the whole outcome of the trial at x (d,)."""
        values = self._values(self._one(x))
        return self.simulator.grasp(self._pose(values), self._posture(values))

    def __call__(self, x: ArrayLike) -> float | NDArray[np.float64]:
        """Return the quality at x (d,) as a float, or the qualities at x (n, d) as an array (n,)."""
        points, single = checked_points(x, self.box)
        values = [self._value(point) for point in points]
        return values[0] if single else np.array(values)

    @property
    def averaged(self) -> bool:
        """Whether the value is the mean over the draws of an object of unknown shape."""
        return self._on_shapes and bool(self.object.draws)

    def over_shapes(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the quality of the trial at x (d,) on each of the object's draws (b,), or on itself where it has none.

        A trial on a draw is made at the pose relative to the mean shape: the hand does not know which shape is there.
        """
        values = self._values(self._one(x))
        if not self.object.draws:
            return np.array([self.simulator.grasp(self._pose(values), self._posture(values)).quality])
        if self._others is None:
            self._others = tuple(self._build(draw) for draw in self.object.draws)
        pose = self._pose(values)
        posture = self._posture(values)
        return np.array([simulator.grasp(pose, posture).quality for simulator in self._others])

    def on(self, obj: GraspObject) -> "GraspProblem":
        """Return the problem with the same poses and settings, with another object in the place of this one."""
        other = copy(self)
        vars(other).update(object=obj, _simulator=None, _others=None, _placed=self._placed)
        return other

    def _value(self, x: NDArray[np.float64]) -> float:
        return float(self.over_shapes(x).mean()) if self.averaged else self.grasp(x).quality

    def _one(self, x: ArrayLike) -> NDArray[np.float64]:
        points, _ = checked_points(x, self.box)
        if len(points) != 1:
            raise InputError(f"x holds {len(points)} points; give one point ({self.box.dimension},).")
        if not np.all(np.isfinite(points)):
            raise InputError(f"x = {points[0].tolist()} is not finite; give a point of {self.box!r}.")
        return points[0]

    def _pose(self, values: dict[str, float]) -> Pose:
        offsets = [values[name] for name in ("dx", "dy", "dz", "rx", "ry", "rz")]
        return default_pose(self.simulator.hand, self._placed, self.facet, self.default.standoff, offsets)

    def _posture(self, values: dict[str, float]) -> float | tuple[float, ...]:
        if not self._further:
            return values["s1"]
        return (values["s1"], *(values.get(name, 0.0) for name in self._further))

    def _values(self, x: NDArray[np.float64]) -> dict[str, float]:
        return self._fixed | self.box.as_dict(x)

    def _limits(self, half: NDArray[np.float64]) -> dict[str, tuple[float, float]]:
        along, across, depth = (float(v) for v in half)
        nearest = depth / 3.0
        farthest = nearest + 0.040 * (1.0 + depth / 0.050)
        quarter = np.pi / 4.0
        return {
            "dx": (-along - 0.025, along + 0.025),
            "dy": (-across, across),
            "dz": (self.default.standoff - farthest, self.default.standoff - nearest),
            "rx": (-quarter, quarter),
            "ry": (-quarter, quarter),
            "rz": (-quarter, quarter),
            "s1": self._s1_range,
            **self._further,
        }

    def _build(self, obj: GraspObject | None = None) -> Simulator:
        settings = dict(self._settings)
        return Simulator(settings.pop("hand"), obj or self.object, **settings)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_simulator": None, "_others": None}

    def __repr__(self) -> str:
        return f"<grasp {self.name}: {self._settings['contact']} contacts, {self.box!r}>"

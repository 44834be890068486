"""What a report of one run shows: plain data, gathered by the caller; nothing here computes or draws.

Letters: n trials, d variables, q perturbed re-queries of a candidate, c contacts.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk

__all__ = [
    "Candidate",
    "ContactSet",
    "Floats",
    "Neighbors",
    "ObjectBox",
    "RunReport",
    "Scene",
    "SceneMesh",
    "Surface",
    "Variable",
]

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Variable:
    """One input. Lengths in m and angles in rad are shown in mm and degrees, logarithms as what they stand for."""

    name: str
    lower: float
    upper: float
    unit: str = ""  #: "m", "rad", any other unit as text, or "" for none
    drawn: bool = False  #: whether nobody sets it, see `optimization.uncontrolled`
    whole: bool = False  #: whether it takes whole numbers only

    @property
    def factor(self) -> float:
        """What a value is multiplied with before it is shown."""
        return {"m": 1000.0, "rad": 180.0 / np.pi}.get(self.unit, 1.0)

    @property
    def shown_unit(self) -> str:
        """The unit that is shown."""
        if self.log:
            return self.unit[3:].strip()
        return {"m": "mm", "rad": "°"}.get(self.unit, self.unit)

    @property
    def label(self) -> str:
        """Name and shown unit, as on an axis and at the head of a column."""
        return f"{self.name} [{self.shown_unit}]" if self.shown_unit else self.name

    @property
    def log(self) -> bool:
        """Whether values are natural logarithms."""
        return self.unit.split(" ")[0] == "log"

    def shown(self, values: Floats) -> Floats:
        """Return values of the box as they are shown."""
        return np.exp(values) if self.log else values * self.factor

    @property
    def more_digits(self) -> int:
        """By how many digits values need more than usual, see `_more_digits`."""
        return 0 if self.log else _more_digits(self.lower, self.upper)


def _more_digits(low: float, high: float) -> int:
    """Return how many more digits tell numbers from low to high apart: 3 of 1013.1 and 1014.6, 0 of 0.1 and 0.6."""
    size, width = max(abs(low), abs(high)), high - low
    return min(round(math.log10(size) - math.log10(width)), 12) if width > 0.0 and size > width else 0


@dataclass(frozen=True)
class SceneMesh:
    """A triangle mesh of a scene; equal meshes of two scenes are stored once."""

    name: str
    vertices: Floats  #: (v, 3) [m], in the frame that `poses` places
    faces: NDArray[np.integer]  #: (f, 3) indices into the vertices
    color: str = "#8a93a3"  #: CSS hexadecimal
    see_through: bool = False  #: drawn half transparent on request, so that contacts inside are seen
    poses: Floats | None = None  #: (k, 3, 4) rotation and origin while the hand closes; None for one that rests at 0


@dataclass(frozen=True)
class ContactSet:
    """Where the hand touches."""

    points: Floats  #: (c, 3) [m]
    normals: Floats  #: (c, 3) unit vectors into the object
    friction: Floats  #: (c,) friction coefficients
    weights: Floats  #: (c,) share of a full contact, 0 to 1


@dataclass(frozen=True)
class Neighbors:
    """Where else the hand may end up within the input noise, and what became of it there."""

    points: Floats  #: (n, 3) places of the hand's grasp center [m]
    unsafe: NDArray[np.bool_]  #: (n,) the grasp there is bad


@dataclass(frozen=True)
class ObjectBox:
    """The oriented box of the object."""

    center: Floats  #: (3,) [m]
    size: Floats  #: (3,) edge lengths [m]
    rotation: Floats = field(default_factory=lambda: np.eye(3))  #: (3, 3) columns are the box's axes


@dataclass(frozen=True)
class Scene:
    """A grasp in three dimensions, in the frame of the object, z up."""

    meshes: tuple[SceneMesh, ...]
    contacts: ContactSet | None = None
    box: ObjectBox | None = None
    neighbors: Neighbors | None = None
    view: tuple[float, float, float] = (0.5, -0.8, 1.0)  #: direction from the object to the eye
    legend: str = ""  #: what the colors of its meshes mean, where they mean something


@dataclass(frozen=True)
class Candidate:
    """An answer that the run offers, and what became of it when it was re-queried with perturbed inputs."""

    label: str  #: "highest observed" ("lowest observed" where values are minimized) or "recommended"
    x: Floats  #: (d,) in the units of the box
    quality: float  #: value of the trial at x, undisturbed
    trial: int | None = None  #: place of that trial among those of the run, from 0
    values: Floats = field(default_factory=lambda: np.empty(0))  #: (q,) outcomes of the re-queries; empty without noise
    points: Floats = field(default_factory=lambda: np.empty((0, 0)))  #: (q + failed, d) where they were made
    n_failed: int = 0  #: re-queries that gave no value
    predicted_mean: float | None = None  #: what the model expects under the noise
    predicted_std: float | None = None  #: standard deviation of one execution
    predicted_error: float | None = None  #: standard deviation of what the model does not know of that mean
    status: str = ""  #: of a grasp, such as "ok" or "no contact"
    pose: str = ""  #: pose and posture in words
    details: Mapping[str, str] = field(default_factory=dict)  #: further lines of the table
    scene: Scene | None = None
    noise: Floats | None = None  #: (d, d) covariance of the input noise at x, in the units of the box
    minimized: bool = False  #: whether lower values are better
    risk: Risk = field(default_factory=Risk)  #: what the run was asked to maximize of the outcome
    without_value: float = math.nan  #: what a re-query that gave none counts as by a risk measure: the worst of the run
    predicted_worth: float | None = None  #: what the model expects the point to be worth by it, if it is not the mean

    @property
    def worth(self) -> float:
        """What the re-queries are worth by the risk measure that was asked for, by default their mean; or NaN."""
        if self.risk.name == "mean" or not self.values.size:
            return self.mean
        values = np.append(self.values, np.full(self.n_failed, self.without_value))
        return self.risk.of_executions(values, self.minimized)

    @property
    def mean(self) -> float:
        """Mean of the re-queries; NaN if there are none."""
        return float(np.mean(self.values)) if self.values.size else float("nan")

    @property
    def std(self) -> float:
        """Sample standard deviation of the re-queries; NaN if there are none."""
        if self.values.size == 0:
            return float("nan")
        return float(np.std(self.values, ddof=1)) if self.values.size > 1 else 0.0

    @property
    def bad(self) -> float:
        """The value that 95 % of the re-queries are better than; NaN if there are none.

        Infinite where so many gave no value.
        """
        if not self.values.size:
            return float("nan")
        without = math.inf if self.minimized else -math.inf
        values = np.append(self.values, np.full(self.n_failed, without))
        method = ("higher" if self.minimized else "lower") if self.n_failed else "linear"  # between it and a number
        return float(np.quantile(values, 0.95 if self.minimized else 0.05, method=method))

    @property
    def worst(self) -> float:
        """The worst of the re-queries; NaN if there are none, infinite where one of them gave no value."""
        if self.values.size == 0:
            return float("nan")
        worst = float(np.max(self.values) if self.minimized else np.min(self.values))
        return (math.inf if self.minimized else -math.inf) if self.n_failed else worst


@dataclass(frozen=True)
class Surface:
    """The model over one or two variables."""

    variables: tuple[int, ...]  #: one or two indices of variables
    axes: tuple[Floats, ...]  #: the grid along each, in the units of the box
    mean: Floats  #: (g,) or (g1, g2) posterior mean
    robust_mean: Floats | None = None  #: same shape, averaged over the input noise
    std: Floats | None = None  #: same shape, posterior standard deviation
    robust_std: Floats | None = None
    note: str = ""  #: such as "slice through the recommended point"


def extreme_of(y: Floats, best: float, minimized: bool) -> str:
    """Return what the best of the values (n,) that may be the answer is: "highest" or "lowest", or that "feasible"."""
    told = y[np.isfinite(y)]
    beaten = bool(np.any(told < best if minimized else told > best))
    return ("lowest" if minimized else "highest") + " feasible" * beaten


@dataclass(frozen=True)
class RunReport:
    """One finished or interrupted run."""

    title: str
    variables: tuple[Variable, ...]
    X: Floats  #: (n, d) trials, in the units of the box
    y: Floats  #: (n,) values; NaN where the trial failed
    n_initial: int
    best_trace: Floats  #: (n,) best value so far; NaN while there is none
    candidates: tuple[Candidate, ...]  #: best observed first, recommended last; one if they are the same trial
    settings: Mapping[str, Any]
    seed: int
    quality_name: str = "value"
    disturbance: str = "the input is off"  #: what an imprecise execution is called, such as "the hand is off"
    robust_trace: Floats | None = None  #: (n,) expected value under the noise of the current recommendation
    success_above: float | None = None  #: what a trial that succeeds is worth more than; None where any value will do
    outcomes: Mapping[str, int] = field(default_factory=dict)  #: how many trials ended how, where none succeeded
    advice: str = ""  #: what to try where no trial succeeded
    infeasible: str = ""  #: why no trial is known to keep all limits; empty where one does
    warning: str = ""  #: what is wrong with the model that the recommendation rests on
    surfaces: tuple[Surface, ...] = ()
    interrupted: bool = False
    planned_trials: int | None = None
    notes: tuple[str, ...] = ()
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  #: parameters that are no numbers: (n,) each
    parameters: tuple[Mapping[str, Any], ...] = ()  #: every input of the trials in the user's units, (n,), or empty
    outputs: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)  #: further outputs, (n,) each, or None
    feasible: NDArray[np.bool_] | None = None  #: (n,) which may be the answer; None where all that gave a value may
    minimized: bool = False  #: whether lower values are better
    normal_noise: bool = False  #: whether the input noise is normally distributed, the same everywhere
    ids: tuple[int, ...] = ()  #: what the trials are called, (n,); by their places, from 0, where empty
    counted: bool = False  #: whether values are shares of executions that succeeded, 1 or 0 of a single one

    def __post_init__(self):
        n, d = self.y.size, len(self.variables)
        if self.X.shape != (n, d) or self.best_trace.shape != (n,):
            raise InputError(
                f"report of {n} trials and {d} variables: X has shape {self.X.shape} (need ({n}, {d})), "
                f"best_trace {self.best_trace.shape} (need ({n},))."
            )
        if self.robust_trace is not None and self.robust_trace.shape != (n,):
            raise InputError(f"robust_trace has shape {self.robust_trace.shape}; it needs ({n},).")
        if self.ids and len(self.ids) != n:
            raise InputError(f"report of {n} trials has {len(self.ids)} ids; give one for each, or none.")
        if not self.candidates:
            raise InputError("a report needs at least one candidate; give the highest observed trial.")
        for candidate in self.candidates:
            if candidate.x.shape != (d,):
                raise InputError(f"candidate '{candidate.label}' has x of shape {candidate.x.shape}; it needs ({d},).")

    @property
    def noise(self) -> Floats | None:
        """(d, d) covariance of the input noise at the recommended point, in the units of the box."""
        return self.recommended.noise

    @property
    def risk(self) -> Risk:
        """What the run was asked to maximize of the outcome under the noise."""
        return self.recommended.risk

    @property
    def manner(self) -> str:
        """By what points are compared, in words: "on average", "by the mean of the worst 10 %"."""
        named = {"mean": "on average", "worst": "at worst"}
        return named.get(self.risk.name, f"by the {self.risk.words(self.minimized)}")

    @property
    def expected_name(self) -> str:
        """What `robust_trace` is, in words."""
        if self.risk.name == "mean":
            return "expected under the noise"
        return f"expected {self.risk.words(self.minimized)}"

    @property
    def axis_name(self) -> str:
        """What values are called on an axis, where those of trials that succeed or fail are shares."""
        return "share of executions that succeed" if self.counted else self.quality_name

    @property
    def succeeded(self) -> bool:
        """Whether any trial succeeded."""
        told = self.y[~self.failed]
        if self.infeasible:
            return False
        return bool(told.size) and (self.success_above is None or float(told.max()) > self.success_above)

    def called(self, candidate: Candidate) -> str:
        """Return what a candidate is called where it is shown; where no trial succeeded, nothing is recommended."""
        if not self.succeeded:
            return f"no success: the {f'{self.extreme} trial' if candidate is self.observed else 'point shown'}"
        alone = len(self.candidates) == 1 and not self.counted
        return f"{self.extreme} observed = recommended" if alone else candidate.label

    @property
    def numbers(self) -> NDArray[np.intp]:
        """What the trials are called, (n,): their ids in a study, or their places, from 0."""
        return np.array(self.ids, dtype=np.intp) if self.ids else np.arange(self.y.size)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which trials gave no value, (n,)."""
        return ~np.isfinite(self.y)

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Which trials gave no value, or of whose executions less than half succeeded, (n,)."""
        return self.failed | (self.counted & (self.y < 0.5))

    @property
    def more_digits(self) -> int:
        """By how many digits values need more than usual to be told apart: where all are far from 0."""
        told = self.y[~self.failed]
        return _more_digits(float(told.min()), float(told.max())) if told.size else 0

    @property
    def observed(self) -> Candidate:
        """The best trial observed."""
        return self.candidates[0]

    @property
    def extreme(self) -> str:
        """What the best value observed is, see `extreme_of`."""
        return extreme_of(self.y, self.best_trace[-1] if self.y.size else np.nan, self.minimized)

    @property
    def recommended(self) -> Candidate:
        """The answer."""
        return self.candidates[-1]

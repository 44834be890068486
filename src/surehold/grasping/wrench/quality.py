"""What a grasp is worth: the measures by name, each a number from contacts.

All measure wrenches that contacts can apply while the normal forces of all together sum to at most one (L1). Torques
are about the object's center of mass, divided by half the longest edge of its box, so that all six components of a
wrench are in units of force. H is the convex hull of the contacts' wrenches, h(u) its support function, t a wrench.

| name             | formula                                          | unit    | range    | 0 means
|------------------|--------------------------------------------------|---------|----------|------------------------
| `epsilon`        | max(0, min over unit u of h(u))                  | force   | >= 0     | some wrench not resisted
| `signed_epsilon` | the same; outside - c log(1 + d / c)             | force   | any      | on the border of closure
| `volume`         | volume of H in six dimensions, 0 without closure | force^6 | >= 0     | some wrench not resisted
| `simox`          | as the simulator of the thesis, see simox.py     | none    | >= 0     | fewer than 2 contacts
| `task`           | min over t of the largest s with -s t in H       | none    | >= 0     | some t not resisted
| `closure`        | 1 in force closure, else 0, by linear program    | none    | 0 or 1   | no force closure
| `min_weight`     | m max l, W' a = 0, sum a = 1, all m a >= l       | none    | 0 to 1   | some wrench not resisted
| `balance`        | 1 - residual of six pushes, by quadratic program | none    | 0 to 1   | a push is not lessened

epsilon: Ferrari and Canny 1992; task: Li and Sastry 1988; min_weight: Li et al. 2023; balance: Chen et al. 2024, see
equilibrium.py. signed_epsilon, after Veiga and Bernardino 2012, gives a model a slope everywhere: d is the distance
from 0 to H, and of a hand that touches nothing that of the object from the fingers, the mean over them, in torque
lengths. Both reach some times the best epsilon; the logarithm (c = 0.05) keeps differences between grasps that hold
visible beside those between grasps that do not: benchmarks/signed_quality.py.
Of the task, gravity in 14 directions is the default: the quality is then the weight that is held however the hand is
turned, divided by the sum of the normal forces.
Round cones are the default. Cones of eight edges underrate epsilon by a few percent on average and by more where few
contacts hold, and their value depends on where the edges point; round ones take up to twice as long, about half a
millisecond. Their epsilon is a minimum of h to rounding, `WrenchQuality.lower` a certified lower bound.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.choices import CONES, QUALITIES
from surehold.errors import InputError, unknown_name
from surehold.grasping.object.model import GraspObject
from surehold.grasping.wrench.ellipsoids import RoundCones
from surehold.grasping.wrench.equilibrium import balance_quality, min_weight
from surehold.grasping.wrench.force_closure import force_closure, gravity_wrenches, task_quality
from surehold.grasping.wrench.friction_cones import CONVENTIONS, Convention, finite_array
from surehold.grasping.wrench.simox import ObjectWrenchSpace, object_wrench_space, simox_quality
from surehold.grasping.wrench.wrench_space import WrenchQuality, wrench_quality

__all__ = ["GRAVITY_DIRECTIONS", "OUTSIDE", "Measure"]

Array = NDArray[np.float64]


_SIGNS = np.array([s for s in product((-1.0, 0.0, 1.0), repeat=3) if abs(s[0]) + abs(s[1]) + abs(s[2]) in (1.0, 3.0)])
#: Towards the faces and the corners of a cube, (14, 3).
GRAVITY_DIRECTIONS: Final = _SIGNS / np.linalg.norm(_SIGNS, axis=1)[:, None]

#: Distance [force] at which the slope outside is half of that inside: the epsilon of a good grasp.
OUTSIDE: Final = 0.05


def _lacking(distance: float) -> float:
    """Return what `signed_epsilon` is at a distance >= 0 from closure, both in units of force."""
    return -OUTSIDE * float(np.log1p(distance / OUTSIDE))


@dataclass(frozen=True, eq=False)
class Measure:
    """One measure of the contacts on one object.

    Raises InputError if a name is unknown or a number out of range.
    """

    name: str  #: one of `QUALITIES`
    obj: GraspObject
    friction: float  #: coefficient of friction
    torsion: float = 0.0  #: torsional friction of soft fingers: moment about the normal by normal force [m]
    edges: int = 8  #: of polyhedral cones, and of the volume
    cones: Literal["polyhedral", "round"] = "round"
    convention: Convention = "normal_unit"  #: or "unit_magnitude"
    task: ArrayLike | None = None  #: (k, 6) external force [N] and torque about the center of mass [N m] of each wrench

    def __post_init__(self) -> None:
        if self.name not in QUALITIES:
            raise unknown_name("quality measure", self.name, QUALITIES)
        if self.cones not in CONES:
            raise unknown_name("cones", self.cones, CONES)
        if self.convention not in CONVENTIONS:
            raise unknown_name("convention", self.convention, CONVENTIONS)
        if not 0.0 <= self.friction <= 10.0:
            raise InputError(f"friction is {self.friction!r}; give a number from 0 to 10, such as 0.5.")
        if not (np.isfinite(self.torsion) and 0.0 <= self.torsion < 0.1):
            raise InputError(f"torsion is {self.torsion!r} m; give a length from 0 to 0.1 m, such as 0.001.")
        if isinstance(self.edges, bool) or not isinstance(self.edges, int | np.integer) or not 3 <= self.edges <= 1000:
            raise InputError(f"edges of the friction cone are {self.edges!r}; give an integer, 3 to 1000, such as 8.")
        if self.task is not None and self.name != "task":
            raise InputError(f"a task is given, but the quality is {self.name!r}; ask for quality='task'.")
        self._task_wrenches  # noqa: B018  # a bad task is refused at once

    def wrench(self, points: Array, normals: Array, weights: Array) -> WrenchQuality:
        """Return epsilon with its bounds of contacts at points (c, 3) [m] with inward normals (c, 3), weights (c,)."""
        return wrench_quality(
            points,
            normals,
            friction=self.friction,
            edges=self.edges,
            torque_length=self.obj.torque_length,
            origin=self.obj.center_of_mass,
            convention=self.convention,
            weights=weights,
            torsion=self.torsion,
            cones=self.cones,
        )

    def round_cones(self) -> RoundCones | None:
        """Return what epsilon of round cones depends on, beside the contacts; None for another measure."""
        if self.name != "epsilon" or self.cones != "round":
            return None
        divisor = 1.0 if self.convention == "normal_unit" else float(np.sqrt(1.0 + self.friction * self.friction))
        length = float(self.obj.torque_length)
        center = np.array(self.obj.center_of_mass, dtype=np.float64)
        return RoundCones(float(self.friction), float(self.torsion) / length, divisor, length, center)

    def value(self, points: Array, normals: Array, wrench: WrenchQuality) -> float:
        """Return the measure of at least two contacts, whose `wrench` is given."""
        if self.name == "signed_epsilon":
            return wrench.signed_epsilon if wrench.signed_epsilon > 0.0 else _lacking(-wrench.signed_epsilon)
        if self.name == "simox":
            return simox_quality(points, normals, self._object_space)
        if self.name == "task":
            return task_quality(wrench.wrenches, self._task_wrenches)
        if self.name == "closure":
            return float(force_closure(wrench.wrenches))
        if self.name == "volume":
            return wrench.volume if wrench.force_closure else 0.0
        if self.name == "min_weight":
            return min_weight(wrench.wrenches)
        if self.name == "balance":
            return balance_quality(wrench.wrenches, len(wrench.wrenches) // len(points))
        return wrench.epsilon

    def without_contacts(self, gaps: Array) -> float:
        """Return the measure of a hand with fewer than two contacts and gaps (f, j) between links and object [m].

        0 for all measures but `signed_epsilon`.
        """
        if self.name != "signed_epsilon":
            return 0.0
        return _lacking(float(np.maximum(gaps.min(axis=1), 0.0).mean()) / self.obj.torque_length)

    @cached_property
    def _object_space(self) -> ObjectWrenchSpace:
        return object_wrench_space(self.obj.vertices, self.obj.faces)

    @cached_property
    def _task_wrenches(self) -> Array:
        if self.task is None:
            center = self.obj.center_of_mass
            return gravity_wrenches(1.0, center, GRAVITY_DIRECTIONS, self.obj.torque_length, center)
        wrenches = finite_array("task", self.task, (None, 6))
        if not np.any(wrenches):
            raise InputError("task must hold at least one external wrench that is not zero, shape (k, 6).")
        return np.hstack((wrenches[:, :3], wrenches[:, 3:] / self.obj.torque_length))

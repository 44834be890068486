"""What a grasp is worth when hand or object are not exactly where they were thought to be.

    d    shift along the three axes, m       c    grasp center of the hand, about which turns are made
    a    turns about the three axes, rad     D    the disturbance x -> c + Rx(a1) Ry(a2) Rz(a3) (x - c) + d

All six numbers are normal with standard deviation bound / 3, truncated at the bounds, ±10 mm and ±5 degrees by default:
the disturbance under which grasp simulators commonly score robustness. Either the hand is disturbed in its own frame,
or the object in the world. The draws are the first n of a scrambled Halton sequence of the seed: grasps that are
compared are shaken in the same way, and the mean of 24 such trials is as exact as that of 72 independent ones
(benchmarks/robust_quality_error.py).
"""

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name
from surehold.grasping.batch import grasp_batch
from surehold.grasping.grasp import STATUSES
from surehold.grasping.poses import Pose, check_pose
from surehold.grasping.simulator import Simulator

__all__ = ["DISTURBED", "PoseNoise", "RobustQuality", "disturbed_poses", "robust_quality"]

Array = NDArray[np.float64]

DISTURBED: Final = ("hand", "object")
_TRUNCATION = 3.0  # standard deviations
_TRIALS: Final = 24
_MOST: Final = 1_000_000  # trials: hours


class PoseNoise(NamedTuple):
    """Bounds of the disturbance, each three standard deviations."""

    shift: float = 0.010  #: along each axis [m]
    turn: float = float(np.radians(5.0))  #: about each axis [rad]


@dataclass(frozen=True, eq=False)
class RobustQuality:
    """Outcomes of n disturbed trials of one grasp. A hand that collides while open counts as quality 0."""

    mean: float  #: of all trials
    std: float  #: sample standard deviation (divisor n - 1) of all trials
    worst: float  #: lowest of all trials
    closure_rate: float  #: share of all trials in force closure
    collision_rate: float  #: share of the trials whose open hand collides
    mean_free: float  #: mean of the trials without collision; NaN if all collide
    closure_rate_free: float  #: share of force closure among the trials without collision; NaN if all collide
    values: Array  #: (n,) qualities, those of collisions 0

    def quantile(self, level: float) -> float:
        """Return the quality below which the share `level` (0 to 1) of the trials lies; InputError outside [0, 1]."""
        if not 0.0 <= level <= 1.0:
            raise InputError(f"quantile level is {level!r}; give a share from 0 to 1, such as 0.05.")
        return float(np.quantile(self.values, level))


def robust_quality(
    simulator: Simulator,
    pose: Pose,
    s1: float | tuple[float, ...] = 0.0,
    *,
    noise: PoseNoise | None = None,
    n: int = _TRIALS,
    seed: int = 0,
    disturbed: Literal["hand", "object"] = "hand",
    workers: int = 1,
) -> RobustQuality:
    """Return what the grasp at a pose of the palm in the world is worth under a noise of the pose.

    Parameters
    ----------
    simulator, pose, s1, workers
        As in `grasp_batch`.
    noise
        Bounds of the disturbance; ±10 mm and ±5 degrees if not given.
    n
        Number of trials.
    seed
        Of the draws.
    disturbed
        "hand": its pose, in its own frame about its grasp center; "object": its pose, in the world about that point.

    Raises
    ------
    InputError
        If n is not an integer of 1 to 1,000,000, a bound is negative or not finite, a name is unknown, or the pose is
        not finite.
    """
    poses = disturbed_poses(simulator, pose, noise, n, seed, disturbed)
    batch = grasp_batch(simulator, poses, np.tile(s1, (len(poses), 1)) if isinstance(s1, tuple) else s1, workers)
    collided = batch.status == STATUSES.index("initial collision")
    closed = batch.status == STATUSES.index("ok")
    values = np.where(collided, 0.0, batch.quality)
    some = not np.all(collided)
    return RobustQuality(
        mean=float(values.mean()),
        std=float(values.std(ddof=1)) if n > 1 else 0.0,
        worst=float(values.min()),
        closure_rate=float(closed.mean()),
        collision_rate=float(collided.mean()),
        mean_free=float(values[~collided].mean()) if some else np.nan,
        closure_rate_free=float(closed[~collided].mean()) if some else np.nan,
        values=values,
    )


def disturbed_poses(
    simulator: Simulator,
    pose: Pose,
    noise: PoseNoise | None = None,
    n: int = _TRIALS,
    seed: int = 0,
    disturbed: Literal["hand", "object"] = "hand",
) -> Array:
    """Return the poses (n, 3, 4) of the palm that `robust_quality` tries, in the world, with the object as it stands.

    A disturbance of the object is undone on the hand: only where they are to each other matters.
    """
    from scipy.spatial.transform import Rotation
    from scipy.special import ndtr, ndtri
    from scipy.stats import qmc

    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 1 <= n <= _MOST:
        raise InputError(f"number of disturbed trials is {n!r}; give an integer of 1 to {_MOST:,}.")
    if disturbed not in DISTURBED:
        raise unknown_name("disturbed body", disturbed, DISTURBED)
    check_pose(pose)
    bounds = noise or PoseNoise()
    if not all(np.isfinite(b) and b >= 0.0 for b in bounds):
        raise InputError(f"pose noise is {bounds}; give bounds of 0 or more, in meters and radians.")
    share = qmc.Halton(6, rng=seed).random(int(n))
    low = ndtr(-_TRUNCATION)
    draws = ndtri(low + share * (1.0 - 2.0 * low)) / _TRUNCATION  # in [-1, 1]
    shifts, turns = bounds.shift * draws[:, :3], bounds.turn * draws[:, 3:]
    turned = Rotation.from_euler("XYZ", turns).as_matrix()
    r, p = pose.rotation, np.asarray(pose.position)
    center = np.asarray(simulator.hand.grasp_center)
    if disturbed == "hand":
        rotations = r @ turned
        positions = p + (center + shifts - turned @ center) @ r.T
    else:
        center = p + r @ center
        back = np.swapaxes(turned, 1, 2)
        rotations = back @ r
        positions = center + np.einsum("nij,nj->ni", back, p - center - shifts)
    return np.concatenate([rotations, positions[:, :, None]], axis=2)

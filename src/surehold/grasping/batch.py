"""Many trials at once, on several processes.

A trial depends on its pose and posture alone, therefore the result is the same, bit for bit, whatever the number of
workers. What comes back are numbers; `Simulator.grasp` gives the contacts of a trial that deserves a second look.
"""

import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.grasping.grasp import STATUSES
from surehold.grasping.poses import Pose
from surehold.grasping.simulator import Simulator

__all__ = ["GraspBatch", "grasp_batch"]

_CHUNK = 100  # trials that a worker takes at a time, at most: a fifth of a second
_IDLE = 300  # seconds after which workers that have nothing to do end


@dataclass(frozen=True, eq=False)
class GraspBatch:
    """Outcomes of n trials, in the order of their poses."""

    quality: NDArray[np.float64]  #: (n,) the simulator's measure
    status: NDArray[np.int64]  #: (n,) index into `STATUSES`
    penetration: NDArray[np.float64]  #: (n,) depth of the open hand inside the object [m]
    contacts: NDArray[np.int64]  #: (n,) number of contacts
    fallbacks: NDArray[np.int64]  #: (n,) how often rounding spoiled a measure and a fallback was used

    def __len__(self) -> int:
        return len(self.quality)

    def shares(self) -> dict[str, float]:
        """Return the share of each status, {name: 0 to 1}."""
        return {name: float(np.mean(self.status == k)) if len(self) else 0.0 for k, name in enumerate(STATUSES)}


def grasp_batch(simulator: Simulator, poses: Sequence[Pose], s1: ArrayLike = 0.0, workers: int = 1) -> GraspBatch:
    """Try many grasps.

    Parameters
    ----------
    simulator
        Hand, object and measure.
    poses
        Poses of the palm in the world, n of them.
    s1
        Posture of each [rad], (n,), or one for all; of a preshape with k amplitudes, (n, k).
    workers
        Number of processes; they start in about a second and stay for the next call.

    Raises
    ------
    InputError
        If workers is not a positive integer, s1 has another shape, or a pose or posture is not finite.
    """
    if isinstance(workers, bool) or not isinstance(workers, int | np.integer) or workers < 1:
        raise InputError(f"workers are {workers!r}; give an integer of 1 or more.")
    postures = np.asarray(s1, dtype=np.float64)
    if postures.shape[:1] not in ((), (len(poses),)) or postures.ndim > 2:
        raise InputError(f"s1 has shape {postures.shape}; give one number or one for each of the {len(poses)} poses.")
    postures = postures if postures.ndim else np.broadcast_to(postures, len(poses))
    chunk = max(1, min(_CHUNK, len(poses) // (4 * workers)))
    parts = [slice(start, start + chunk) for start in range(0, len(poses), chunk)]
    if workers == 1 or len(parts) < 2:
        rows = [_outcomes(simulator, poses[part], postures[part]) for part in parts]
    else:
        from joblib.externals.loky import get_reusable_executor

        simulator.warm_up()  # compiled once, read from the cache by the workers
        content = pickle.dumps(simulator)
        pool = get_reusable_executor(int(workers), timeout=_IDLE, env={"OPENBLAS_NUM_THREADS": "1"})
        rows = list(
            pool.map(partial(_outcomes_there, content), [(poses[part], postures[part].copy()) for part in parts])
        )
    table = np.concatenate([np.empty((0, 5)), *rows])  # type: ignore[list-item]
    quality, status, penetration, contacts, fallbacks = table.T
    return GraspBatch(
        quality.copy(),
        status.astype(np.int64),
        penetration.copy(),
        contacts.astype(np.int64),
        fallbacks.astype(np.int64),
    )


@lru_cache(maxsize=2)
def _simulator(content: bytes) -> Simulator:
    """Return the simulator in a worker process: to make it takes as long as dozens of trials."""
    return pickle.loads(content)


def _outcomes_there(content: bytes, part: tuple[Sequence[Pose], NDArray[np.float64]]) -> NDArray[np.float64]:
    return _outcomes(_simulator(content), *part)


def _outcomes(simulator: Simulator, poses: Sequence[Pose], postures: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 5): quality, status, penetration, contacts, fallbacks."""
    rows = np.empty((len(poses), 5))
    for row, pose, s1 in zip(rows, poses, postures, strict=True):
        grasp = simulator.grasp(pose, tuple(s1.tolist()) if np.ndim(s1) else float(s1))
        fallbacks = 0 if grasp.wrench is None else grasp.wrench.fallbacks
        row[:] = grasp.quality, STATUSES.index(grasp.status), grasp.penetration, len(grasp.contacts), fallbacks
    return rows

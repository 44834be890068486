"""Many trials at once, on several cores.

A trial depends on its pose and posture alone, therefore the result is the same, bit for bit, whatever the number of
workers. What comes back are numbers; `Simulator.grasp` gives the contacts of a trial that deserves a second look.

Epsilon of round cones, the default, is measured in compiled code that lets other threads run: workers are threads, and
nothing is sent. The other measures are Python's, which runs in one thread at a time: workers are processes.
"""

import os
import pickle
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.amounts import amount
from surehold.errors import InputError
from surehold.grasping.grasp import STATUSES
from surehold.grasping.hand.synergy import preshape_of
from surehold.grasping.poses import FARTHEST, Pose, check_rotations
from surehold.grasping.simulator import Simulator
from surehold.grasping.trial_loop import UNDECIDED, run_trials
from surehold.grasping.wrench.ellipsoids import RoundCones
from surehold.store.parent import end_with

__all__ = ["GraspBatch", "grasp_batch"]

_CHUNK = 100  # trials that a worker takes at a time, at most: a tenth of a second
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


def grasp_batch(
    simulator: Simulator, poses: Sequence[Pose] | NDArray[np.float64], s1: ArrayLike = 0.0, workers: int = 1
) -> GraspBatch:
    """Try many grasps.

    Parameters
    ----------
    simulator
        Hand, object and measure.
    poses
        Poses of the palm in the world, n of them, or their matrices (n, 3, 4).
    s1
        Posture of each [rad], (n,), or one for all; of a preshape with k amplitudes, (n, k).
    workers
        Number of threads; for other measures than epsilon of round cones of processes, which start in about a second
        and stay for the next call.

    Raises
    ------
    InputError
        If workers is not a positive integer, s1 has another shape, a pose or posture is not finite, or a matrix is no
        rotation.
    """
    if isinstance(workers, bool) or not isinstance(workers, int | np.integer) or workers < 1:
        raise InputError(f"workers are {workers!r}; give an integer of 1 or more.")
    if isinstance(poses, Pose):
        raise InputError("one pose is given for a batch; give a list of poses, or use Simulator.grasp.")
    postures = np.asarray(s1, dtype=np.float64)
    if postures.shape[:1] not in ((), (len(poses),)) or postures.ndim > 2:
        raise InputError(f"s1 has shape {postures.shape}; give one number or one for each of the {len(poses)} poses.")
    postures = postures if postures.ndim else np.broadcast_to(postures, len(poses))
    most = 1 + len(preshape_of(simulator.hand, simulator.preshape).further)
    if postures.ndim > 1 and not 1 <= postures.shape[1] <= most:
        raise InputError(
            f"s1 has shape {postures.shape}, and preshape {simulator.preshape!r} {amount(most, 'amplitude')}; give "
            f"(n,), or at most (n, {most})."
        )
    chunk = max(1, min(_CHUNK, len(poses) // (4 * workers)))
    parts = [slice(start, start + chunk) for start in range(0, len(poses), chunk)]
    cones = simulator.measure.round_cones()
    if cones is not None:
        table = _compiled_outcomes(simulator, poses, postures, cones, parts, workers)
    elif workers == 1 or len(parts) < 2:
        table = _outcomes(simulator, poses, postures)
    else:
        table = _outcomes_in_processes(simulator, poses, postures, parts, workers)
    quality, status, penetration, contacts, fallbacks = table.T
    return GraspBatch(
        quality.copy(),
        status.astype(np.int64),
        penetration.copy(),
        contacts.astype(np.int64),
        fallbacks.astype(np.int64),
    )


def _compiled_outcomes(
    simulator: Simulator,
    poses: Sequence[Pose] | NDArray[np.float64],
    postures: NDArray[np.float64],
    cones: RoundCones,
    parts: list[slice],
    workers: int,
) -> NDArray[np.float64]:
    """Return (n, 5) as `_outcomes` does, from the compiled loop in threads."""
    matrices = np.empty((len(poses), 3, 4))
    for matrix, pose in zip(matrices, poses, strict=True):
        given = pose.matrix if isinstance(pose, Pose) else np.asarray(pose)
        if given.shape not in ((3, 4), (4, 4)):
            raise InputError(f"a pose of the batch has shape {given.shape}; give poses, or matrices (n, 3, 4).")
        matrix[:] = given[:3]
    if not (np.isfinite(matrices).all() and np.isfinite(postures).all()):
        raise InputError("a pose or posture of the batch is not finite; give finite numbers.")
    check_rotations(matrices[:, :, :3])
    farthest = float(np.abs(matrices[:, :, 3]).max(initial=0.0))
    if farthest > FARTHEST:
        raise InputError(f"a pose of the batch is {farthest:g} m away; give positions in meters, up to {FARTHEST:g}.")
    chosen = preshape_of(simulator.hand, simulator.preshape)
    first, *others = postures.T if postures.ndim > 1 else (postures,)
    starts = chosen.start + first[:, None, None] * chosen.posture
    for amplitudes, component in zip(others, chosen.further, strict=False):
        starts += amplitudes[:, None, None] * component
    table = np.empty((len(poses), 6))

    def run(part: slice) -> None:
        run_trials(
            simulator.field.nodes,
            simulator.field.frame,
            simulator.arrays,
            simulator.to_object,
            matrices[part],
            starts[part],
            simulator.model,
            simulator.closing == "adaptive",
            simulator.depth,
            cones,
            table[part],
        )

    if workers == 1 or len(parts) < 2:
        run(slice(None))
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(run, parts))
    quality, status, penetration, deep, contacts, fallbacks = table.T
    for i in np.flatnonzero(penetration > 0.0):
        quality[i] = simulator.collision_worth(float(deep[i]))
    outcomes = np.column_stack([quality, status, penetration, contacts, fallbacks])
    for i in np.flatnonzero(status == UNDECIDED).tolist():
        outcomes[i] = _outcomes(simulator, poses[i : i + 1], postures[i : i + 1])
    return outcomes


def _outcomes_in_processes(
    simulator: Simulator,
    poses: Sequence[Pose] | NDArray[np.float64],
    postures: NDArray[np.float64],
    parts: list[slice],
    workers: int,
) -> NDArray[np.float64]:
    from joblib.externals.loky import get_reusable_executor

    simulator.warm_up()  # compiled once, read from the cache by the workers
    content = pickle.dumps(simulator)
    pool = get_reusable_executor(
        int(workers), timeout=_IDLE, initializer=end_with, initargs=(os.getpid(),), env={"OPENBLAS_NUM_THREADS": "1"}
    )
    chunks = [(poses[part], postures[part].copy()) for part in parts]
    return np.concatenate(list(pool.map(partial(_outcomes_there, content), chunks)))


@lru_cache(maxsize=2)
def _simulator(content: bytes) -> Simulator:
    """Return the simulator in a worker process: to make it takes as long as dozens of trials."""
    return pickle.loads(content)


def _outcomes_there(
    content: bytes, part: tuple[Sequence[Pose] | NDArray[np.float64], NDArray[np.float64]]
) -> NDArray[np.float64]:
    return _outcomes(_simulator(content), *part)


def _outcomes(
    simulator: Simulator, poses: Sequence[Pose] | NDArray[np.float64], postures: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n, 5): quality, status, penetration, contacts, fallbacks."""
    rows = np.empty((len(poses), 5))
    for row, pose, s1 in zip(rows, poses, postures, strict=True):
        there = pose if isinstance(pose, Pose) else Pose.from_matrix(pose)
        grasp = simulator.grasp(there, tuple(s1.tolist()) if np.ndim(s1) else float(s1))
        fallbacks = 0 if grasp.wrench is None else grasp.wrench.fallbacks
        row[:] = grasp.quality, STATUSES.index(grasp.status), grasp.penetration, len(grasp.contacts), fallbacks
    return rows

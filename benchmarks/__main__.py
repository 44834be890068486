"""Speed and size in one table, beside what is asked for and the floor; compared with the last one and stored."""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.linalg import lapack
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from benchmarks import campaign_overhead, grasp_batch, growth, stored, study_overhead, study_service, suggestion_time
from benchmarks.stored import Row
from surehold.campaigns.methods import Surehold
from surehold.campaigns.peers import installed_peers
from surehold.defaults import MANY
from surehold.optimization.noise.input_noise import InputNoise
from surehold.problems import GraspProblem

GRASPS = 200
NOISE = InputNoise.unit(0.05)
#: Ours -> settings, and the share of Optuna's GPSampler that an ask may take in 7 variables.
OURS = {
    "gp": ((None, {"surrogate": "gp"}), 0.2),
    "gp, input noise": ((NOISE, {"surrogate": "gp"}), 0.5),
    "default": ((None, {}), 0.5),
    "default, input noise": ((NOISE, {}), 1.0),
}
PEERS = ("optuna-gp", "botorch")
BOTORCH = 1.0 / 3.0  # of its time, for all of ours
GROWTH = {1000: 0.2, 3000: 0.5, 10000: 1.0}  # seconds asked of an ask among so many trials; 2 of a first one
TRIALS = 0.0006  # 200,000 a minute on two cores


def seconds_of(work, repeats: int = 20) -> float:
    """Return the least CPU seconds of some work."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def factorization(n: int) -> float:
    """Return the seconds of dpotrf on an n x n matrix: the least that a new trial costs an exact Gaussian process."""
    A = np.eye(n) + 0.5
    return seconds_of(lambda: lapack.dpotrf(A, lower=1))


def asks(quick: bool) -> Iterator[Row]:
    """Yield an ask of ours and of peers, by number of trials and variables."""
    peers = (
        {} if quick else {name: maker for name, maker in installed_peers().items() if name in ("optuna-gp", "botorch")}
    )
    for n, d in suggestion_time.SETTINGS:
        theirs = {name: suggestion_time.seconds_per_ask(maker, n, d) for name, maker in peers.items()}
        for name, seconds in theirs.items():
            yield Row(f"ask, {name}, n = {n}, d = {d}", seconds)
        for name, (settings, share) in OURS.items():
            maker = lambda d, X, seed, s=settings: Surehold(d, X, seed, *s)  # noqa: E731
            shares = {"optuna-gp": share, "botorch": BOTORCH} if d == 7 else {"optuna-gp": 0.2, "botorch": 0.1}
            counted = () if d == 2 and settings[0] is not None else theirs.items()  # nothing was asked of those
            asked = min((shares[peer] * seconds for peer, seconds in counted), default=None)
            seconds = suggestion_time.seconds_per_ask(maker, n, d)
            yield Row(f"ask, surehold {name}, n = {n}, d = {d}", seconds, asked, factorization(n))


def grown(quick: bool) -> Iterator[Row]:
    """Yield asks among many trials and in many variables, with the default settings."""
    for name, (cold, warm, memory) in growth.rows((300, 1000) if quick else growth.SIZES):
        n = int(name.split(",")[0].removeprefix("n = "))
        yield Row(f"first ask, default, {name}", cold, 2.0 if n in GROWTH else None)
        yield Row(f"ask, default, {name}", warm, GROWTH.get(n), factorization(min(n, MANY)), memory)
    for name, seconds in growth.in_many_variables():
        yield Row(f"ask, default, {name}", seconds)


def grasps(quick: bool) -> Iterator[Row]:
    """Yield mean CPU seconds of a trial for poses all over the box, and wall seconds of batches."""
    for contact in ("single", "graded", "patch"):
        problem = GraspProblem("mug", contact=contact)
        problem.warm_up()
        points = problem.box.from_unit(qmc.LatinHypercube(2, rng=0).random(GRASPS))
        problem.grasp(points[0])
        start = time.process_time()
        for x in points:
            problem.grasp(x)
        seconds = (time.process_time() - start) / GRASPS
        yield Row(f"grasp, mug, {contact}", seconds, None, grasp_batch.look(problem.simulator))
    for name, seconds in grasp_batch.rows(poses=400 if quick else grasp_batch.POSES):
        asked = 0.02 if name.startswith("robust") else TRIALS / 2 if "2 processes" in name else TRIALS
        yield Row(name, seconds, asked, grasp_batch.look(problem.simulator))


def studies(quick: bool) -> Iterator[Row]:
    """Yield asks of studies among many trials, of a service with many clients, and the overhead of a campaign."""
    if quick:
        return
    with tempfile.TemporaryDirectory() as folder:
        for trials in (10_000, 100_000):
            following, opened, first = study_overhead.many(f"sqlite:///{folder}/{trials}.db", trials)
            copied = np.zeros((trials, 3))
            floor = seconds_of(copied.copy)
            asked = (1.5, 0.5) if trials == 10_000 else (None, None)
            yield Row(f"first ask of a study, SQLite, {trials} trials", opened + first, asked[0], floor)
            yield Row(f"ask of a study, SQLite, {trials} trials", float(np.median(following[1:])), asked[1], floor)
        found = study_service.attack(f"{folder}/journal.log", 320, 32, 5.0)
        yield Row("ask over HTTP, 32 clients, trials of 5 s, median", float(found["ask, median [s]"]), 0.1)  # type: ignore[arg-type]
    overhead = campaign_overhead.measure(10_000, 2).overhead
    yield Row("overhead of a run, Dask, 2 processes, 10,000 runs", overhead, 0.005)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    wanted = "without peers, services, clusters, and 3,000 trials and more"
    parser.add_argument("--quick", action="store_true", help=wanted)
    quick = parser.parse_args().quick
    before, rows = stored.last(), []
    load = os.getloadavg()[0]
    parts = [partial(part, quick) for part in (asks, grasps, grown, studies)]
    with threadpool_limits(1):
        yardsticks = [suggestion_time.yardstick()]
        for part in parts:
            for row in part():
                rows.append(row)
                print(f"{row.name}: {row.seconds:.4g} s", file=sys.stderr, flush=True)
            yardsticks.append(suggestion_time.yardstick())
    yardstick = float(np.median(yardsticks))
    print(*stored.lines(rows, yardstick, before), sep="\n")
    print(f"yardstick {1e3 * yardstick:.3f} ms, load {load:.1f}; stored in {stored.store(rows, yardstick, load)}")


if __name__ == "__main__":
    main()

"""What a campaign on a Dask cluster of several processes takes beside its runs, and how that goes on with many workers.

    python -m benchmarks.campaign_overhead [--runs 10000] [--workers 4] [--backend dask] [--simulate 1000]

Runs of two random trials, some milliseconds each. Overhead: the wall time of the campaign from its first row to its
last, less the CPU time of the runs themselves on as many cores as work; a run. The start of the cluster is printed by
itself. `caller` is the CPU time of the calling process, which holds the scheduler and writes the table.

`--simulate` measures that time with many runs a parcel and with one, and simulates so many workers, each with one
parcel at work and one that is ready: all of them report to one caller, which takes one report after the other.
"""

import argparse
import heapq
import os
import tempfile
import time
from typing import NamedTuple

import numpy as np

from surehold.campaigns import runner
from surehold.campaigns.plan import MethodSetup, Plan, ProblemSetup


class Overhead(NamedTuple):
    """What was measured, in seconds."""

    start: float
    """until the first row was written"""
    run: float
    """mean CPU time of a run itself"""
    wall: float
    """of a run, from the first row to the last, all workers together"""
    overhead: float
    """of a run"""
    caller: float
    """CPU of the calling process, which holds the scheduler and writes the table, of a run"""


def measure(runs: int, workers: int, backend: str = "dask") -> Overhead:
    """Make the runs and return what they took beside themselves."""
    problem = ProblemSetup("rkhs", trials=2, initial=2)
    plan = Plan("short", "Short runs", {"rkhs": problem}, {"random": MethodSetup("random")}, runs=runs)
    moments, seconds = [], []

    def note(progress, row):
        if row is not None:
            moments.append((time.perf_counter(), time.process_time()))
            seconds.append(row["cpu_seconds"])

    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        runner.run_campaign(plan, folder, workers=workers, backend=backend, observer=note)
    (first, cpu), (last, cpu_last) = moments[0], moments[-1]
    run, wall = sum(seconds) / runs, (last - first) / runs
    cores = min(workers, len(os.sched_getaffinity(0)))
    return Overhead(first - began, run, wall, wall - run / cores, (cpu_last - cpu) / runs)


def simulated(workers: int, mean: float, by_report: float, by_run: float) -> tuple[int, float]:
    """Return how many runs were made, and the share of the time in which workers worked, the beginning included.

    An hour of runs for each worker, of durations with that mean [s] and a third of it as standard deviation; the caller
    takes `by_report` for a report and `by_run` for each row in it.
    """
    rng = np.random.default_rng(0)
    runs = min(max(int(runner.parcel_seconds(workers) / mean), 1), runner.LARGEST_PARCEL)
    busy_until, caller, worked, sent = np.zeros(workers), 0.0, 0.0, 0
    parcels = max(round(3600 / (runs * mean)), 2)
    reports: list[tuple[float, int]] = []

    def send(worker: int) -> None:
        nonlocal worked, sent
        took = float(rng.gamma(9 * runs, mean / 9))
        busy_until[worker] = max(busy_until[worker], caller) + took
        worked, sent = worked + took, sent + 1
        heapq.heappush(reports, (float(busy_until[worker]), worker))

    for worker in [*range(workers), *range(workers)]:  # one to work on, one that is ready
        caller += by_report
        send(worker)
    while reports:
        moment, worker = heapq.heappop(reports)
        caller = max(caller, moment) + by_report + runs * by_run
        if sent < parcels * workers:
            send(worker)
    return sent * runs, worked / (workers * caller)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=4)
    parser.add_argument("--backend", default="dask")
    parser.add_argument("--simulate", type=int, default=0, metavar="WORKERS")
    options = parser.parse_args()
    found = measure(options.runs, options.workers, options.backend)
    print(
        f"{options.runs} runs by {options.workers} workers ({options.backend}); started in {found.start:.1f} s; a run:"
    )
    for name, value in found._asdict().items():
        if name != "start":
            print(f"{name:>12} {1e3 * value:8.2f} ms")
    if options.simulate:
        runner.LARGEST_PARCEL = 1
        alone = measure(max(options.runs // 10, 100), options.workers, options.backend).caller
        print(f"caller, a run that travels alone {1e3 * alone:.2f} ms; simulated with {options.simulate} workers:")
        runner.LARGEST_PARCEL = 200
        for mean in (0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 60.0):
            runs, share = simulated(options.simulate, mean, alone - found.caller, found.caller)
            print(f"  {runs} runs of {mean:5.2f} s: workers work {share:.1%} of the time")


if __name__ == "__main__":
    main()

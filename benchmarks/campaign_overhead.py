"""What a campaign on a Dask cluster of several processes takes beside its runs, and how that goes on with many workers.

    python -m benchmarks.campaign_overhead [--runs 10000] [--workers 4] [--backend dask]

Runs of two random trials, some milliseconds each. Overhead of a run: the wall time of the campaign beside the time of
the runs themselves, shared by the workers that have a core, a run; without the start of the cluster, which is printed.
"""

import argparse
import os
import tempfile
import time
from typing import NamedTuple

from surehold.campaigns.plan import MethodSetup, Plan, ProblemSetup
from surehold.campaigns.runner import run_campaign


class Overhead(NamedTuple):
    """What was measured, in seconds."""

    start: float
    """until the first row was written"""
    run: float
    """mean duration of a run itself"""
    wall: float
    """of a run, from the first row to the last, all workers together"""
    overhead: float
    """of a run"""
    caller: float
    """CPU of the calling process, which holds the scheduler and writes the table, of a run"""


def short_runs(runs: int) -> Plan:
    """Return a plan of so many runs of two trials each."""
    problem = ProblemSetup("rkhs", trials=2, initial=2)
    return Plan("short", "Short runs", {"rkhs": problem}, {"random": MethodSetup("random")}, runs=runs)


def measure(runs: int, workers: int, backend: str) -> Overhead:
    """Make the runs and return what they took beside themselves."""
    moments, seconds = [], []
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()

        def note(progress, row):
            if row is not None:
                moments.append((time.perf_counter(), time.process_time()))
                seconds.append(row["seconds"])

        run_campaign(short_runs(runs), folder, workers=workers, backend=backend, observer=note)
    (first, cpu), (last, cpu_last) = moments[0], moments[-1]
    run, wall = sum(seconds) / runs, (last - first) / runs
    cores = min(workers, len(os.sched_getaffinity(0)))
    return Overhead(first - began, run, wall, wall - run / cores, (cpu_last - cpu) / runs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=4)
    parser.add_argument("--backend", default="dask")
    options = parser.parse_args()
    found = measure(options.runs, options.workers, options.backend)
    print(
        f"{options.runs} runs by {options.workers} workers ({options.backend}); started in {found.start:.1f} s; a run:"
    )
    for name, value in found._asdict().items():
        if name != "start":
            print(f"{name:>12} {1e3 * value:8.2f} ms")


if __name__ == "__main__":
    main()

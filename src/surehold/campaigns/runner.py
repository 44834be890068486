"""Making the runs of a plan: worker processes or a cluster, one writer, and nothing lost but the runs in flight."""

import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import ExitStack, chdir, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

from surehold.campaigns.methods import checked_method
from surehold.campaigns.plan import Plan, Task
from surehold.campaigns.problem_setup import build_problem
from surehold.campaigns.single_run import run_once
from surehold.campaigns.table import Records, opened
from surehold.errors import InputError, SureholdError, unknown_name
from surehold.extras import require
from surehold.store.parent import end_with

__all__ = ["Progress", "checked_backend", "run_campaign"]

BACKENDS = ("loky", "dask")
REPORTS: Final = 50  # a second, of all workers: one takes the calling process, with Dask's scheduler, some milliseconds
LARGEST_PARCEL: Final = 200  # runs
_STALE: Final = 5.0  # seconds after which a cluster is asked again how many workers it has
_ARRIVAL: Final = 60.0  # seconds to wait for its first one
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass
class Progress:
    """How far a campaign is."""

    total: int
    """runs of this call, those made before included"""
    done: int
    """of them, made by now, failed ones included"""
    failed: int
    workers: int
    waiting: dict[tuple[str, str], int] = field(default_factory=dict)
    """runs still to be made, by problem and method"""
    _seconds: dict[tuple[str, str], tuple[int, float]] = field(default_factory=dict)

    def finish(self, row: dict[str, Any]) -> None:
        """Count a row."""
        key = (row["problem"], row["method"])
        self.done += 1
        self.failed += row["status"] == "failed"
        self.waiting[key] -= 1
        self.learn(row)

    def learn(self, row: dict[str, Any]) -> None:
        """Take in how long a run took."""
        if row["status"] == "done":
            key = (row["problem"], row["method"])
            runs, seconds = self._seconds.get(key, (0, 0.0))
            self._seconds[key] = runs + 1, seconds + row["seconds"]

    @property
    def remaining_seconds(self) -> float | None:
        """Estimated time to the end: each waiting run as long as those of its problem and method; None if unknown."""
        means = {key: seconds / runs for key, (runs, seconds) in self._seconds.items()}
        if not means:
            return None
        typical = sum(means.values()) / len(means)
        return sum(n * means.get(key, typical) for key, n in self.waiting.items()) / self.workers


def run_campaign(
    plan: Plan,
    folder: str | Path,
    *,
    runs: int | None = None,
    workers: int = 1,
    backend: str = "loky",
    shard: tuple[int, int] = (1, 1),
    only: Iterable[str] = (),
    retry: bool = False,
    observer: Callable[[Progress, dict[str, Any] | None], Any] = lambda progress, row: None,
) -> Records:
    """Make the runs of a plan that the folder's tables do not hold yet; return all that they hold then.

    Parameters
    ----------
    folder
        Where the table is, or shall be.
    runs, shard, only
        Which runs of the plan, see `Plan.tasks`.
    workers
        Processes; 1 works in this one.
    backend
        "loky" (processes on this machine), "dask" (a cluster of `workers` on this machine) or `dask://HOST:PORT` (a
        cluster that is there).
    retry
        Whether to make runs again that failed.
    observer
        Called with the progress at the start (row None) and after every run.

    Ctrl-C and a kill lose the runs in flight; the same call continues. A failing run is recorded with its error.

    Raises
    ------
    InputError
        For bad arguments, settings and problems, before anything is run; for tables that another process writes or
        another version or plan has written.
    SureholdError
        If the table cannot be written, or a worker process dies.
    """
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise InputError(f"workers is {workers!r}; give a whole number of 1 or more.")
    kind, address = checked_backend(backend)
    tasks = plan.tasks(runs, shard, only)
    cells = plan.cells(only)
    for label, on in {cell.problem: cell.on for cell in cells}.items():
        try:
            with chdir("."):  # the file of a function may go to another folder when it is loaded
                build_problem(on)  # also leaves what is kept on disk, so that workers do not make it side by side
        except InputError as error:
            raise InputError(f"problem '{label}': {error}") from None
    for cell in cells:
        checked_method(cell)
    with opened(folder, plan, shard) as table:
        records = table.records
        have = records.done if retry else records.rows
        todo = [task for task in tasks if _key(task) not in have]
        progress = Progress(len(tasks), len(tasks) - len(todo), 0, workers)
        for task in todo:
            cell = (task.cell.problem, task.cell.method)
            progress.waiting[cell] = progress.waiting.get(cell, 0) + 1
        for row in records.done.values():
            progress.learn(row)
        observer(progress, None)
        local = workers == 1 and backend == "loky"
        for row in _one_by_one(todo) if local else _spread(todo, workers, kind, address):
            table.append(row)
            progress.finish(row)
            observer(progress, row)
        table.sort(plan)
        return records


def checked_backend(backend: str) -> tuple[str, str]:
    """Return kind and address (empty for a local one) of a backend.

    Raises
    ------
    InputError
        If it is unknown, or its library is not installed.
    """
    kind, _, address = backend.partition("://")
    if kind not in BACKENDS or (kind == "loky" and address):
        raise unknown_name("backend", backend, [*BACKENDS, "dask://HOST:PORT"])
    if kind == "dask":
        require("dask", "the backend 'dask'")
    return kind, address


def _key(task: Task) -> tuple[str, str, int]:
    return task.cell.problem, task.cell.method, task.seed


def _one_by_one(tasks: Sequence[Task]) -> Iterator[dict[str, Any]]:
    for task in tasks:
        yield run_once(*task)


def _spread(tasks: Sequence[Task], workers: int, kind: str, address: str) -> Iterator[dict[str, Any]]:
    """Yield rows as workers finish them.

    Short runs travel together: a worker takes a parcel of them, reports after `parcel_seconds`, and sends back those
    that it has not begun. A parcel holds twice as many as were made of the last one, so that long runs travel alone.
    """
    from concurrent.futures.process import BrokenProcessPool

    waiting, done = deque(tasks), SimpleQueue[Future[tuple[list[dict[str, Any]], list[Task]]]]()
    under_way, size = 0, 1
    with _pool(kind, address, workers) as (executor, cores):
        try:
            while waiting or under_way:
                while waiting and under_way < 2 * cores():  # one that is worked on, one that is ready
                    parcel = [waiting.popleft() for _ in range(min(size, 1 + len(waiting) // (2 * cores())))]
                    executor.submit(_made_in_time, parcel, parcel_seconds(cores())).add_done_callback(done.put)
                    under_way += 1
                rows, left = done.get().result()
                under_way -= 1
                size = min(2 * len(rows), LARGEST_PARCEL)
                waiting.extendleft(reversed(left))
                yield from rows
        except Exception as error:
            if not isinstance(error, BrokenProcessPool) and type(error).__name__ != "KilledWorker":
                raise
            raise SureholdError(
                "a worker process died, killed by the system or out of memory; the finished runs are kept. Start "
                "again, with fewer --workers if memory is short."
            ) from None


def parcel_seconds(workers: int) -> float:
    """Return for how long a worker makes runs before it reports them, so that all together make `REPORTS` a second."""
    return max(0.5, workers / REPORTS)


def _made_in_time(tasks: list[Task], seconds: float) -> tuple[list[dict[str, Any]], list[Task]]:
    """Make runs, one at least, until the time of a parcel is over; return their rows, and the tasks not begun."""
    end = time.monotonic() + seconds
    rows = [run_once(*tasks[0])]
    while len(rows) < len(tasks) and time.monotonic() < end:
        rows.append(run_once(*tasks[len(rows)]))
    return rows, tasks[len(rows) :]


@contextmanager
def _pool(kind: str, address: str, workers: int) -> Iterator[tuple[Executor, Callable[[], int]]]:
    """Start worker processes, or use a cluster, inside the block; gives them, and how many there are by now."""
    if kind == "loky":
        from joblib.externals.loky import ProcessPoolExecutor

        executor = ProcessPoolExecutor(
            workers, initializer=end_with, initargs=(os.getpid(),), env=dict.fromkeys(_THREADS, "1")
        )
        try:
            yield executor, lambda: workers
        finally:  # also of a generator that is left: runs in flight are lost
            executor.shutdown(wait=True, kill_workers=True)
        return
    from distributed import Client, LocalCluster  # pyright: ignore[reportMissingImports]

    with ExitStack() as stack:
        cluster: Any = f"tcp://{address}"
        if not address:
            cluster = stack.enter_context(
                LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0")
            )
        try:
            client: Any = stack.enter_context(Client(cluster))
            client.wait_for_workers(1, timeout=_ARRIVAL)
        except OSError as error:
            where = f"the cluster at {address}" if address else "a cluster on this machine"
            raise SureholdError(
                f"{where} cannot be used: {error}. Start its scheduler, and a worker at least."
            ) from None
        executor = client.get_executor(pure=False)
        stack.callback(executor.shutdown, wait=False)
        known = float("-inf"), 0

        def cores() -> int:
            nonlocal known
            if time.monotonic() - known[0] > _STALE:
                known = time.monotonic(), sum(client.nthreads().values())
            return max(known[1], 1)

        yield executor, cores

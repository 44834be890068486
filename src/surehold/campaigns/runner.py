"""Making the runs of a plan: workers through joblib, one writer, and nothing lost but the runs in flight."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from surehold.campaigns.methods import checked_method
from surehold.campaigns.plan import Plan, Task
from surehold.campaigns.problem_setup import build_problem
from surehold.campaigns.single_run import run_once
from surehold.campaigns.table import Records, opened
from surehold.errors import InputError, SureholdError, unknown_name
from surehold.extras import require

__all__ = ["Progress", "checked_backend", "run_campaign"]

BACKENDS = ("loky", "dask")


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
    _seconds: dict[tuple[str, str], list[float]] = field(default_factory=dict)

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
            self._seconds.setdefault((row["problem"], row["method"]), []).append(row["seconds"])

    @property
    def remaining_seconds(self) -> float | None:
        """Estimated time to the end: each waiting run as long as those of its problem and method; None if unknown."""
        means = {key: sum(s) / len(s) for key, s in self._seconds.items()}
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
    kind, _ = checked_backend(backend)
    tasks = plan.tasks(runs, shard, only)
    cells = plan.cells(only)
    for label, on in {cell.problem: cell.on for cell in cells}.items():
        try:
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
        for row in _one_by_one(todo) if local else _spread(todo, workers, kind, backend):
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


def _spread(tasks: Sequence[Task], workers: int, kind: str, backend: str) -> Iterator[dict[str, Any]]:
    """Yield rows as workers finish them."""
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    settings: dict[str, Any] = {"n_jobs": workers, "batch_size": 1, "pre_dispatch": workers}
    settings["return_as"] = "generator_unordered"
    try:
        with _cluster(kind, checked_backend(backend)[1], workers):
            parallel = Parallel(**settings)
            yield from cast(Iterator[dict[str, Any]], parallel(delayed(run_once)(*task) for task in tasks))
    except TerminatedWorkerError:
        raise SureholdError(
            "a worker process died, killed by the system or out of memory; the finished runs are kept. Start again, "
            "with fewer --workers if memory is short."
        ) from None


@contextmanager
def _cluster(kind: str, address: str, workers: int) -> Iterator[None]:
    """Make joblib use the backend inside the block, with one thread of linear algebra a process."""
    from joblib import parallel_config

    with ExitStack() as stack:
        settings: dict[str, Any] = {}
        if kind == "dask":
            from distributed import Client, LocalCluster  # pyright: ignore[reportMissingImports]

            cluster: Any = f"tcp://{address}"
            if not address:
                cluster = stack.enter_context(
                    LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0")
                )
            settings["client"] = stack.enter_context(Client(cluster))
        else:
            settings["inner_max_num_threads"] = 1
        stack.enter_context(parallel_config(kind, **settings))
        yield

"""The progress bar of a run, by rich, once the run takes more than two seconds."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Final

from surehold.extras import missing

__all__ = ["progress_bar"]

_SILENT: Final = 2.0  # seconds


@contextmanager
def progress_bar(total: int, wanted: bool) -> Iterator[Callable[[float], None]]:
    """Lend a function to be called with the best value after each of `total` trials.

    Off a terminal, and without rich, it shows nothing.
    """
    if not wanted or not sys.stderr.isatty() or missing("cli"):
        yield lambda best: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task("trials", total=total)
    started, shown = perf_counter(), False

    def advance(best: float) -> None:
        nonlocal shown
        bar.update(task, advance=1, description=f"trials, best {best:.4g}")
        if not shown and perf_counter() - started > _SILENT:
            bar.start()
            shown = True

    try:
        yield advance
    finally:
        if shown:
            bar.stop()

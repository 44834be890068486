"""Say so, once, when numerical kernels are being compiled: the only long wait that has nothing to show."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

__all__ = ["announced", "warm_up"]


_said: list[bool] = []  # holds something once the announcement has been made


@contextmanager
def announced(console: Console) -> Iterator[None]:
    """Run the block; if a kernel is compiled in it, announce that before the first and report the time at the end.

    Said once a process, however many blocks compile; a compilation of less than two seconds is not worth a report.
    """
    from numba.core import event

    class Watcher(event.Listener):
        started: float | None = None

        def on_start(self, event: Any) -> None:
            if self.started is None:
                self.started = time.perf_counter()
                if not _said:
                    console.print("Compiling numerical kernels, once for this installation (about a minute) ...")
                    _said.append(True)

        def on_end(self, event: Any) -> None: ...

    watcher = Watcher()
    with event.install_listener("numba:compile", watcher):
        yield
    seconds = 0.0 if watcher.started is None else time.perf_counter() - watcher.started
    if seconds > 2.0:
        console.print(f"Compiled and stored in {seconds:.1f} s.")


def warm_up(problem: Any, settings: dict[str, Any], console: Console) -> None:
    """Compile what the problem's trials need; a child process compiles the optimizer's kernels meanwhile."""
    from surehold.optimization.optimizer import Optimizer
    from surehold.store.background import compiling

    Optimizer(problem.box, **settings)  # which begins the compilation
    if compiling() and not _said:
        console.print("Compiling numerical kernels meanwhile, once for this installation (about a minute) ...")
        _said.append(True)
    own: Callable[[], Any] | None = getattr(problem, "warm_up", None)
    if own is not None:
        own()

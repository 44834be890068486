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
                    console.print("Compiling numerical kernels, once for this installation (half a minute) ...")
                    _said.append(True)

        def on_end(self, event: Any) -> None: ...

    watcher = Watcher()
    with event.install_listener("numba:compile", watcher):
        yield
    seconds = 0.0 if watcher.started is None else time.perf_counter() - watcher.started
    if seconds > 2.0:
        console.print(f"Compiled and stored in {seconds:.1f} s.")


def warm_up(problem: Any, settings: dict[str, Any]) -> None:
    """Run a few trials of a trivial problem with the same settings, and the problem's own warm-up if it has one."""
    from surehold.optimization.maximization import maximize

    own: Callable[[], Any] | None = getattr(problem, "warm_up", None)
    if own is not None:
        own()
    few: dict[str, Any] = {
        name: value for name, value in settings.items() if name not in ("allowed", "constraints")
    } | {"n_initial": 4}
    center = problem.box.from_unit([0.5] * problem.box.dimension)

    def hill(x: Any) -> float:
        value = -float(sum(((x - center) / problem.box.widths) ** 2))
        return float(value > -0.1) if settings.get("outcome") == "success" else value

    maximize(hill, problem.box, 6, progress=False, **few)

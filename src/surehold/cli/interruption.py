"""Ctrl-C and SIGTERM: a run keeps what was done; while its files are written both wait."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from rich.console import Console

__all__ = ["terminable", "undisturbed"]

#: What ends a program from outside: `kill` and job schedulers, and a terminal that is closed.
_ENDING: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def terminable() -> Iterator[list[int]]:
    """Let SIGTERM, and SIGHUP unless it is ignored (nohup), do in the block what Ctrl-C does.

    Yields the list of those that came: what sends them may soon end the program by force.
    """
    came: list[int] = []

    def end(number: int, _: Any) -> None:
        came.append(number)
        raise KeyboardInterrupt

    with _handling([s for s in _ENDING if signal.getsignal(s) != signal.SIG_IGN], end):
        yield came


@contextmanager
def undisturbed(console: Console) -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait until the block has ended; they then do nothing more, as the work is done."""

    def wait(*_: Any) -> None:
        console.print("Writing what was found; this takes a moment.")

    with _handling([signal.SIGINT, *_ENDING], wait):
        yield


@contextmanager
def _handling(signals: list[signal.Signals], handler: Callable[..., Any]) -> Iterator[None]:
    """Signals reach the main thread alone: elsewhere the block runs as it is."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in signals}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)

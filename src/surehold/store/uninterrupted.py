"""Ctrl-C that waits for the end of compiled code.

An exception that a signal raises while compiled code is entered or left is lost there, comes out as another one, or
ends the process: numba's dispatcher and SciPy's callbacks call Python in places where none is expected.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

__all__ = ["raise_interruption", "uninterrupted"]

_SIGNALS: Final = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class _Waiting:
    """The handler of signals that wait; the second one is passed on to the handlers from before at once."""

    def __init__(self, before: dict[int, Callable[[int, FrameType | None], Any]]):
        self.before: Final = before
        self.seen: int | None = None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if self.seen is not None:
            self.before[number](number, frame)
        self.seen = number


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let Ctrl-C, and other signals that are handled in Python, wait for the end of the block; a second one does not.

    Of blocks within each other the outermost counts. Signals reach the main thread alone: elsewhere the block runs as
    it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.getsignal(number) for number in _SIGNALS}
    if any(isinstance(handler, _Waiting) for handler in handlers.values()):
        yield
        return
    waiting = _Waiting({number: handler for number, handler in handlers.items() if callable(handler)})
    for number in waiting.before:
        signal.signal(number, waiting)
    try:
        yield
    finally:
        for number, handler in waiting.before.items():
            signal.signal(number, handler)
        if waiting.seen is not None:
            waiting.before[waiting.seen](waiting.seen, None)


def raise_interruption(error: Exception) -> None:
    """Raise KeyboardInterrupt where an error is what compiled code made of one: a SystemError that it caused."""
    if isinstance(error.__cause__, KeyboardInterrupt):
        raise KeyboardInterrupt from None

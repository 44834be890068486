"""Ctrl-C that waits for the end of compiled code.

An exception that a signal raises while compiled code is entered or left is lost there, comes out as another one, or
ends the process: numba's dispatcher and SciPy's callbacks call Python in places where none is expected.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

__all__ = ["uninterrupted"]

_SIGNALS: Final = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let Ctrl-C, and other signals that are handled in Python, wait for the end of the block; a second one does not.

    Signals reach the main thread alone: elsewhere the block runs as it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handled = {number: handler for number in _SIGNALS if callable(handler := signal.getsignal(number))}
    waiting: list[int] = []

    def wait(number: int, frame: FrameType | None) -> None:
        waiting.append(number)
        if len(waiting) > 1:
            handled[number](number, frame)

    for number in handled:
        signal.signal(number, wait)
    try:
        yield
    finally:
        for number, handler in handled.items():
            signal.signal(number, handler)
        if waiting:
            handled[waiting[0]](waiting[0], None)

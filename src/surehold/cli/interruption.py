"""Ctrl-C while files are written: it waits, so that what was found is on disk before the program ends."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

__all__ = ["undisturbed"]


@contextmanager
def undisturbed(console: Console) -> Iterator[None]:
    """Let Ctrl-C wait until the block has ended; it then does nothing more, as the work is done.

    Signals reach the main thread alone: elsewhere the block runs as it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def wait(*_: Any) -> None:
        console.print("Writing what was found; this takes a moment.")

    before = signal.signal(signal.SIGINT, wait)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)

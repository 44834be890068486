"""Processes that work for another one, and end when it does: the workers of a pool would wait for work forever."""

import os
import threading
import time
from typing import Final

__all__ = ["end_with"]

_LOOK: Final = 1.0  # s; no file descriptor of the parent reaches all kinds of workers, its number does


def end_with(parent: int) -> None:
    """End this process once the one of that number, which has started it, is no more; what it does is lost then."""
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(0)

"""The lock of a file or folder that several processes use. It ends with the process that holds it, however it ends."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from filelock import FileLock, Timeout

from surehold.errors import SureholdError

__all__ = ["LockTaken", "file_lock", "locked"]

_PAUSE: Final = 0.005  # seconds between two attempts; a trial is handed out in about as long


class LockTaken(SureholdError):
    """Another process holds the lock; `owner` is its number, or "unknown"."""

    def __init__(self, path: Path, owner: str):
        super().__init__(f"'{path}' is held by another process ({owner}).")
        self.owner: Final = owner


def file_lock(path: Path) -> FileLock:
    """Return the lock kept in `path`, a file of its own beside the data; each thread acquires it for itself."""
    return FileLock(path, poll_interval=_PAUSE)


@contextmanager
def locked(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold the lock kept in the file `path` during the block.

    Raises
    ------
    LockTaken
        Without `wait`, if another process holds it.
    OSError
        If the file cannot be written.
    """
    lock = file_lock(path)
    try:
        lock.acquire(blocking=wait)
    except Timeout:
        raise LockTaken(path, path.read_text(encoding="ascii").strip() or "unknown") from None
    try:
        path.write_text(str(os.getpid()), encoding="ascii")
        yield
    finally:
        lock.release()

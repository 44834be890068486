"""A lock of a study, for all threads of all processes.

It is the operating system's (a file) or the server's (PostgreSQL): it ends with the process that holds it, however that
ends.
"""

import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from surehold.store.locks import locked

__all__ = ["StudyLock"]


class StudyLock:
    """A lock kept in a `file`, or else under `key` in the server of an `engine`, or else of this process alone."""

    def __init__(self, key: str, file: Path | None, engine: Any = None):
        self._key = {"key": zlib.crc32(key.encode())}
        self._file = file
        self._engine = engine
        self._threads = threading.RLock()
        self._depth = 0

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the lock during the block; a thread that holds it already goes on."""
        with self._threads:
            if self._depth:
                yield
                return
            self._depth = 1
            try:
                with self._across_processes():
                    yield
            finally:
                self._depth = 0

    @contextmanager
    def _across_processes(self) -> Iterator[None]:
        if self._file is not None:
            with locked(self._file):
                yield
        elif self._engine is not None:
            from sqlalchemy import text

            with self._engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
                connection.execute(text("SELECT pg_advisory_lock(:key)"), self._key)
                try:
                    yield
                finally:
                    connection.execute(text("SELECT pg_advisory_unlock(:key)"), self._key)
        else:
            yield

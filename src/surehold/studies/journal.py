"""A journal file of Optuna, mended before it is read: one line an operation, the last one perhaps half written."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final

from optuna import logging
from optuna.storages.journal import BaseJournalBackend, JournalFileBackend

from surehold.store.locks import file_lock

__all__ = ["Journal"]

_log: Final = logging.get_logger(__name__)


class _JournalLock:
    """The lock of a journal's writers, in the form that Optuna asks for.

    Optuna's own locks are files that outlive a killed process; others then wait half a minute. A writer that was killed
    or ran out of disk in the middle of a line, or a power cut, leaves a line behind that cannot be read; one more line
    behind it would make the whole journal unreadable. So it is cut off before anything is appended, and said.
    """

    def __init__(self, journal: Path):
        self._journal = journal
        self._lock = file_lock(journal.with_name(f"{journal.name}.lock"))

    def acquire(self) -> bool:
        self._lock.acquire()
        try:
            self._mend()
        except BaseException:
            self._lock.release()
            raise
        return True

    def release(self) -> None:
        self._lock.release()

    def mend(self) -> None:
        """Cut off a damaged last line, if there is one; a line that is just being written is waited for."""
        with open(self._journal, "rb") as journal:
            end = journal.seek(0, os.SEEK_END)
            whole = not end or _is_operation(_line_before(journal, end))
        if not whole:
            self.acquire()
            self.release()

    def _mend(self) -> None:
        with open(self._journal, "rb+") as journal:
            size = end = journal.seek(0, os.SEEK_END)
            last = b""
            while end and not _is_operation(last := _line_before(journal, end)):
                end -= len(last)
            if end == size or (end == 0 and last.endswith(b"\n")):  # whole, or no journal at all: somebody else's file
                return
            journal.seek(end)
            lost = journal.read(100)
            journal.truncate(end)
        _log.warning(f"{self._journal}: damaged last line cut off, {size - end} bytes that start with {lost!r}.")


class Journal(BaseJournalBackend):
    """A journal file that is mended before it is read: not every kind of damage is passed over by Optuna's reader."""

    def __init__(self, path: Path):
        self._lock = _JournalLock(path)
        self._file = JournalFileBackend(str(path), lock_obj=self._lock)  # type: ignore[arg-type]

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        """Return the operations from that number on; see Optuna."""
        self._lock.mend()
        return self._file.read_logs(log_number_from)

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Append operations; see Optuna."""
        self._file.append_logs(logs)


def _line_before(file: BinaryIO, end: int) -> bytes:
    """Return the line of a file that ends at the byte `end`, its newline included where it has one."""
    length = 4096
    while True:
        start = max(0, end - length)
        file.seek(start)
        block = file.read(end - start)
        newline = block.rfind(b"\n", 0, -1)
        if newline >= 0 or start == 0:
            return block[newline + 1 :]
        length *= 2


def _is_operation(line: bytes) -> bool:
    """Tell whether a line of a journal can be read."""
    try:
        return line.endswith(b"\n") and "op_code" in json.loads(line)
    except (ValueError, TypeError, RecursionError):
        return False

"""A journal file of Optuna, one operation a line: its damaged end is mended, and a file put in its place found out."""

import errno
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Final

from optuna import logging
from optuna.storages.journal import BaseJournalBackend

from surehold.store.locks import file_lock

__all__ = ["READ_ONLY", "REPLACED", "Journal"]

#: What the system says of a file that it does not write.
READ_ONLY: Final = (errno.EACCES, errno.EPERM, errno.EROFS)
#: What is said where the file of a storage is not the one that was opened.
REPLACED: Final = (
    "it is another file, or shorter, than the one that this program has read, and what the program knows is not in it; "
    "put the former file back, or start the program again"
)
_log: Final = logging.get_logger(__name__)


class Journal(BaseJournalBackend):
    """A journal file as Optuna writes and reads it.

    A writer that was killed or ran out of disk in the middle of a line, or a power cut, leaves a line behind that
    cannot be read; one more line behind it would make the whole journal unreadable. So it is cut off before anything is
    read or appended, and said.

    Trials are known by how many lines before began one. Where the file was replaced by a copy, or by a new study, since
    this process read it, its answers would be lost or go to other trials: reading and appending then raise OSError.

    The lock is the operating system's: Optuna's own ones are files that outlive a killed process, for which others then
    wait half a minute.
    """

    def __init__(self, path: Path):
        self._path = path
        self._lock_path = path.with_name(f"{path.name}.lock")
        self._forget()

    def _forget(self) -> None:
        self._number, self._end, self._last = 0, 0, b""  # lines read, where they end, and the last of them

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        """Yield the operations from that number on; see Optuna."""
        try:
            self._mend_end()
        except OSError as error:
            if error.errno not in READ_ONLY:  # a copy that was made while a line was written: it is passed over
                raise
        if log_number_from != self._number:
            self._forget()
        with open(self._path, "rb") as journal:
            self._check(journal)
            for line in journal:
                if not line.endswith(b"\n"):  # it is just being written
                    return
                operation = json.loads(line)
                self._number, self._end, self._last = self._number + 1, self._end + len(line), line
                if self._number > log_number_from:
                    yield operation

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Append operations; see Optuna."""
        lines = "".join(json.dumps(log, separators=(",", ":")) + "\n" for log in logs)
        with self._locked(), open(self._path, "rb+") as journal:
            self._check(journal)
            journal.seek(0, os.SEEK_END)
            journal.write(lines.encode("utf-8"))
            journal.flush()
            os.fsync(journal.fileno())

    def _check(self, journal: BinaryIO) -> None:
        """Go to the end of what was read; raises OSError where the last line of that is not there any more."""
        journal.seek(self._end - len(self._last))
        if journal.read(len(self._last)) != self._last:
            raise OSError(errno.ESTALE, REPLACED)

    # --- a damaged end --------------------------------------------------------------------------------------------

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Hold the lock of the writers during the block, behind whole lines."""
        with file_lock(self._lock_path):  # a new one: an object that was made before a fork locks nothing behind it
            self._mend()
            yield

    def _mend_end(self) -> None:
        """Cut off a damaged last line, if there is one; a line that is just being written is waited for."""
        with open(self._path, "rb") as journal:
            end = journal.seek(0, os.SEEK_END)
            whole = not end or _is_operation(_line_before(journal, end))
        if not whole:
            with self._locked():
                pass

    def _mend(self) -> None:
        with open(self._path, "rb+") as journal:
            size = end = journal.seek(0, os.SEEK_END)
            last = b""
            while end and not _is_operation(last := _line_before(journal, end)):
                end -= len(last)
            if end == size or (end == 0 and last.endswith(b"\n")):  # whole, or no journal at all: somebody else's file
                return
            journal.seek(end)
            lost = journal.read(100)
            journal.truncate(end)
        _log.warning(f"{self._path}: damaged last line cut off, {size - end} bytes that start with {lost!r}.")


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

"""Files that are written whole or not at all, whoever reads or writes them at the same time."""

import errno
import hashlib
import itertools
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO, Final

from surehold.errors import InputError

__all__ = ["checked_folder", "new_folder", "noted_writes", "replacing", "write_file"]

_NOTED: Final[ContextVar[dict[Path, str] | None]] = ContextVar("noted", default=None)


@contextmanager
def noted_writes() -> Iterator[dict[Path, str]]:
    """Yield the SHA-256 of each file that the block writes with `write_file`, by its resolved path."""
    written: dict[Path, str] = {}
    token = _NOTED.set(written)
    try:
        yield written
    finally:
        _NOTED.reset(token)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a file that takes the place of `path` when the block ends; after an error what was there before stays.

    Of a link it is what the link leads to. Raises OSError for a device or a pipe: to be replaced would end it for all.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "it is no ordinary file")
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())  # or the name may reach the disk before the content
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)  # mkstemp makes files that only their owner reads
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file whole: under a temporary name beside it, then renamed over what was there.

    Raises
    ------
    InputError
        If the file cannot be written; what was there before stays.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        with replacing(path) as file:
            file.write(data)
    except OSError as error:
        there = path.parent.is_dir()
        advice = "free the place or choose another" if there else f"make the folder '{path.parent}' or choose another"
        raise InputError(f"file '{path}' cannot be written ({error.strerror or error}); {advice}.") from None
    noted = _NOTED.get()
    if noted is not None:
        noted[path.resolve()] = hashlib.sha256(data).hexdigest()


def checked_folder(folder: str | Path) -> Path:
    """Create the folder if needed and return its path, after a trial write.

    Raises
    ------
    InputError
        If it cannot be created or written, or a file stands in its place.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(
            f"output folder '{path}' cannot be written ({error.strerror or error}); choose another, on the command "
            "line with --out."
        ) from None
    return path


def new_folder(folder: str | Path) -> Path:
    """Create a folder that did not exist and return its path: FOLDER, or the first that is free of FOLDER-2, ...

    Raises
    ------
    InputError
        As `checked_folder`.
    """
    path = Path(folder)
    checked_folder(path.parent)
    for number in itertools.count(1):
        new = path if number == 1 else path.with_name(f"{path.name}-{number}")
        try:
            new.mkdir()
        except FileExistsError:
            continue
        except OSError:
            pass  # checked_folder says what is wrong
        return checked_folder(new)
    raise AssertionError("counting does not end")

"""Where a study is kept: a journal file, SQLite or PostgreSQL, by URL; and the locks of a study.

    ""                          the journal of a run, runs/NAME/journal.log
    path/to/journal.log         a journal file: one line an operation, forced to the disk before the operation returns
    journal:///path/to/file     the same
    sqlite:///path/to/file.db   SQLite
    postgresql://user@host/db   PostgreSQL
    memory                      the process' own memory, gone with it

Who hands out a trial holds one lock of the study (`handing_out`): no two workers get the same one, and each sees what
the others were given. Who changes a trial because of what it was holds another (`answering`): the first answer counts,
though a database looks and writes in two steps. It is not held while a model is asked: an answer would wait for that.
Who needs both takes it second.
"""

import errno
import re
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from optuna.exceptions import DuplicatedStudyError, StorageInternalError
from optuna.storages import BaseStorage, InMemoryStorage, JournalStorage, get_storage

from surehold.errors import InputError
from surehold.studies.journal import READ_ONLY, REPLACED, Journal
from surehold.studies.study_lock import StudyLock

__all__ = ["JOURNAL", "Storage", "StorageFailure", "checked_name", "open_storage"]

JOURNAL: Final = "journal.log"
_SCHEMES: Final = "a journal file (path or journal:///path), sqlite:///file.db, postgresql://user@host/database, memory"
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_TELLING: Final = ".telling"  # ending of the file that is locked while trials are told
_NOT_FOUND: Final = "Record does not exist."  # Optuna's words for a study or a trial that is not there
_SQLITE_PATIENCE: Final = 30.0  # seconds to wait for another process' write; ?timeout= in the URL overrides it


def checked_name(name: str) -> str:
    """Return the name of a study; raises InputError where it could not be part of a path or an address."""
    if not isinstance(name, str) or not _NAME.fullmatch(name) or ".." in name:
        raise InputError(
            f"study name {name!r} is not usable; use letters, digits, '-', '_' and single dots, 100 at most, the first "
            "a letter or digit."
        )
    return name


class StorageFailure(InputError):
    """The storage could not be read or written now; nothing was changed, and a later attempt may succeed."""


class Storage:
    """An opened storage: Optuna's `backend`, its `url` (`shown` without password), and the locks of a study in it."""

    def __init__(self, backend: BaseStorage, url: str, name: str, beside: Path | None, engine: Any = None):
        self.backend: Final = backend
        self.url: Final = url
        self.shown: Final = _without_password(url)
        self._engine, self._file = engine, beside
        self._database = beside if engine is not None else None
        self._identity = _identity(self._database)
        self._asking, self._telling = (
            StudyLock(key, None if beside is None else beside.with_name(beside.name + ending), engine)
            for key, ending in ((f"surehold:{name}", ".asking"), (f"surehold answers:{name}", _TELLING))
        )

    def is_that_of(self, other: "Storage") -> bool:
        """Tell whether another one is the same, however either file was named."""
        file = _identity(self._file)
        return self.url == other.url or (file is not None and file == _identity(other._file))

    @contextmanager
    def handing_out(self) -> Iterator[None]:
        """Hold the lock under which trials are handed out; only one thread of all processes does at a time."""
        with self._asking.held():
            self._check_database()
            yield

    @contextmanager
    def answering(self) -> Iterator[None]:
        """Hold the lock under which a trial is looked at and then changed; within `handing_out`, not around it."""
        with self._telling.held():
            self._check_database()
            yield

    def _check_database(self) -> None:
        """Raise OSError where another file is in the place of the database: what is written would go to either."""
        if _identity(self._database) != self._identity:
            raise OSError(errno.ESTALE, REPLACED)

    @contextmanager
    def failures(self) -> Iterator[None]:
        """Turn what the storage raises inside the block into one kind of error, which says what to do."""
        from sqlalchemy.exc import SQLAlchemyError

        try:
            yield
        except (StorageInternalError, SQLAlchemyError) as error:
            cause = error.__cause__ or error
            reason = str(getattr(cause, "orig", None) or cause).strip().splitlines()[0]
            raise StorageFailure(f"storage {self.shown} cannot be used: {reason}. Nothing was changed.") from error
        except OSError as error:
            hint = "; copy it to a place that can be written" if error.errno in READ_ONLY else ""
            raise StorageFailure(f"storage {self.shown} cannot be used: {error.strerror or error}{hint}.") from error
        except KeyError as error:
            if error.args != (_NOT_FOUND,):  # in Optuna's words: deleted by its dashboard, or an older copy is there
                raise
            raise StorageFailure(
                f"storage {self.shown} lacks the study, or a trial, that was in it when this program opened it; put "
                "the former storage back, or start the program again."
            ) from error
        except DuplicatedStudyError:
            raise InputError(f"the study exists in {self.shown} already; use it, or choose another name.") from None

    @contextmanager
    def closed_on_error(self) -> Iterator[None]:
        """Close connections where the block raises."""
        try:
            yield
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close connections to a database."""
        if self._engine is not None:
            self._engine.dispose()


def open_storage(url: str, name: str, *, create: bool) -> Storage:
    """Open the storage at a URL (see above) for the study `name`.

    Raises
    ------
    InputError
        If the URL is none, the storage is not there (with `create` False), cannot be written or reached, was written by
        a newer version, or is damaged.
    """
    checked_name(name)
    scheme, separator, rest = url.partition("://")
    scheme = scheme.split("+")[0].lower()
    if url == "memory":
        return Storage(InMemoryStorage(), url, name, None)
    if scheme == "sqlite" and separator:
        return _sqlite(url, name, create)
    if scheme in ("postgresql", "postgres") and separator:
        return _postgresql(f"postgresql+psycopg://{rest}", url, name)
    if separator and scheme != "journal":
        raise InputError(f"storage {url!r} is of no kind that is known; give {_SCHEMES}.")
    path = Path(rest if separator else url) if url else Path("runs") / name / JOURNAL
    return _journal(path, name, create)


# --- files --------------------------------------------------------------------------------------------------------


def _missing(shown: str, path: Path) -> InputError:
    looked = "" if path.is_absolute() else f" in this folder ({str(path.absolute())!r} was looked for)"
    return InputError(f"storage {shown!r} does not exist{looked}; give --storage, or create the study first.")


def _check_writable(path: Path, create: bool) -> bool:
    """Tell whether a file can be written; it is made where it is missing.

    Raises OSError where it cannot be, unless that is a matter of permission and nothing is to be created: a copy on a
    medium that cannot be written can still be read.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "ab"):
            return True
    except OSError as error:
        if create or error.errno not in READ_ONLY:
            raise
        return False


def _journal(path: Path, name: str, create: bool) -> Storage:
    if path.is_dir():
        path = path / JOURNAL
    if not path.exists() and not create:
        raise _missing(str(path), path)
    try:
        _check_writable(path, create)
        with open(path, "rb") as journal:
            start = journal.read(2)
        if not b'{"'.startswith(start):  # before anything is mended in a file that is somebody else's
            raise InputError(f"storage {str(path)!r} cannot be read: it is no journal, but some other file.")
    except OSError as error:
        raise InputError(f"storage {str(path)!r} cannot be written: {error.strerror or error}.") from None
    try:
        place = path.resolve()  # the locks stand there, by whatever link it is opened and wherever a function goes
        backend = JournalStorage(Journal(place))
    except OSError as error:
        raise InputError(f"storage {str(path)!r} cannot be used: {error.strerror or error}.") from None
    except (ValueError, OverflowError, KeyError, AssertionError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"storage {str(path)!r} cannot be read: no journal, damaged, or of a newer version of Optuna ({error})."
        ) from None
    return Storage(backend, str(path), name, place)


# --- databases ----------------------------------------------------------------------------------------------------


def _identity(path: Path | None) -> tuple[int, int] | None:
    """Return what tells a file from all others, None where there is none."""
    try:
        found = None if path is None else path.stat()
    except OSError:
        return None
    return None if found is None else (found.st_dev, found.st_ino)


def _sqlite(url: str, name: str, create: bool) -> Storage:
    from sqlalchemy.engine import make_url

    file = make_url(url).database
    if not file or file == ":memory:":
        raise InputError(f"storage {url!r} names no file; give sqlite:///path/to/file.db, or memory.")
    path = Path(file)
    if not path.exists() and not create:
        raise _missing(url, path)
    try:
        writable = _check_writable(path, create)
        place = path.resolve()
        lock = place.with_name(place.name + _TELLING)
        writable = writable and _check_writable(lock, create)
    except OSError as error:
        raise InputError(f"storage {url!r} cannot be written: {error.strerror or error}.") from None
    arguments: dict[str, Any] = {} if "timeout" in make_url(url).query else {"timeout": _SQLITE_PATIENCE}
    alone = StudyLock("", lock).held() if writable else nullcontext()
    storage, engine = _database(url if writable else _read_only(path), url, {"connect_args": arguments}, alone)
    return Storage(storage, url, name, place, engine)


def _read_only(path: Path) -> str:
    """Return the URL under which SQLite opens a file for reading."""
    return f"sqlite:///file:{quote(str(path.absolute()))}?mode=ro&uri=true"


def _postgresql(driver_url: str, url: str, name: str) -> Storage:
    arguments = {"pool_pre_ping": True, "connect_args": {"connect_timeout": 10}}
    storage, engine = _database(driver_url, url, arguments, _alone_on_server(driver_url, arguments))
    return Storage(storage, url, name, None, engine)


def _database(
    driver_url: str, url: str, engine_kwargs: dict[str, Any], alone: AbstractContextManager[None]
) -> tuple[BaseStorage, Any]:
    """Return an opened database and its engine; its tables are made where they are missing, while `alone` is held."""
    from sqlalchemy.exc import ArgumentError, SQLAlchemyError

    from surehold.studies.columns import ColumnStorage

    shown = _without_password(url)
    try:
        with alone, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            storage = ColumnStorage(driver_url, engine_kwargs=engine_kwargs)
    except ArgumentError as error:
        raise InputError(f"storage {shown!r} is no valid URL: {error}.") from None
    except SQLAlchemyError as error:
        reason = str(getattr(error, "orig", None) or error).strip().splitlines()[0]
        raise InputError(f"storage {shown!r} cannot be used: {reason}.") from None
    except RuntimeError as error:
        raise InputError(f"storage {shown!r} does not fit this version of Optuna: {error}") from None
    return get_storage(storage), storage.engine


@contextmanager
def _alone_on_server(driver_url: str, engine_kwargs: dict[str, Any]) -> Iterator[None]:
    """Let nobody else make the tables of a new database in the block."""
    from sqlalchemy import create_engine

    engine = create_engine(driver_url, **engine_kwargs)
    try:
        with StudyLock("surehold tables", None, engine).held():
            yield
    finally:
        engine.dispose()


def _without_password(url: str) -> str:
    from sqlalchemy.engine import make_url

    if "://" not in url:
        return url or "memory"
    with suppress(Exception):
        return make_url(url).render_as_string(hide_password=True)
    return url

"""Compiled functions, kept on disk wherever that is possible and compiled anew where it is not.

numba keeps machine code beside the source or in the user's cache folder. Where it can write to neither (a read-only
container, an account without home) it refuses to compile at all, and on a full disk the call fails that compiles; here
a private temporary folder is the next place, and after that code is compiled anew by each process, which is said once.
"""

import logging
import os
import stat
import tempfile
from collections.abc import Callable
from functools import cache as once
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core import config
from numba.core.types.misc import unliteral

__all__ = ["njit", "say_once"]

_log = logging.getLogger("surehold")
_said: list[bool] = []  # holds something once the warning has been given


def njit(*signatures: Any, cache: bool = True, **options: Any) -> Any:
    """Return the decorator `numba.njit` of the same arguments, which outlives a cache that cannot be written."""

    def compiled(function: Callable[..., Any]) -> Any:
        plain = _one_for_constants(numba.njit(*signatures, **options))
        if not cache:
            return plain(function)
        kept = _one_for_constants(numba.njit(*signatures, cache=True, **options))
        try:
            return _saving_where_possible(kept(function))
        except RuntimeError as error:  # numba found no folder
            if "cannot cache" not in str(error):
                raise
        except OSError as error:  # of a function that is compiled at once: the disk is full
            say_once(error)
            return plain(function)
        settings: Any = config
        before = settings.CACHE_DIR
        try:
            settings.CACHE_DIR = str(_private_folder())
            return _saving_where_possible(kept(function))
        except (RuntimeError, OSError) as error:
            say_once(error)
            return plain(function)
        finally:
            settings.CACHE_DIR = before

    return compiled


def _one_for_constants(decorator: Callable[..., Any]) -> Callable[..., Any]:
    """Return the decorator, of functions that other compiled ones call with a constant as with any other number.

    numba compiles a function anew for each constant argument, with all that it calls.
    """

    def decorated(function: Callable[..., Any]) -> Any:
        dispatcher = decorator(function)
        typed = getattr(dispatcher, "get_call_template", None)
        if typed is not None:  # NUMBA_DISABLE_JIT gives the function back
            dispatcher.get_call_template = lambda args, kws: typed(
                [unliteral(arg) for arg in args], {name: unliteral(arg) for name, arg in kws.items()}
            )
        return dispatcher

    return decorated


def _saving_where_possible(dispatcher: Any) -> Any:
    kept = getattr(dispatcher, "_cache", None)
    if kept is None:  # NUMBA_DISABLE_JIT gives the function back
        return dispatcher
    kept._cache_file._source_stamp = _sources()
    save = kept.save_overload

    def save_overload(*arguments: Any) -> None:
        try:
            save(*arguments)
        except OSError as error:  # the function itself is compiled and works
            say_once(error)

    kept.save_overload = save_overload
    return dispatcher


@once
def _sources() -> str:
    """Return what tells the sources of all kernels of this package from others.

    A kernel contains those that it calls, of other files, too: numba itself looks at the kernel's own file only, and
    would go on with what was compiled before another one was changed.
    """
    content = sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        text = path.read_bytes()
        if b"njit(" in text:
            content.update(text)
    return content.hexdigest()


def _private_folder() -> Path:
    """Return a folder that nobody else can write to, because what lies in it is executed."""
    user = getattr(os, "getuid", int)()
    folder = Path(tempfile.gettempdir()) / f"surehold-kernels-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if stat.S_ISDIR(found.st_mode) and found.st_uid == user and not found.st_mode & 0o077:
        return folder
    return Path(tempfile.mkdtemp(prefix="surehold-kernels-"))


def say_once(error: Exception) -> None:
    """Warn, once in a process, that compiled kernels cannot be kept, and say what to do."""
    if not _said:
        _said.append(True)
        reason = getattr(error, "strerror", None) or error
        _log.warning(
            f"compiled kernels cannot be kept ({reason}), each process compiles anew; set NUMBA_CACHE_DIR to a folder "
            "that can be written."
        )

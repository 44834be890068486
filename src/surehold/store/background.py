"""Kernels that another process compiles into the cache while this one does something else.

A child process is started once for a set of kernels, which a marker in the cache names when it is done; children of
other processes that compile the same are waited for, not repeated. Where there is no cache, no interpreter to start, or
`SUREHOLD_WARM_UP=0` in the environment, nothing is started and kernels are compiled when they are first called.
"""

import atexit
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from filelock import Timeout

from surehold.store.locks import file_lock

__all__ = ["begin", "compiling", "marker_of", "marking", "wait"]

SWITCH: Final = "SUREHOLD_WARM_UP"
_PATIENCE: Final = 300.0  # seconds to wait for a child; one that takes longer hangs, and kernels are compiled here

_log = logging.getLogger("surehold")
_seen: set[Path] = set()  # markers that were looked for
_children: list[tuple["subprocess.Popen[bytes]", Path]] = []
_elsewhere: list[Path] = []  # markers that children of other processes will write


def marker_of(kernel: Any, settings: bytes) -> Path | None:
    """Return the file that says that all kernels of these settings are compiled, None where nothing can be kept.

    It lies beside the compiled code of `kernel`; its name changes with the sources, the compiler and the processor.
    """
    folder = getattr(getattr(kernel, "_cache", None), "cache_path", None)
    if folder is None:
        return None
    source = Path(sys.modules["surehold"].__file__ or "").parent
    return Path(folder) / f"warm-{sha256(_stamp(source) + settings).hexdigest()[:24]}"


@cache
def _stamp(source: Path) -> bytes:
    from llvmlite.binding import get_host_cpu_name

    found = [sys.version, version("numba"), version("llvmlite"), get_host_cpu_name()]
    for path in sorted(source.rglob("*.py")):
        state = path.stat()
        found.append(f"{path.relative_to(source)} {state.st_mtime_ns} {state.st_size}")
    return "\n".join(found).encode()


def begin(marker: Path | None, code: str, settings: bytes) -> None:
    """Start a child that runs `code` with the settings on its standard input, unless it is running or was."""
    if marker is None or marker in _seen or os.environ.get(SWITCH) == "0":
        return
    _seen.add(marker)
    if marker.exists() or not sys.executable or getattr(sys, "frozen", False):
        return
    try:
        with file_lock(_lock(marker)).acquire(blocking=False):
            pass
    except Timeout:
        _elsewhere.append(marker)
        return
    except OSError as error:  # nothing can be written there after all
        from surehold.store.kernels import say_once

        say_once(error)
        return
    paths = os.pathsep.join(path for path in sys.path if path)
    try:
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {SWITCH: "0", "PYTHONPATH": paths},
            start_new_session=True,  # Ctrl-C is meant for the run
        )
    except OSError as error:
        _log.warning(f"no process can be started that compiles kernels ahead ({error}); the first model waits for it.")
        return
    with suppress(OSError):
        assert child.stdin is not None
        child.stdin.write(settings)
        child.stdin.close()
    _children.append((child, marker))


def compiling() -> bool:
    """Tell whether a child of this process is compiling."""
    return any(child.poll() is None for child, _ in _children)


def wait() -> None:
    """Wait until what was begun is compiled: to compile the same here at the same time would take longer."""
    while _children:
        child, _ = _children.pop()
        with suppress(subprocess.TimeoutExpired):
            child.wait(_PATIENCE)
    while _elsewhere:
        with suppress(Timeout, OSError), file_lock(_lock(_elsewhere.pop())).acquire(timeout=_PATIENCE):
            pass


@contextmanager
def marking(marker: Path) -> Iterator[bool]:
    """Hold the marker's lock during the block and write the marker at its end; gives whether there is none yet.

    What the block itself begins is not that: it would wait for this process.
    """
    _seen.add(marker)
    with file_lock(_lock(marker)):
        yield not marker.exists()
        with suppress(OSError):  # a full disk: the kernels are compiled again
            marker.touch()


def _lock(marker: Path) -> Path:
    return marker.with_suffix(".lock")


@atexit.register
def _leave() -> None:
    """Let children that still compile go on without this process: the next one needs what they make."""
    for child, _ in _children:
        if child.poll() is None:
            child.returncode = 0  # nobody will ask; without a number Python warns that it was left behind

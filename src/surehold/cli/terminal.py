"""The console of a run: when nobody can be told any more, the run goes on in silence and writes its files."""

import codecs
import os
import sys
from contextlib import suppress
from typing import IO, Any, Final

from rich.console import Console

__all__ = ["speak_plainly", "terminal"]

_PLAIN: Final = {"–": "-", "—": "-", "±": "+/-", "°": " deg", "µ": "u", "μ": "u", "²": "^2", "³": "^3", "…": "..."}


class _Patient:
    """The standard output, after whose failure (a closed pipe, a full disk) nothing is written to it any more."""

    def __init__(self, stream: IO[str] | None):
        self._stream = stream
        self._lost = stream is None  # it was closed before the start

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        if self._stream is not None and not self._lost:
            try:
                return self._stream.write(text)
            except OSError as error:
                self._lose(self._stream, error)
        return len(text)

    def flush(self) -> None:
        if self._stream is not None and not self._lost:
            try:
                self._stream.flush()
            except OSError as error:
                self._lose(self._stream, error)

    def _lose(self, stream: IO[str], error: OSError) -> None:
        self._lost = True
        if not isinstance(error, BrokenPipeError):  # who closes a pipe knows it
            reason = f"{error.strerror or error}"
            with suppress(OSError):
                print(  # noqa: T201
                    f"warning: the output cannot be written ({reason}); the run goes on in silence and writes its "
                    "files.",
                    file=sys.stderr,
                )
        with suppress(OSError):  # or Python complains when it flushes at exit
            nothing = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nothing, stream.fileno())
            os.close(nothing)


def terminal() -> Console:
    """Return the console for what a run says."""
    speak_plainly()
    return Console(file=_Patient(sys.stdout), highlight=False)  # type: ignore[arg-type]


def speak_plainly() -> None:
    """Let the standard output write what its encoding does not have (PYTHONIOENCODING=ascii) in plain characters."""
    codecs.register_error("surehold.plain", _plainly)
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None and sys.stdout.errors in ("strict", "surrogateescape"):
        reconfigure(errors="surehold.plain")


def _plainly(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(_PLAIN.get(c, "?") for c in lost), error.end

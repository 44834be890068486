"""The console of a run: when its reader goes away (a closed pipe), the run goes on in silence and writes its files."""

import os
import sys

from rich.console import Console

__all__ = ["terminal"]


class _Patient(Console):
    """A console that survives a closed pipe; `on_broken_pipe` is rich's hook for that."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())  # or Python complains when it flushes at exit
        os.close(nothing)


def terminal() -> Console:
    """Return the console for what a run says."""
    return _Patient(highlight=False)

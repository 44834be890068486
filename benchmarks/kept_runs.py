"""Finished runs in a file, a line each, so that a benchmark which is stopped goes on where it was.

A line is a JSON list: what the run is told by, a few words or numbers, and at its end what was found.
"""

import json
from pathlib import Path
from typing import Any

__all__ = ["keep", "kept"]


def kept(file: Path | None) -> dict[tuple[Any, ...], Any]:
    """Return what was found by what the runs are told by; none without a file, or before there is one."""
    if file is None or not file.exists():
        return {}
    return {tuple(run): found for *run, found in map(json.loads, file.read_text(encoding="utf-8").splitlines())}


def keep(file: Path | None, run: tuple[Any, ...], found: Any) -> None:
    """Add a finished run to the file, if there is one."""
    if file is not None:
        with file.open("a", encoding="utf-8") as lines:
            print(json.dumps([*run, found]), file=lines)

"""One table of all short benchmarks, stored with the machine's yardstick and compared with the one stored before.

`python -m benchmarks` (what `make bench` runs) writes results/benchmarks/DATE.json. Times are CPU seconds, or wall
seconds where several processes work. Between runs they are compared in units of the yardstick, the time of LAPACK
dpotrf on a 140 x 140 matrix in the same run, so that a slower hour of a shared machine is no loss.
"""

import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

FOLDER = Path("results/benchmarks")
LOSS = 1.25  # a row that takes so many times as long as before is marked; shared machines vary by less


class Row(NamedTuple):
    """What was measured."""

    name: str
    seconds: float
    asked: float | None = None
    """seconds that it may take"""
    floor: float | None = None
    """seconds of the least that has to be done: dpotrf of the trials' matrix, a copy of the trials, one look at the
    distance field"""
    megabytes: float | None = None
    """most memory that the process held"""


def last(folder: Path = FOLDER) -> dict[str, float]:
    """Return the rows stored last, in yardsticks; none where nothing is stored."""
    stored = read(folder)
    return {name: row["seconds"] / stored["yardstick"] for name, row in stored["rows"].items()} if stored else {}


def read(folder: Path = FOLDER) -> dict[str, Any]:
    """Return what was stored last; empty where nothing is."""
    files = sorted(folder.glob("*.json"))
    return json.loads(files[-1].read_text(encoding="utf-8")) if files else {}


def lines(rows: Sequence[Row], yardstick: float, before: Mapping[str, float]) -> Iterator[str]:
    """Yield the table: seconds, yardsticks, how many times what is asked, the floor, and what was stored before.

    What takes longer than asked, or than before, is marked.
    """
    yield f"{'':62} {'seconds':>10} {'yardsticks':>10} {'to asked':>9} {'to floor':>9} {'to the last':>12}"
    for row in rows:
        units = row.seconds / yardstick
        ratio = units / before[row.name] if before.get(row.name) else None
        marks = "  OVER" * (row.asked is not None and row.seconds > row.asked)
        marks += "  SLOWER" * (ratio is not None and ratio > LOSS)
        shown = "new" if ratio is None else f"{ratio:.2f}"
        asked, floor = (_times(row.seconds, limit) for limit in (row.asked, row.floor))
        held = "" if row.megabytes is None else f"  {row.megabytes:.0f} MB"
        yield f"{row.name:62} {row.seconds:10.4f} {units:10.0f} {asked:>9} {floor:>9} {shown:>12}{held}{marks}"


def store(rows: Sequence[Row], yardstick: float, load: float = 0.0, folder: Path = FOLDER) -> Path:
    """Write the rows, with the yardstick, the machine and its load, and return the file."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{datetime.now(UTC):%Y-%m-%d-%H%M%S}.json"
    content = {
        "machine": platform.platform(),
        "load": load,
        "yardstick": yardstick,
        "rows": {
            row.name: {name: value for name, value in row._asdict().items() if name != "name" and value is not None}
            for row in rows
        },
    }
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return path


def _times(seconds: float, limit: float | None) -> str:
    return "" if limit is None else f"{seconds / limit:.3g}"

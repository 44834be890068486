"""One table of all short benchmarks, stored with the machine's yardstick and compared with the one stored before.

`python -m benchmarks` (what `make bench` runs) writes results/benchmarks/DATE.json. Times are CPU seconds; between runs
they are compared in units of the yardstick, the time of LAPACK dpotrf on a 140 x 140 matrix in the same run, so that a
slower hour of a shared machine is no loss.
"""

import json
import platform
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

FOLDER = Path("results/benchmarks")
LOSS = 1.25  # a row that takes so many times as long as before is marked; shared machines vary by less


def last(folder: Path = FOLDER) -> dict[str, float]:
    """Return the rows stored last, in yardsticks; none where nothing is stored."""
    files = sorted(folder.glob("*.json"))
    if not files:
        return {}
    stored = json.loads(files[-1].read_text(encoding="utf-8"))
    return {name: seconds / stored["yardstick"] for name, seconds in stored["seconds"].items()}


def lines(seconds: Mapping[str, float], yardstick: float, before: Mapping[str, float]) -> Iterator[str]:
    """Yield the table: seconds, yardsticks, and the ratio to what was stored before; what is lost is marked."""
    yield f"{'':58} {'seconds':>10} {'yardsticks':>12} {'to the last':>12}"
    for name, value in seconds.items():
        units = value / yardstick
        ratio = units / before[name] if before.get(name) else None
        shown = "new" if ratio is None else f"{ratio:.2f}"
        lost = "  SLOWER" if ratio is not None and ratio > LOSS else ""
        yield f"{name:58} {value:10.4f} {units:12.0f} {shown:>12}{lost}"


def store(seconds: Mapping[str, float], yardstick: float, folder: Path = FOLDER) -> Path:
    """Write the rows, with the yardstick and the machine, and return the file."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{datetime.now(UTC):%Y-%m-%d-%H%M%S}.json"
    content = {"machine": platform.platform(), "yardstick": yardstick, "seconds": dict(seconds)}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return path

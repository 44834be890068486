"""The table of a campaign on disk: JSON lines, a header and one row a run, each appended whole.

A folder holds `table.jsonl`, or `table-2-of-8.jsonl` for a share, and may hold a packed `table.jsonl.gz` of earlier
runs; all are read together. A line that is damaged (the machine went down while it was written) is dropped and its run
made again. One process writes to a table at a time.
"""

import gzip
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from surehold.campaigns.plan import Plan
from surehold.errors import InputError, SureholdError
from surehold.store.atomic import checked_folder, write_file
from surehold.store.locks import LockTaken, locked

__all__ = ["PACKED", "Records", "Table", "opened", "pack", "read_folder"]

FORMAT: Final = "surehold campaign 1"
PACKED: Final = "table.jsonl.gz"

Key = tuple[str, str, int]
Settings = dict[tuple[str, str], tuple[str, str | Path]]  # digest of a cell, and the table that has it


@dataclass
class Records:
    """What the tables of a folder hold."""

    header: dict[str, Any]
    """format, surehold (version), plan, title, cells"""
    rows: dict[Key, dict[str, Any]] = field(default_factory=dict)
    """by problem, method and seed"""
    notes: list[str] = field(default_factory=list)
    """what was dropped"""

    @property
    def runs(self) -> int:
        """Seeds of each problem and method: the plan's, or as many as were made beyond them."""
        cells = self.cells
        made = [seed + 1 for problem, method, seed in self.done if (problem, method) in cells]
        return max([self.header["runs"], *made])

    @property
    def cells(self) -> set[tuple[str, str]]:
        """Problems and methods of the plan; the tables may hold runs of others, which it had before."""
        return {(cell["problem"], cell["method"]) for cell in self.header["cells"]}

    @property
    def done(self) -> dict[Key, dict[str, Any]]:
        """Rows of the runs that finished."""
        return {key: row for key, row in self.rows.items() if row["status"] == "done"}

    @property
    def failed(self) -> dict[Key, dict[str, Any]]:
        """Rows of the runs that failed."""
        return {key: row for key, row in self.rows.items() if row["status"] == "failed"}


class Table:
    """A table that is being written; made by `opened`."""

    def __init__(self, path: Path, records: Records):
        self.path: Final = path
        self.records: Final = records
        """of the whole folder"""
        self._forced = float("-inf")

    def append(self, row: dict[str, Any]) -> None:
        """Append a row, whole or not at all; it is forced to the disk when a second has passed since the last one.

        A process that is killed loses nothing; only a machine that goes down can take the last second's rows with it.

        Raises
        ------
        SureholdError
            If it cannot be written; everything before it stays.
        """
        raw = _line(row)
        try:
            with open(self.path, "r+b", buffering=0) as file:
                size = file.seek(0, os.SEEK_END)
                try:
                    written = file.write(raw)
                    if written != len(raw):  # the disk filled up inside the row
                        file.write(raw[written:])  # raises what is the matter
                    if time.monotonic() - self._forced > 1.0:  # milliseconds on many disks, more than a short run
                        os.fsync(file.fileno())
                        self._forced = time.monotonic()
                except OSError:
                    file.truncate(size)
                    raise
        except OSError as error:
            raise SureholdError(
                f"table '{self.path}' cannot be written ({error.strerror or error}); its {len(self.records.rows)} runs "
                "are kept. Free space and start again: the campaign continues where it was."
            ) from None
        self.records.rows[_key(row)] = row

    def sort(self, plan: Plan) -> None:
        """Write this table's rows in the plan's order, seed by seed, whatever order they were finished in."""
        own = _read(self.path, [])[1]
        places = {(cell.problem, cell.method): i for i, cell in enumerate(plan.cells())}
        rows = sorted(
            ({_key(row): row for row in own}).values(),
            key=lambda row: (row["seed"], places.get((row["problem"], row["method"]), len(places)), _key(row)),
        )
        raw = b"".join([_line(self.records.header), *map(_line, rows)])
        if raw != self.path.read_bytes():
            write_file(self.path, raw)


@contextmanager
def opened(folder: str | Path, plan: Plan, shard: tuple[int, int] = (1, 1)) -> Iterator[Table]:
    """Open the folder's table for one process: made if it is not there, repaired if it is damaged.

    Raises
    ------
    InputError
        If another process writes to it, it was written by another version, or it holds runs of other settings.
    """
    from surehold import __version__

    place = checked_folder(folder)
    path = place / ("table.jsonl" if shard[1] == 1 else f"table-{shard[0]}-of-{shard[1]}.jsonl")
    with _locked(path.with_suffix(".lock")):
        header = {
            "format": FORMAT,
            "surehold": __version__,
            "plan": plan.name,
            "title": plan.title,
            "note": plan.note,
            "runs": plan.runs,
            "cells": [
                {"problem": cell.problem, "method": cell.method, **cell.as_data(), "digest": cell.digest}
                for cell in plan.cells()
            ],
        }
        if not path.exists() or path.stat().st_size == 0:
            write_file(path, _line(header))
        dropped = _repaired(path)
        records = read_folder(place)
        records.notes[:0] = dropped
        if records.header["surehold"] != __version__:
            raise InputError(
                f"the table in '{place}' was written by surehold {records.header['surehold']}, this is {__version__}; "
                "its runs would not compare. Finish it with that version, or start anew with another --out."
            )
        _same_settings(place, plan, records)
        records.header = header
        first, _, rows = path.read_bytes().partition(b"\n")
        if first + b"\n" != _line(header):  # a plan that has grown: its page shows it although the run is interrupted
            write_file(path, _line(header) + rows)
        yield Table(path.absolute(), records)  # a function may go to another folder


def read_folder(folder: str | Path) -> Records:
    """Read all tables of a folder, or one table file.

    Raises
    ------
    InputError
        If there is none, one has another format, or two belong to different plans or settings.
    """
    place = Path(folder)
    paths = [place] if place.is_file() else sorted(place.glob("table*.jsonl*"))
    if not paths:
        raise InputError(
            f"'{place}' holds no table of a campaign; run one first: surehold campaign run NAME --out DIR."
        )
    notes: list[str] = []
    records: Records | None = None
    settings = Settings()
    for path in paths:
        header, rows = _read(path, notes)
        if records is None:
            records = Records(header, notes=notes)
        elif header["plan"] != records.header["plan"]:
            raise InputError(
                f"'{place}' holds runs of the plans '{records.header['plan']}' and '{header['plan']}'; "
                "give each plan a folder of its own."
            )
        for row in rows:
            _take_in(row, records.rows, settings, path)
    assert records is not None
    return records


def pack(folders: Sequence[str | Path], target: str | Path) -> Path:
    """Write the rows of several folders of one plan as one compressed table into the folder `target`; return its path.

    Of runs that several folders hold, the first that finished are kept, of those that failed in all the last; the
    target's own plain tables become part of it.
    """
    taken, settings = dict[Key, dict[str, Any]](), Settings()
    header: dict[str, Any] = {}
    for folder in folders:
        records = read_folder(folder)
        header = header or records.header
        if records.header["plan"] != header["plan"]:
            raise InputError(f"plans '{header['plan']}' and '{records.header['plan']}' do not go into one table.")
        for row in records.rows.values():
            _take_in(row, taken, settings, folder)
    rows = sorted(taken.values(), key=lambda row: (row["seed"], row["problem"], row["method"]))
    raw = b"".join([_line(header), *map(_line, rows)])
    place = checked_folder(target)
    write_file(place / PACKED, gzip.compress(raw, 9, mtime=0))
    if place in [Path(folder) for folder in folders]:
        for plain in [*place.glob("table*.jsonl"), *place.glob("table*.lock")]:
            plain.unlink()
    return place / PACKED


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    try:
        with locked(path, wait=False):
            yield
    except LockTaken as error:
        raise InputError(
            f"another process ({error.owner}) runs this campaign in '{path.parent}'; wait for it, or take another "
            "share (--shard) or folder (--out)."
        ) from None


def _repaired(path: Path) -> list[str]:
    """Write a damaged table again without its damaged rows; return what was dropped."""
    notes: list[str] = []
    header, rows = _read(path, notes)
    if notes:
        write_file(path, b"".join([_line(header), *map(_line, rows)]))
    return notes


def _same_settings(place: Path, plan: Plan, records: Records) -> None:
    digests = {(cell.problem, cell.method): cell for cell in plan.cells()}
    if records.header["plan"] != plan.name:
        raise InputError(
            f"'{place}' holds runs of the plan '{records.header['plan']}', not of '{plan.name}'; choose another --out."
        )
    for (problem, method, _), row in records.rows.items():
        cell = digests.get((problem, method))
        if cell is not None and row["digest"] != cell.digest:
            now, then = cell.as_data(), row["settings"]
            changed = [name for name in now if json.loads(json.dumps(now[name])) != then.get(name)]
            raise InputError(
                f"'{place}' holds runs of {method} on {problem} with another {' and '.join(changed) or 'setting'} "
                f"than the plan '{plan.name}' has now; choose another --out, or restore the plan."
            )


def _read(path: Path, notes: list[str]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return header and rows of a table file; damaged rows are left out and noted."""
    try:
        raw = path.read_bytes()
        if path.suffix == ".gz":
            raw = gzip.decompress(raw)
    except (OSError, EOFError) as error:
        raise InputError(f"table '{path}' cannot be read ({getattr(error, 'strerror', None) or error}).") from None
    first, *lines = raw.split(b"\n")
    header = _parsed(first)
    if header is None or "format" not in header:
        raise InputError(
            f"'{path}' is no table of a campaign: its first line is no header. Move it away to start anew."
        )
    if header["format"] != FORMAT:
        raise InputError(
            f"table '{path}' has the format {header['format']!r}, written by surehold {header.get('surehold', '?')}; "
            f"this version reads {FORMAT!r}. Read it with that version, or choose another --out."
        )
    rows = []
    for number, line in enumerate(lines, start=2):
        if not line:
            continue
        row = _parsed(line)
        whole = number <= len(lines)  # every row ends with a newline
        if row is None or not whole or not {"problem", "method", "seed", "status", "digest"} <= row.keys():
            notes.append(f"line {number} of '{path}' is damaged and was dropped; its run is made again.")
            continue
        rows.append(row)
    return header, rows


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        value = json.loads(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _line(row: Mapping[str, Any]) -> bytes:
    return json.dumps(row, separators=(",", ":"), allow_nan=False, default=list).encode() + b"\n"


def _take_in(row: dict[str, Any], rows: dict[Key, dict[str, Any]], settings: Settings, place: str | Path) -> None:
    """Add a row to those of other tables, in the place of one that failed; all of a cell have the same settings."""
    problem, method, _ = key = _key(row)
    digest, where = settings.setdefault((problem, method), (row["digest"], place))
    if row["digest"] != digest:
        tables = f"'{place}' holds" if where == place else f"'{where}' and '{place}' hold"
        raise InputError(f"{tables} runs of {method} on {problem} with different settings; keep those of one.")
    known = rows.get(key)
    if known is None or known["status"] == "failed":
        rows[key] = row


def _key(row: Mapping[str, Any]) -> Key:
    return row["problem"], row["method"], int(row["seed"])

"""What an earlier run left in a folder that is used again: its files go, and nobody else's.

A folder holds a list of what was written into it, with a checksum of each file. A file that has changed since, or is
not listed, is its user's and stays.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from surehold.errors import InputError
from surehold.store.atomic import noted_writes, write_file

__all__ = ["LIST", "listed_writes"]

#: Name of the list in the folder.
LIST: Final = ".surehold-files.json"


@contextmanager
def listed_writes(folder: Path, *, replacing: bool = False) -> Iterator[list[str]]:
    """List what the block writes below the folder; yields the names of what is removed, known after the block.

    Parameters
    ----------
    replacing
        Whether what was listed before, and the block does not write again, is removed when it has ended. After an error
        nothing is.
    """
    place = folder.resolve()
    before, removed = _listed(place), list[str]()
    with noted_writes() as written:
        try:
            yield removed
        except BaseException:
            with suppress(InputError):  # the error of the block says more
                _list(place, before, written)
            raise
    if replacing:
        kept = {name: digest for name, digest in before.items() if place / name not in written}
        removed += [name for name, digest in kept.items() if _remove(place, name, digest)]
    _list(place, {name: digest for name, digest in before.items() if name not in removed}, written)


def _list(place: Path, before: Mapping[str, str], written: Mapping[Path, str]) -> None:
    now = {p.relative_to(place).as_posix(): digest for p, digest in written.items() if p.is_relative_to(place)}
    write_file(place / LIST, json.dumps(dict(sorted((dict(before) | now).items())), indent=0) + "\n")


def _listed(place: Path) -> dict[str, str]:
    """Return the checksums by name; none where there is no list, or none that can be read."""
    try:
        content = json.loads((place / LIST).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {str(k): str(v) for k, v in content.items()} if isinstance(content, dict) else {}


def _remove(place: Path, name: str, digest: str) -> bool:
    """Remove a file below the folder that is as it was written, and the folders that it leaves empty."""
    path = place / name
    with suppress(OSError, ValueError):
        inside = path.parent.resolve().is_relative_to(place)  # a list from elsewhere may say anything
        if not inside or path.is_symlink() or hashlib.sha256(path.read_bytes()).hexdigest() != digest:
            return False
        path.unlink()
        for parent in path.parents:
            if parent == place:
                break
            with suppress(OSError):  # it is not empty
                parent.rmdir()
        return True
    return False

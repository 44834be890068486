"""Where the files of a command go."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from surehold.store.atomic import checked_folder, new_folder

__all__ = ["folder_of", "removed_on_error"]


def folder_of(out: str, name: str) -> Path:
    """Return the folder `out`, or a new one in runs/ where that is empty; created and writable.

    The new one is called by the name, its words joined by hyphens, with -2, -3, ... behind it where that is taken: no
    run replaces another.
    """
    if out:
        return checked_folder(out)
    slug = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "run"
    return new_folder(Path("runs") / slug)


@contextmanager
def removed_on_error(folder: Path) -> Iterator[None]:
    """Remove a command's folder in runs/ where the block fails before anything was written into it."""
    place = folder.absolute()
    try:
        yield
    except BaseException:
        if folder.parent == Path("runs"):
            with suppress(OSError):  # it is not empty
                place.rmdir()
        raise

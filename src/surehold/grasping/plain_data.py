"""Data only: YAML files without anything that expands or runs, regular files of a limited size, records for JSON."""

import stat
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from surehold.errors import InputError

__all__ = ["grasp_to_dict", "plain_yaml", "regular_bytes"]

MAX_BYTES = 64 * 2**20


def regular_bytes(path: str | Path, most: int = MAX_BYTES) -> bytes:
    """Return the content of a regular file of at most `most` bytes; InputError if it is none or cannot be read."""
    where = str(path)
    try:
        status = Path(path).stat()
        if not stat.S_ISREG(status.st_mode):  # reading a pipe or a device might never end
            raise InputError(f"{where!r} is no regular file; give a file on disk.")
        if status.st_size > most:
            raise InputError(f"{where!r} is larger than {most // 2**20} MB; split it into several files.")
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {where!r}: {error.strerror}.") from None
    except ValueError as error:  # a path with a zero byte
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot read {where!r}: {error}.") from None


def plain_yaml(path: str | Path) -> Any:
    """Return the content of a YAML file that holds data only: no tags, no aliases, no key twice, at most 64 MB.

    Raises InputError if the file cannot be read or is anything else.
    """
    where = str(path)
    content = regular_bytes(path)
    try:
        return yaml.load(content.decode("utf-8"), Loader=_PlainLoader)
    except UnicodeDecodeError:
        raise InputError(f"{where!r} is not a text file in UTF-8; give a YAML file.") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(f"{where!r} is not plain YAML: {' '.join(str(error).split())}") from None


def grasp_to_dict(value: object) -> Any:
    """Return a grasp, or anything made of dataclasses, named tuples, arrays, mappings and numbers, as plain JSON data.

    Arrays become nested lists, numbers that are not finite become None (JSON has no NaN). Dataclass fields whose
    metadata say `derived` are left out: they follow from the others; properties that the class names in `told_too` are
    taken in. Raises InputError for a value that has no plain form.
    """
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.ndarray):
        return grasp_to_dict(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        names = [f.name for f in fields(value) if not f.metadata.get("derived")]
        return {name: grasp_to_dict(getattr(value, name)) for name in (*names, *getattr(value, "told_too", ()))}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {k: grasp_to_dict(v) for k, v in value._asdict().items()}  # type: ignore[attr-defined]
    if isinstance(value, Mapping):
        return {str(k): grasp_to_dict(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [grasp_to_dict(v) for v in value]
    if isinstance(value, Path):
        return str(value)
    raise InputError(f"a {type(value).__name__} has no form in JSON; give numbers, arrays, mappings, records.")


class _PlainLoader(yaml.SafeLoader):
    """YAML without anchors and aliases, which can expand a small file without bound, and without keys given twice."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError(f"aliases (*name) are not supported{self.peek_event().start_mark}")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict:
        mapping = super().construct_mapping(node, deep=deep)
        if len(mapping) != len(node.value):
            names = [key.value for key, _ in node.value]
            twice = next((name for name in names if names.count(name) > 1), names[0])
            raise yaml.YAMLError(f"key {twice!r} is given twice{node.start_mark}")
        return mapping

"""Points and values as people hand them over: arrays, lists, dictionaries, rows and tables of pandas.

Whatever carries names is read by its names, never by the order in which it holds them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError

__all__ = ["column_of", "named_rows", "numbers_of", "points_of"]

_KINDS = {"M": "a date", "m": "a duration", "c": "complex"}


def points_of(x: Any, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return x as points (..., d).

    Parameters
    ----------
    x
        Numbers (..., d) in the order of the names; or a dictionary, a Series of pandas, a structured array: a number
        (or numbers of one shape) for each name; a list of these; or a DataFrame with a column for each name.
    names
        Of the d variables.

    Raises
    ------
    InputError
        If there are other names, masked entries, dates, complex numbers, or anything else that is no number.
    """
    if type(x) is np.ndarray and x.dtype == np.float64:
        points = x
    elif (rows := _listed(x)) is not None:
        points = np.stack([_stacked(row, names) for row in rows])
    elif (named := _by_name(x)) is not None:
        points = _stacked(named, names)
    else:
        try:
            points = numbers_of(x)
        except (TypeError, ValueError, OverflowError) as error:
            wanted = f"{len(names)} numbers ({', '.join(names)})"
            raise InputError(f"point {_short(x)} {_why(error)}; give {wanted}.") from None
    if points.ndim == 0 or points.shape[-1] != len(names):
        raise InputError(
            f"points of shape {points.shape} do not fit; the last axis must have {len(names)} "
            f"entries ({', '.join(names)})."
        )
    return points


def numbers_of(value: Any) -> NDArray[np.float64]:
    """Return value as an array; TypeError where NumPy would turn what is no number into one.

    Masked entries, dates, durations and complex numbers are refused. ValueError for text that is no number.
    """
    listed = isinstance(value, (list, tuple)) and any(entry is np.ma.masked for entry in value)
    if listed or np.ma.is_masked(value):
        raise TypeError("has masked entries")
    array = np.asarray(value)
    kinds = {array.dtype.kind} if array.dtype != object else {np.asarray(entry).dtype.kind for entry in array.flat}
    for kind in sorted(kinds & set(_KINDS)):
        raise TypeError(f"holds {_KINDS[kind]}" if kind != "c" else "is complex")
    return array.astype(np.float64)


def column_of(name: str, values: Any) -> NDArray[np.float64]:
    """Return values as an array; raises InputError, which begins with the name, where some of them are no numbers."""
    try:
        return numbers_of(values)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} {_why(error)}; give numbers, one a trial.") from None


def named_rows(x: Any) -> tuple[list[dict[Any, Any]], bool] | None:
    """Return the dictionaries that x is made of, and whether it is a table of them; None of what carries no names."""
    if (rows := _listed(x)) is not None:
        return rows, True
    named = _by_name(x)
    if named is None:
        return None
    if hasattr(x, "columns") or (isinstance(x, np.ndarray) and x.ndim):
        columns = {name: list(values) for name, values in named.items()}
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)], True
    return [named], False


def _listed(x: Any) -> list[dict[Any, Any]] | None:
    """Return the dictionaries of a list of points that carry names; None of what is none."""
    rows = [_by_name(row) for row in x] if isinstance(x, (list, tuple)) else []
    return [row or {} for row in rows] if any(row is not None for row in rows) else None


def _by_name(x: Any) -> dict[Any, Any] | None:
    """Return {name: value} of whatever carries names; None of what carries none."""
    if isinstance(x, Mapping):
        return dict(x)
    if isinstance(x, (np.ndarray, np.void)):
        return None if x.dtype.names is None else {name: x[name] for name in x.dtype.names}
    if hasattr(x, "columns") and hasattr(x, "to_numpy"):  # a table of pandas, or of a library like it
        return {name: x[name].to_numpy() for name in x.columns}
    if hasattr(x, "index") and hasattr(x, "to_dict") and hasattr(x, "to_numpy"):  # a Series of pandas
        return dict(x.to_dict())
    return None


def _stacked(named: dict[Any, Any], names: tuple[str, ...]) -> NDArray[np.float64]:
    missing = [name for name in names if name not in named]
    others = [name for name in named if name not in names]
    if missing or others:
        parts = [f"says nothing about {', '.join(missing)}"] * bool(missing)
        parts += [f"names {', '.join(map(repr, others))}, which the box does not know"] * bool(others)
        raise InputError(f"point {_short(named)} {' and '.join(parts)}; name exactly {', '.join(names)}.")
    try:
        columns = [numbers_of(named[name]) for name in names]
        return np.stack(columns, axis=-1)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"point {_short(named)} {_why(error)}; give a number for each name.") from None


def _why(error: Exception) -> str:
    text = str(error)
    return text if text.startswith(("has masked", "holds a", "is complex")) else "is not numeric"


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 200 else f"{text[:197]}..."

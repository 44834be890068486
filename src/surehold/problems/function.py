"""A user's own function as a problem: a callable, `package.module:function` or `path/file.py:function`."""

import importlib
import importlib.util
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box
from surehold.problems.problem import checked_points

__all__ = ["Function", "exit_in_words", "load_function", "parse_bounds"]


class Function:
    """A function of one array (d,) that returns a number, with its box.

    Parameters
    ----------
    f
        Called with one point (d,) float64 in the units of the box; returns a number, or a number and a dictionary of
        further outputs. What it raises passes through, but for SystemExit: sys.exit() would end the run, and is an
        error of the trial.
    box
        Named bounds of the d inputs.
    name
        Shown in reports; the function's own name if not given.

    Raises
    ------
    InputError
        If f cannot be called; and on a call, if it returns something that is not one real number.
    """

    def __init__(self, f: Callable[[NDArray[np.float64]], Any], box: Box, name: str | None = None):
        if not callable(f):
            raise InputError(f"function is {f!r}, which cannot be called; give a function of one array (d,).")
        self.name: Final[str] = name or getattr(f, "__name__", type(f).__name__)
        self.box: Final[Box] = box
        self._f = f

    def __call__(self, x: ArrayLike) -> float | NDArray[np.float64]:
        """Return the value at x (d,) as a float, or the values at x (n, d) as an array (n,), one call a point."""
        points, single = checked_points(x, self.box)
        values = [self._value(point) for point in points]
        return values[0] if single else np.array(values)

    def trial(self, x: NDArray[np.float64]) -> Any:
        """Return whatever the function does at one x (d,): a number, or a number and {name: value} of more outputs."""
        try:
            return self._f(x)
        except SystemExit as end:
            raise RuntimeError(exit_in_words(end)) from end

    def _value(self, point: NDArray[np.float64]) -> float:
        value = self.trial(point.copy())
        if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], Mapping):
            value = value[0]
        try:
            if np.ndim(value) > 0 and np.size(value) != 1:
                raise TypeError
            return float(np.asarray(value).reshape(()))
        except (TypeError, ValueError):
            raise InputError(
                f"{self.name} returned {str(value)[:60]!r} ({type(value).__name__}) at {point.tolist()}; "
                "it must return one real number."
            ) from None

    def __repr__(self) -> str:
        return f"<{self.name} on {self.box!r}>"


def exit_in_words(end: SystemExit) -> str:
    """Return what a function did that would have ended the program."""
    return f"it called sys.exit({'' if end.code is None else end.code})"


def load_function(reference: str) -> Callable[[NDArray[np.float64]], Any]:
    """Return the function named by `package.module:function` or `path/to/file.py:function`.

    Loading runs the module, as every import does.

    Raises
    ------
    InputError
        If the reference has no colon, the module or file is missing or fails to load, or the name in it is missing
        or not callable.
    """
    place, colon, attribute = reference.rpartition(":")
    if not colon or not place or not attribute:
        raise InputError(
            f"function {reference!r} is not of the form package.module:function or path/to/file.py:function."
        )
    module = _from_file(place) if place.endswith(".py") else _from_name(place)
    found: Any = module
    for part in attribute.split("."):
        if not hasattr(found, part):
            offered = [n for n, v in vars(module).items() if callable(v) and not n.startswith("_")]
            if not offered:
                raise InputError(f"{place} has no function {attribute!r}, nor any other public one.")
            raise unknown_name(f"function of {place}", attribute, offered)
        found = getattr(found, part)
    if not callable(found):
        raise InputError(f"{reference} is a {type(found).__name__}, not a function; name a function of one array (d,).")
    return found


def parse_bounds(text: str) -> Box:
    """Return the box written as `name=lower:upper,name=lower:upper`, or without names as `lower:upper,lower:upper`.

    Raises
    ------
    InputError
        If the text does not follow this form, repeats a name, or holds bounds that are no bounds.

    Examples
    --------
    >>> parse_bounds("dx=-0.05:0.05, dy=0:1")
    Box({'dx': (-0.05, 0.05), 'dy': (0, 1)})
    >>> parse_bounds("0:1,0:1").names
    ('x1', 'x2')
    """
    bounds: dict[str, tuple[float, float]] = {}
    for i, part in enumerate(text.split(",")):
        name, equals, span = part.partition("=") if "=" in part else ("", "", part)
        name = name.strip() if equals else f"x{i + 1}"
        lower, colon, upper = span.partition(":")
        try:
            if not colon or not name:
                raise ValueError
            pair = (float(lower), float(upper))
        except ValueError:
            kinds = " For logarithmic, whole-number and choice variables use surehold study create --parameters."
            raise InputError(
                f"bounds {part.strip()!r} are not of the form name=lower:upper; write for example "
                f"--bounds dx=-0.05:0.05,dy=0:1.{kinds * ('=' not in span and ('|' in span or span.count(':') > 1))}"
            ) from None
        if name in bounds:
            raise InputError(f"bounds name {name!r} twice; give each variable once.")
        bounds[name] = pair
    return Box(bounds)


def _from_file(place: str) -> ModuleType:
    path = Path(place)
    if not path.is_file():
        raise InputError(f"file {place!r} does not exist; give the path of a Python file, then :function.")
    spec = importlib.util.spec_from_file_location(path.stem, path.resolve())
    if spec is None or spec.loader is None:
        raise InputError(f"file {place!r} cannot be loaded as Python.")
    module = importlib.util.module_from_spec(spec)
    folder = str(path.resolve().parent)
    sys.path.insert(0, folder)  # as `python path/file.py` does, so that the file finds its neighbors
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # a program without `if __name__ == "__main__"` may call sys.exit()
        raise InputError(f"file {place!r} fails to load: {type(error).__name__}: {error}") from error
    finally:
        if folder in sys.path:
            sys.path.remove(folder)
    return module


def _from_name(place: str) -> ModuleType:
    here = str(Path.cwd())
    added = here not in sys.path and "" not in sys.path
    if added:
        sys.path.insert(0, here)  # an installed console script does not see the current folder by itself
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError as error:
        if error.name is not None and (place == error.name or place.startswith(error.name + ".")):
            raise InputError(
                f"module {place!r} is not found from here ({here}); install it, change to its folder, or give "
                "path/to/file.py:function."
            ) from None
        raise InputError(f"module {place!r} fails to load: {error}") from error
    except (Exception, SystemExit) as error:
        raise InputError(f"module {place!r} fails to load: {type(error).__name__}: {error}") from error
    finally:
        if added and here in sys.path:
            sys.path.remove(here)

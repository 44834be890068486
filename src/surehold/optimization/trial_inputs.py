"""Inputs of trials as they are told, in the box's units, as points whose unit cube is the box."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.amounts import amount
from surehold.defaults import ROUNDED
from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.variables import Number

__all__ = [
    "astray_in_words",
    "check_levels",
    "check_place",
    "check_tried",
    "initial_inputs",
    "query_points",
    "trial_input",
    "trial_inputs",
]

# A reached input farther away counts as so many box widths away: nothing is learnt from the difference, and squares of
# it stay finite.
_FARTHEST: Final = 1e6

# A reached input that is farther out of the box than this many box widths is rather of another unit than astray.
_ASTRAY: Final = 1.0


def trial_inputs(box: Box, name: str, X: ArrayLike, inside: bool) -> NDArray[np.float64]:
    """Return points (k, d), the unit cube being the box."""
    none = not hasattr(X, "columns") and np.size(X) == 0
    points = np.empty((0, box.dimension)) if none else box.points(X)
    U = _near(box, points)
    if U.ndim != 2:
        raise InputError(f"{name} has shape {U.shape}; give one row a trial, (t, {box.dimension}).")
    sound = np.isfinite(points).all(axis=1)
    if inside:
        sound &= np.all((U >= 0.0) & (U <= 1.0), axis=1)
    if not sound.all():
        bad = points[int(np.argmin(sound))]
        wanted = f"not inside {box}" if inside else "not finite"
        raise InputError(f"{name} holds {box.as_given(bad)}, which is {wanted}.")
    return U


def trial_input(box: Box, name: str, x: Any) -> NDArray[np.float64]:
    """Return the finite point x (d,), the unit cube being the box."""
    points = box.points(x)
    u = _near(box, points)
    if u.ndim != 1:
        raise InputError(f"{name} has shape {u.shape}; tell one trial at a time, of shape ({len(box.names)},).")
    if not np.all(np.isfinite(points)):
        raise InputError(f"{name} is {points.tolist()}; every coordinate must be a finite number.")
    return u


def query_points(box: Box, X: Any) -> NDArray[np.float64]:
    """Return finite points X (q, d), or one (d,), inside of the box or not, the unit cube being the box: (q, d)."""
    U = np.atleast_2d(box.to_unit(X))
    if U.ndim != 2:
        raise InputError(f"X has shape {U.shape}; give one row a point, (q, {box.dimension}).")
    if not np.all(np.isfinite(U)):
        bad = np.atleast_2d(box.points(X))[int(np.argmin(np.isfinite(U).all(axis=1)))]
        raise InputError(f"X holds {bad.tolist()}; every coordinate must be a finite number.")
    return U


def check_levels(box: Box, name: str, x: Any) -> None:
    """Raise InputError where the point x (d,) lies between two levels by more than rounding: nobody can command it."""
    points, rounding = box.points(x), box.rounding
    for variable in box.variables:
        if not isinstance(variable, Number) or not variable.step:
            continue
        own = box.columns(variable.name)
        level = variable.to_value(points[own])
        if np.any(np.abs(variable.to_coordinate(level) - points[own]) > rounding[own]):
            (value,) = variable.from_coordinate(points[own])
            raise InputError(
                f"{name}: {variable.name} = {value:g} is no level; it goes from {variable.low:g} in steps of "
                f"{variable.step:g}. Tell the level that was commanded, and, where it went astray, "
                "tell(x, y, reached=...)."
            )


def check_place(box: Box, number: int, x: NDArray[np.float64], place: NDArray[np.float64]) -> None:
    """Raise InputError where a trial of this number, handed over with its x (d,), is another one than that at `place`.

    Every optimizer numbers from 0. Within `ROUNDED` of the place x may have been stored with fewer digits.
    """
    points = np.asarray(x)
    fits = points.shape == place.shape
    if not fits or not np.all(np.abs(box.to_unit(points) - place) <= ROUNDED):
        shown = box.as_given(points) if fits else points.tolist()
        raise InputError(
            f"trial {number} at {shown} was forgotten, or belongs to another optimizer: here trial {number} is at "
            f"{box.as_dict(box.from_unit(place))}. Tell the optimizer that asked for it, or tell(x, y) by the place."
        )


def check_tried(box: Box, points: NDArray[np.float64], nearest: NDArray[np.float64]) -> None:
    """Raise InputError where one of the points to be tried first (i, d) is none that can be tried; `nearest` are."""
    moved = np.any(np.abs(points - nearest) > box.rounding / box.widths, axis=1)
    if moved.any():
        given, other = box.from_unit(points[moved][0]), box.from_unit(nearest[moved][0])
        raise InputError(
            f"initial_points hold {box.as_given(given)}, which is never tried: the nearest that can be is "
            f"{box.as_dict(other)}. Give levels of variables in steps, and the values of fixed ones."
        )


def astray_in_words(box: Box, U: NDArray[np.float64]) -> str:
    """Return what a user should know of reached inputs U (t, d) that are farther out of the unit cube than it is wide.

    Empty where none is. Conditions that nobody sets may lie anywhere.
    """
    beyond = np.maximum(-U, U - 1.0)
    number = {box.columns(v.name).start: v for v in box.variables if isinstance(v, Number)}
    beyond[:, [column not in number for column in range(box.dimension)]] = 0.0
    if box.uncontrolled is not None:
        beyond[:, box.uncontrolled.held] = 0.0
    far = np.flatnonzero(np.any(beyond > _ASTRAY, axis=1))
    if not len(far):
        return ""
    column = int(np.argmax(beyond[far[0]]))
    variable = number[column]
    value = box.as_given(box.from_unit(U[far[0]]))[variable.name]
    more = " or beyond" * bool(beyond[far[0], column] >= _FARTHEST - 1.0)  # moved here by `trial_input`
    trials = f"{len(far)} of {amount(len(U), 'trial')} {'is' if len(far) == 1 else 'are'}"
    return (
        f"{trials if len(U) > 1 else 'The trial is'} told to have reached {variable.name} = {value:.12g}{more}, "
        f"farther from its range of {variable.low:.12g} to {variable.high:.12g} than that is wide"
        f"{' in logarithms' * variable.log}: next to nothing is learnt of the box there. "
        "Check the unit of what is reached."
    )


def _near(box: Box, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points of the unit cube; what lies beyond a bound by no more than rounding is on it."""
    with np.errstate(over="ignore", invalid="ignore"):
        U = box.to_unit(points)
        slack = box.rounding / box.widths
        U = np.where(-slack > U, U, np.maximum(U, 0.0))
        U = np.where(1.0 + slack < U, U, np.minimum(U, 1.0))
        return np.clip(U, -_FARTHEST, _FARTHEST)


def initial_inputs(box: Box, points: Any) -> NDArray[np.float64]:
    """Return points to be tried first as points (i, d) of the unit cube; raises InputError where one lies outside."""
    if points is None:
        return np.empty((0, box.dimension))
    rows = [box.points(point) for point in points] if isinstance(points, (list, tuple)) else box.points(points)
    return trial_inputs(box, "initial_points", np.reshape(rows, (-1, box.dimension)), inside=True)

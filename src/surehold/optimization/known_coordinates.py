"""Values of some variables by name: those that are fixed, and guesses, as coordinates of the unit cube."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import ROUNDED
from surehold.errors import InputError, unknown_name
from surehold.optimization.box import Box

__all__ = ["Fixed", "fixed_of", "places_of"]


class Fixed(NamedTuple):
    """Coordinates of the cube that keep their values."""

    held: NDArray[np.bool_]
    """which they are, (d,)"""
    values: NDArray[np.float64]
    """(d,); nan of the others"""
    rounding: NDArray[np.float64]
    """by how much a coordinate may differ and is still written as the same number, (d,)"""
    smooth: NDArray[np.bool_]
    """whether a coordinate can be tried everywhere, (d,)"""

    def keeps(self, U: NDArray[np.float64], exactly: bool = False) -> NDArray[np.bool_]:
        """Tell which points U (q, d) have these values: but for what a rig rounds, which is no level, or exactly."""
        slack = self.rounding if exactly else np.where(self.smooth, ROUNDED, self.rounding)
        return np.all((np.abs(U - self.values) <= slack) | ~self.held, axis=1)


def fixed_of(box: Box, fixed: Mapping[str, Any] | None) -> Fixed | None:
    """Return the coordinates of variables that have fixed values {name: value}; None where there are none.

    Raises InputError as `places_of` does, and if no variable is left.
    """
    if not fixed:
        return None
    values = places_of(box, "fixed", fixed)
    held = ~np.isnan(values)
    if held.all():
        raise InputError("every variable is fixed; there is nothing to optimize.")
    return Fixed(held, values, box.rounding / box.widths, box.smooth)


def places_of(box: Box, argument: str, values: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return where values {name: value} are in the unit cube, (d,); nan in coordinates of other variables.

    Raises
    ------
    InputError
        That names the argument, if a name is unknown, nobody sets that variable, or a value cannot be tried.
    """
    variables = {variable.name: variable for variable in box.variables}
    kept: dict[str, Any] = {}
    for name, value in values.items():
        if name not in variables:
            raise unknown_name(f"{argument} variable", name, variables)
        if box.uncontrolled is not None and box.uncontrolled.held[box.columns(name)].any():
            raise InputError(f"{argument} names '{name}', which is uncontrolled: nobody sets it; leave it out.")
        kept[name] = variables[name].checked(value, argument)
    x = box.points({**box.as_dict(box.from_unit(np.full(box.dimension, 0.5))), **kept})
    known = np.zeros(box.dimension, dtype=bool)
    for name in kept:
        known[box.columns(name)] = True
    return np.where(known, np.clip(box.to_unit(x), 0.0, 1.0), np.nan)

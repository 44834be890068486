"""The search space: named variables in the user's units, and the map to the unit cube in which the optimizer works."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.points import named_rows, points_of
from surehold.optimization.uncontrolled import Conditions, bounds_of, conditions_of
from surehold.optimization.variables import Choice, Number, Variable, variable_of

__all__ = ["Box"]

_MOST: Final = 10_000  # variables: more than a model can be made of, and a default design still fits into memory


class Box:
    """Named variables; their order is the order of the coordinates.

    Parameters
    ----------
    bounds
        `{name: (lower, upper)}` with finite `lower < upper`, in the user's units. Behind the bounds may stand "log"
        (the search is even in the logarithm), "int" (whole numbers) or "step=0.5" (levels from lower on). A list of
        texts (or booleans) is a choice between them.
    uncontrolled
        Variables that are drawn or measured when the answer is used, not set: {name: samples (N,)}, {name: a
        distribution of scipy.stats}, or {(name, name): samples (N, 2)} of such that depend on each other. Those that
        have no bounds get the range of their samples (of a distribution, of all but one in a thousand at either end)
        and stand behind the others. They are numbers, neither logarithmic nor in steps.

    Attributes
    ----------
    variables : what each variable is, see `optimization.variables`
    plain : bool, whether every variable is a number of a linear scale that can take every value
    names : tuple of str, names of the d coordinates: of the variables in a plain box, else see below
    lower, upper : (d,) float64, read-only, of the coordinates
    uncontrolled : Conditions, None where all variables are set

    The coordinates of a box that is not plain are the logarithm of a logarithmic variable, and one of [0, 1] for each
    text of a choice, 1 for the one that is taken. Whoever works with names (`encode`, `as_dict`, dictionaries told to
    an optimizer, `AskedTrial.parameters`) does not meet them. Input noise is given for the numbers, in the units of the
    coordinates: of a logarithmic one it is the standard deviation of the logarithm, a relative deviation.

    Raises
    ------
    InputError
        If there is no variable, a name is not a non-empty string, bounds are reversed, equal or not finite, or an
        uncontrolled variable is no plain number.

    Examples
    --------
    >>> box = Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
    >>> box.to_unit([0.0, 0.03])
    array([0.5, 1. ])
    >>> mixed = Box({"force": (0.1, 10.0, "log"), "fingers": (2, 5, "int"), "grip": ["pinch", "power"]})
    >>> mixed.as_dict(mixed.from_unit([1.0, 0.4, 0.1, 0.9]))
    {'force': 10.0, 'fingers': 3, 'grip': 'power'}
    """

    def __init__(self, bounds: Mapping[str, Any], *, uncontrolled: Mapping[Any, Any] | None = None):
        if uncontrolled is not None and isinstance(bounds, Mapping):
            bounds = bounds_of(bounds, uncontrolled)
        if not isinstance(bounds, Mapping) or len(bounds) == 0:
            raise InputError(
                f"bounds are {bounds!r}; give a mapping such as {{'dx': (-0.05, 0.05)}} of one or more names."
            )
        if len(bounds) > _MOST:
            raise InputError(f"the box has more than {_MOST:,} variables; give those that matter most.")
        self.variables: Final[tuple[Variable, ...]] = tuple(variable_of(name, given) for name, given in bounds.items())
        self.plain: Final = all(isinstance(v, Number) and not (v.step or v.log) for v in self.variables)
        names: list[str] = []
        limits: list[tuple[float, float]] = []
        self._columns: Final[dict[str, slice]] = {}
        for variable in self.variables:
            own = [variable.name] if isinstance(variable, Number) else variable.coordinates
            self._columns[variable.name] = slice(len(names), len(names) + len(own))
            names += own
            limits += [variable.bounds() if isinstance(variable, Number) else (0.0, 1.0)] * len(own)
        self.names: Final[tuple[str, ...]] = tuple(names)
        self.lower: Final[NDArray[np.float64]] = np.array([pair[0] for pair in limits])
        self.upper: Final[NDArray[np.float64]] = np.array([pair[1] for pair in limits])
        self.uncontrolled: Final[Conditions | None] = conditions_of(
            self.variables, self.names, self.lower, self.upper, uncontrolled
        )
        self.lower.flags.writeable = False
        self.upper.flags.writeable = False

    @classmethod
    def unit(cls, dimension: int) -> "Box":
        """Return the unit cube with variables `x1` ... `xd`."""
        return cls({f"x{i + 1}": (0.0, 1.0) for i in range(min(dimension, _MOST + 1))})

    @property
    def dimension(self) -> int:
        """Number of coordinates d: one a variable, of a choice one for each of its values."""
        return len(self.names)

    @property
    def widths(self) -> NDArray[np.float64]:
        """`upper - lower`, shape (d,)."""
        return self.upper - self.lower

    def to_unit(self, x: Any) -> NDArray[np.float64]:
        """Map points (..., d), however they are handed over, from the user's units to the unit cube."""
        return (self.points(x) - self.lower) / self.widths

    def from_unit(self, u: Any) -> NDArray[np.float64]:
        """Map points (..., d) of the unit cube to the user's units; cube points never leave the box by rounding."""
        u = self.points(u)
        x = self.lower + u * self.widths
        inside = (u >= 0.0) & (u <= 1.0)
        return np.where(inside, np.clip(x, self.lower, self.upper), x)

    def contains(self, x: Any, tolerance: float = 1e-9) -> bool:
        """Tell whether every point of x (..., d) lies in the box, up to `tolerance` box widths of rounding."""
        slack = tolerance * self.widths
        x = self.points(x)
        return bool(np.all((x >= self.lower - slack) & (x <= self.upper + slack)))

    @property
    def rounding(self) -> NDArray[np.float64]:
        """By how much a coordinate may lie beyond a bound and still count as the bound, (d,), in the user's units.

        1e-9 box widths, and the rounding of single precision (2^-23 of the larger bound, at most 1e-3 box widths): a
        bound that went through a 32-bit float is the bound.
        """
        single = 2.0**-23 * np.maximum(np.abs(self.lower), np.abs(self.upper))
        return 1e-9 * self.widths + np.minimum(single, 1e-3 * self.widths)

    # --- by name ------------------------------------------------------------------------------------------------

    @property
    def numbers(self) -> "Box | None":
        """The box of the variables that are numbers: those that input noise is given for."""
        found = {v.name: v for v in self.variables if isinstance(v, Number)}
        return Box(found) if found else None

    def columns(self, name: str) -> slice:
        """Return where the coordinates of a variable are; raises KeyError for an unknown name."""
        return self._columns[name]

    def as_dict(self, x: Any) -> dict[str, Any]:
        """Return one point (d,) as `{name: value}`: the nearest values that can be tried, as plain Python objects."""
        x = self.points(x)
        if self.plain:
            return dict(zip(self.names, x.tolist(), strict=True))
        found: dict[str, Any] = {}
        for variable in self.variables:
            own = x[self._columns[variable.name]]
            found[variable.name] = (
                variable.decoded(own[0]) if isinstance(variable, Number) else variable.choices[int(np.argmax(own))]
            )
        return found

    def as_given(self, x: Any) -> dict[str, Any]:
        """Return one point (d,) as `{name: value}`, numbers as they are: what a message says of a bad point.

        To 12 digits, so that a logarithm shows the number that it was made of.
        """
        x = self.points(x)
        if self.plain:
            return self.as_dict(x)
        found: dict[str, Any] = {}
        for variable in self.variables:
            own = x[self._columns[variable.name]]
            if isinstance(variable, Choice):
                found[variable.name] = variable.choices[int(np.argmax(own))]
                continue
            with np.errstate(over="ignore"):
                value = float(f"{variable.from_coordinate(own)[0]:.12g}")
            found[variable.name] = int(value) if variable.integer and value.is_integer() else value
        return found

    def encode(self, rows: Sequence[Mapping[str, Any]]) -> NDArray[np.float64]:
        """Return the points (n, d) for n dictionaries {name: value}; numbers may lie outside of their ranges.

        Raises
        ------
        InputError
            If a name is missing or unknown, a number has no coordinate, or a choice is none.
        """
        X = np.zeros((len(rows), self.dimension))
        names = [variable.name for variable in self.variables]
        for row in rows:
            if len(row) != len(names) or any(name not in row for name in names):
                raise InputError(f"point {dict(row)!r} does not fit; name exactly {', '.join(names)}.")
        for variable in self.variables:
            own, values = self._columns[variable.name], [row[variable.name] for row in rows]
            if isinstance(variable, Number):
                numbers = np.array([variable.anywhere(value, "point") for value in values], dtype=np.float64)
                X[:, own] = variable.to_coordinate(numbers)[:, None]
            else:
                X[np.arange(len(rows)), [own.start + variable.place(value) for value in values]] = 1.0
        return X

    def points(self, x: Any) -> NDArray[np.float64]:
        """Return points (..., d) of the box, however they are handed over; see `points_of`."""
        if not self.plain and (rows := named_rows(x)) is not None:
            X = self.encode(rows[0])
            return X if rows[1] else X[0]
        return points_of(x, self.names)

    # --- which points can be tried ------------------------------------------------------------------------------

    @property
    def smooth(self) -> NDArray[np.bool_]:
        """Whether a coordinate can be tried everywhere, (d,)."""
        smooth = np.zeros(self.dimension, dtype=bool)
        for variable in self.variables:
            smooth[self._columns[variable.name]] = isinstance(variable, Number) and not variable.step
        return smooth

    def snap(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest points of the unit cube (..., d) that can be tried."""
        snapped = np.array(U, dtype=np.float64)
        for variable in self.variables:
            own = self._columns[variable.name]
            if isinstance(variable, Choice):
                taken = np.argmax(U[..., own], axis=-1)
                snapped[..., own] = np.arange(len(variable.choices)) == taken[..., None]
            elif variable.step:
                low, width = self.lower[own], self.widths[own]
                value = variable.to_value(low + U[..., own] * width)
                snapped[..., own] = (variable.to_coordinate(value) - low) / width
        return snapped

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Box)
            and self.variables == other.variables
            and _same(self.uncontrolled, other.uncontrolled)
        )

    def __hash__(self) -> int:
        return hash(self.variables)

    def __repr__(self) -> str:
        def shown(variable: Variable) -> str:
            if isinstance(variable, Choice):
                return repr(list(variable.choices))
            words = [repr(word) for word in variable.described[2:]]
            low, high = f"{variable.low:g}", f"{variable.high:g}"
            if low == high:
                low, high = repr(variable.low), repr(variable.high)
            return f"({', '.join([low, high, *words])})"

        inner = ", ".join(f"{v.name!r}: {shown(v)}" for v in self.variables)
        if self.uncontrolled is None:
            return f"Box({{{inner}}})"
        held = [name for name, taken in zip(self.names, self.uncontrolled.held, strict=True) if taken]
        return f"Box({{{inner}}}, uncontrolled: {', '.join(held)})"


def _same(mine: Conditions | None, other: Conditions | None) -> bool:
    if mine is None or other is None:
        return mine is other
    return np.array_equal(mine.held, other.held) and np.array_equal(mine.samples, other.samples)

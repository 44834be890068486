"""The search space: named bounds in the user's units, and the map to the unit cube in which the optimizer works."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.points import points_of
from surehold.optimization.uncontrolled import Conditions, bounds_of, conditions_of

__all__ = ["Box"]


class Box:
    """Named bounds; the order of the names is the order of the coordinates.

    Parameters
    ----------
    bounds
        `{name: (lower, upper)}` with finite `lower < upper`, in the user's units.
    uncontrolled
        Variables that are drawn or measured when the answer is used, not set: {name: samples (N,)}, {name: a
        distribution of scipy.stats}, or {(name, name): samples (N, 2)} of such that depend on each other. Those that
        have no bounds get the range of their samples (of a distribution, of all but one in a thousand at either end)
        and stand behind the others.

    Attributes
    ----------
    names : tuple of str, length d
    lower, upper : (d,) float64, read-only, the user's units
    uncontrolled : Conditions, None where all variables are set

    Raises
    ------
    InputError
        If there is no variable, a name is not a non-empty string, or bounds are reversed, equal or not finite.

    Examples
    --------
    >>> box = Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
    >>> box.to_unit([0.0, 0.03])
    array([0.5, 1. ])
    """

    def __init__(self, bounds: Mapping[str, tuple[float, float]], *, uncontrolled: Mapping[Any, Any] | None = None):
        if uncontrolled is not None and isinstance(bounds, Mapping):
            bounds = bounds_of(bounds, uncontrolled)
        if not isinstance(bounds, Mapping) or len(bounds) == 0:
            raise InputError(
                f"bounds are {bounds!r}; give a mapping such as {{'dx': (-0.05, 0.05)}} of one or more names."
            )
        pairs = []
        for name, pair in bounds.items():
            if not isinstance(name, str) or not name:
                raise InputError(f"variable name {name!r} is not a non-empty string; name each variable, such as 'dx'.")
            try:
                lower, upper = (float(value) for value in pair)
            except (TypeError, ValueError):
                raise InputError(f"bounds of '{name}' are {pair!r}; give two numbers (lower, upper).") from None
            if not (np.isfinite(lower) and np.isfinite(upper)):
                raise InputError(f"bounds of '{name}' are ({lower}, {upper}); both must be finite numbers.")
            if not lower < upper or not np.isfinite(upper - lower):
                raise InputError(
                    f"bounds of '{name}' are ({lower}, {upper}); lower must be smaller than upper: swap or widen them."
                )
            pairs.append((lower, upper))
        self.names: Final[tuple[str, ...]] = tuple(bounds)
        self.lower: Final[NDArray[np.float64]] = np.array([pair[0] for pair in pairs])
        self.upper: Final[NDArray[np.float64]] = np.array([pair[1] for pair in pairs])
        self.uncontrolled: Final[Conditions | None] = conditions_of(self.names, self.lower, self.upper, uncontrolled)
        self.lower.flags.writeable = False
        self.upper.flags.writeable = False

    @classmethod
    def unit(cls, dimension: int) -> "Box":
        """Return the unit cube with variables `x1` ... `xd`."""
        return cls({f"x{i + 1}": (0.0, 1.0) for i in range(dimension)})

    @property
    def dimension(self) -> int:
        """Number of variables d."""
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

    def as_dict(self, x: Any) -> dict[str, float]:
        """Return one point (d,) as `{name: value}`."""
        return dict(zip(self.names, self.points(x).tolist(), strict=True))

    def points(self, x: Any) -> NDArray[np.float64]:
        """Return points (..., d) in the user's units, however they are handed over; see `points_of`."""
        return points_of(x, self.names)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Box)
            and self.names == other.names
            and np.array_equal(self.lower, other.lower)
            and np.array_equal(self.upper, other.upper)
            and _same(self.uncontrolled, other.uncontrolled)
        )

    def __hash__(self) -> int:
        return hash((self.names, self.lower.tobytes(), self.upper.tobytes()))

    def __repr__(self) -> str:
        inner = ", ".join(
            f"{n!r}: ({lo:g}, {up:g})" for n, lo, up in zip(self.names, self.lower, self.upper, strict=True)
        )
        return f"Box({{{inner}}})"


def _same(mine: Conditions | None, other: Conditions | None) -> bool:
    if mine is None or other is None:
        return mine is other
    return np.array_equal(mine.held, other.held) and np.array_equal(mine.samples, other.samples)

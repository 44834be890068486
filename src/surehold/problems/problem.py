"""What a problem is: a named box and a function on it that is to be maximized."""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.points import points_of

__all__ = ["Optimum", "Problem", "checked_points"]


class Optimum(NamedTuple):
    """The best input of a problem and its value."""

    x: NDArray[np.float64]  #: (d,) in the units of the problem's box
    value: float  #: the value there


@runtime_checkable
class Problem(Protocol):
    """What can be maximized: `p(x)` is a float for x (d,) and an array (n,) for x (n, d)."""

    @property
    def name(self) -> str:
        """Short name, as the command line spells it."""
        ...

    @property
    def box(self) -> Box:
        """The named bounds of the inputs."""
        ...

    def __call__(self, x: ArrayLike, /) -> Any:
        """Return the value at x (d,) as a float, or the values at x (n, d) as an array (n,)."""
        ...


def checked_points(x: ArrayLike, box: Box) -> tuple[NDArray[np.float64], bool]:
    """Return x as points (n, d), and whether it was a single point (d,); read by names where x carries some.

    Raises
    ------
    InputError
        If x is not numeric or has neither shape (d,) nor (n, d).
    """
    points = points_of(x, box.names)
    if points.ndim not in (1, 2) or points.shape[-1] != box.dimension:
        raise InputError(
            f"points of shape {points.shape} do not fit; give ({box.dimension},) or (n, {box.dimension}), "
            f"the coordinates in the order {', '.join(box.names)}."
        )
    return np.atleast_2d(points), points.ndim == 1

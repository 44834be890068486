"""Initial designs: where to try before a model can say anything (scipy.stats.qmc)."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import GUESS_TURN
from surehold.errors import InputError, unknown_name

__all__ = ["DESIGNS", "design", "drawn_to"]

DESIGNS: Final = ("latin_hypercube", "sobol", "uniform")
_MOST: Final = 100_000  # points; they are drawn at once, and n_initial=10**9 is a slip of the pen


def design(name: str, n: int, dimension: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return n points of the unit cube, shape (n, d).

    "latin_hypercube": one point in each of n slices of every axis, at a random place of its cell. "sobol": the
    scrambled Sobol sequence. "uniform": independent draws. Raises InputError for an unknown name,
    or more points than anybody tries.
    """
    from scipy.stats import qmc

    if n > _MOST:
        raise InputError(f"n_initial is {n}; an initial design has {_MOST:,} trials at most.")

    if name == "latin_hypercube":
        return qmc.LatinHypercube(dimension, rng=rng).random(n)
    if name == "sobol":
        exponent = max(int(n - 1).bit_length(), 0)  # SciPy balances the sequence in powers of two only
        return qmc.Sobol(dimension, rng=rng).random_base2(exponent)[:n]
    if name == "uniform":
        return rng.random((n, dimension))
    raise unknown_name("initial design", name, DESIGNS)


def drawn_to(guess: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a design (n, d), moved to a guess (d,) of where the optimum is; nan in coordinates of which none is made.

    Of `GUESS_TURN` points in turn all but the last keep the guess; that one stays where it is, for the model has to
    learn what these coordinates do. Where the guess is of all of them, only the first point is there, and the others
    that are moved lie around it, farther and farther away, at up to half of their distance.
    """
    numbers = np.arange(len(points))
    moved = numbers % GUESS_TURN != GUESS_TURN - 1
    known = ~np.isnan(guess)
    share = 0.5 * numbers / len(points) if known.all() else np.zeros(len(points))
    kept = np.where(known, guess + share[:, None] * (points - guess), points)
    return np.where(moved[:, None], kept, points)

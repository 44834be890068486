"""Initial designs: where to try before a model can say anything (scipy.stats.qmc)."""

from collections.abc import Callable, Iterable
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


def drawn_to(
    guess: NDArray[np.float64],
    points: NDArray[np.float64],
    *,
    before: Iterable[NDArray[np.float64]] = (),
    snap: Callable[[NDArray[np.float64]], NDArray[np.float64]] = np.asarray,
    allowed: Callable[[NDArray[np.float64]], NDArray[np.bool_]] = lambda U: np.ones(len(U), dtype=bool),
    pool: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return a design (n, d), moved to a guess (d,) of where the optimum is; nan in coordinates of which none is made.

    Of `GUESS_TURN` points in turn all but the last keep the guess; that one stays where it is, for the model has to
    learn what these coordinates do. A point that is not `allowed` with the guess takes the other coordinates of one of
    the `pool` that is. One that would be the same trial as another or as one `before`, as where the guess is of all
    coordinates, lies near the guess, the later the farther, at up to half of its own distance. `snap` moves points to
    where they are tried.
    """
    known = ~np.isnan(guess)
    others = np.where(known, guess, points[:0] if pool is None else pool)
    others = others[allowed(others)]
    result, tried = points.copy(), {_trial(snap(point)) for point in before}
    for i, point in enumerate(points):
        if i % GUESS_TURN != GUESS_TURN - 1:
            share = 0.5 * max(i, 1) / len(points)
            near = [np.where(known, guess + part * (point - guess), point) for part in (share, share / 4, share / 16)]
            for place in (np.where(known, guess, point), *others, *near):
                if _trial(snap(place)) not in tried and allowed(place[None])[0]:
                    result[i] = place
                    break
        tried.add(_trial(snap(result[i])))
    return result


def _trial(point: NDArray[np.float64]) -> bytes:
    """Return what is equal for points that are the same trial."""
    return (point + 0.0).tobytes()  # -0.0 is 0.0

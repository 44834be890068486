"""Initial designs: where to try before a model can say anything (scipy.stats.qmc)."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError, unknown_name

__all__ = ["DESIGNS", "design"]

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

"""Random embeddings: a search in few variables for functions of many, of which few count.

    Wang et al. 2013 (REMBO)         x = A z with a Gaussian A (D, d), what leaves the box is moved to its border; z in
                                     [-sqrt(d), sqrt(d)]^d; several embeddings in turn, for one may miss the top
    Papenmeier et al. 2022 (BAxUS)   every variable follows one of d bins, with a random sign; when a stage's trials are
                                     used up each bin is divided, and all trials are kept

The default optimizer learns by itself which variables count, and mostly needs no embedding
(`surehold campaign run high-dimension`): these are baselines, and for thousands of variables. Inputs are exact.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.assembly import whole_number
from surehold.optimization.box import Box
from surehold.optimization.optimizer import Optimizer, check_settings

__all__ = ["NestedEmbedding", "RandomEmbedding"]

_FIRST_BINS: Final = 4
_PARTS: Final = 4  # into which a bin is divided, where it holds as many variables


class RandomEmbedding:
    """The search in random subspaces of Wang et al. 2013.

    Parameters
    ----------
    box
        Of all D variables.
    dimension
        d of the subspaces: at least as many as variables count, at most D.
    embeddings
        Subspaces that are searched in turn, each by an optimizer of its own.
    seed
        Of the subspaces and of the optimizers.
    **settings
        Of each `Optimizer`.

    Raises
    ------
    InputError
        For numbers out of range, or settings that are about the box's own variables.

    Examples
    --------
    >>> search = RandomEmbedding(Box.unit(30), dimension=2, seed=0)
    >>> for _ in range(8):
    ...     x = search.ask()
    ...     search.tell(x, -float((x[3] - 0.4) ** 2))
    >>> search.best()[0].shape
    (30,)
    """

    def __init__(self, box: Box, dimension: int, *, embeddings: int = 1, seed: int = 0, **settings: Any):
        _check(box, dimension, seed, settings)
        self.box: Final = box
        self._asked: list[tuple[NDArray[np.float64], int, NDArray[np.float64]]] = []
        self._told: list[tuple[NDArray[np.float64], float]] = []
        self._number = 0
        rng = np.random.default_rng([seed, 5])
        side = float(np.sqrt(dimension))
        inner = Box({f"z{i + 1}": (-side, side) for i in range(dimension)})
        self._maps = [rng.standard_normal((box.dimension, dimension)) for _ in range(_positive(embeddings))]
        self._optimizers = [Optimizer(inner, seed=seed + k, **settings) for k in range(embeddings)]

    def ask(self) -> NDArray[np.float64]:
        """Return the next trial (D,), in the box's units."""
        turn = self._number % len(self._maps)
        z = self._optimizers[turn].ask()
        x = self.box.from_unit(np.clip(0.5 + 0.5 * self._maps[turn] @ z, 0.0, 1.0))
        self._asked.append((x, turn, z))
        self._number += 1
        return x

    def tell(self, x: NDArray[np.float64], y: float | None = None, *, failed: bool = False) -> None:
        """Record what a trial x (D,), as `ask` gave it, has given; raises InputError where it was not asked for."""
        entry = _under_way(self._asked, x)
        _, turn, z = self._asked[entry]
        self._optimizers[turn].tell(z, y, failed=failed)
        del self._asked[entry]
        if y is not None:
            self._told.append((np.array(x), float(y)))

    def best(self) -> tuple[NDArray[np.float64], float]:
        """Return the trial x (D,) with the highest value, and that value."""
        return _highest(self._told)


class NestedEmbedding:
    """The search in bins of variables of Papenmeier et al. 2022, in a trust region.

    Here the stages' trials are counted out beforehand, in proportion to their bins; in BAxUS a stage also ends when its
    trust region has become small.

    Parameters
    ----------
    box
        Of all D variables.
    trials
        Number of trials that will be made.
    dimension
        Bins of the first stage, at most D; None: 4, or D where there are fewer variables.
    seed, **settings
        As of `RandomEmbedding`.

    Raises
    ------
    InputError
        For numbers out of range, or settings that are about the box's own variables.
    """

    def __init__(self, box: Box, trials: int, dimension: int | None = None, *, seed: int = 0, **settings: Any):
        dimension = min(_FIRST_BINS, box.dimension) if dimension is None else dimension
        _check(box, dimension, seed, settings)
        self.box: Final = box
        self._settings: Final = {"trust_region": True, **settings}
        self._seed: Final = seed
        self._rng = np.random.default_rng([seed, 6])
        order = self._rng.permutation(box.dimension)
        self._bins = [np.sort(part) for part in np.array_split(order, dimension)]
        self._signs = self._rng.choice([-1.0, 1.0], box.dimension)
        self._asked: list[tuple[NDArray[np.float64], int, NDArray[np.float64]]] = []
        self._told: list[tuple[NDArray[np.float64], float]] = []
        self._values: list[float] = []
        self._places: list[NDArray[np.float64]] = []
        sizes = [dimension]
        while sizes[-1] < box.dimension:
            sizes.append(min(box.dimension, _PARTS * sizes[-1]))
        shares = np.cumsum(sizes) / sum(sizes)
        self._ends: Final = np.maximum(np.round(shares * _positive(trials)), 1).astype(int).tolist()
        self._optimizer = self._new()

    @property
    def dimension(self) -> int:
        """Bins of the present stage."""
        return len(self._bins)

    def ask(self) -> NDArray[np.float64]:
        """Return the next trial (D,), in the box's units."""
        if len(self._ends) > 1 and len(self._values) >= self._ends[0]:
            del self._ends[0]
            self._divide()
        z = self._optimizer.ask()
        x = self.box.from_unit(self._spread(z))
        self._asked.append((x, 0, z))
        return x

    def tell(self, x: NDArray[np.float64], y: float | None = None, *, failed: bool = False) -> None:
        """Record what a trial x (D,), as `ask` gave it, has given; raises InputError where it was not asked for."""
        entry = _under_way(self._asked, x)
        z = self._asked[entry][2]
        self._optimizer.tell(z, y, failed=failed)
        del self._asked[entry]
        self._places.append(z)
        self._values.append(np.nan if y is None else float(y))
        if y is not None:
            self._told.append((np.array(x), float(y)))

    def best(self) -> tuple[NDArray[np.float64], float]:
        """Return the trial x (D,) with the highest value, and that value."""
        return _highest(self._told)

    def _spread(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        u = np.empty(self.box.dimension)
        for value, members in zip(z, self._bins, strict=True):
            u[members] = 0.5 + 0.5 * self._signs[members] * value
        return u

    def _divide(self) -> None:
        """Divide every bin; a trial keeps its place, for the parts of a bin all take its value.

        So do those under way: where several are always, or one is never told, a stage would not end otherwise.
        """
        parts = [np.array_split(self._rng.permutation(members), min(_PARTS, len(members))) for members in self._bins]
        origin = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        self._bins = [np.sort(members) for part in parts for members in part]
        self._places = [place[origin] for place in self._places]
        self._optimizer = self._new()
        self._asked = [(x, turn, z[origin]) for x, turn, z in self._asked]
        self._optimizer.restore(self._places, self._values, pending=[z for _, _, z in self._asked])

    def _new(self) -> Optimizer:
        inner = Box({f"z{i + 1}": (-1.0, 1.0) for i in range(len(self._bins))})
        return Optimizer(inner, seed=self._seed, **self._settings)


def _check(box: Box, dimension: int, seed: int, settings: dict[str, Any]) -> None:
    if not isinstance(box, Box):
        raise InputError(f"box is {box!r}; give a surehold.Box of named bounds.")
    if not box.plain:
        raise InputError(f"{box!r} has logarithms, whole numbers or choices; an embedding is of plain intervals.")
    if box.uncontrolled is not None:
        raise InputError(f"{box!r} has variables that nobody sets, but an embedding sets all; leave them out.")
    if isinstance(dimension, bool) or not isinstance(dimension, int) or not 1 <= dimension <= box.dimension:
        raise InputError(f"dimension is {dimension!r}; give 1 to {box.dimension}, the number of variables.")
    whole_number("seed", seed, 0)
    check_settings(settings)
    for name in ("input_noise", "fixed", "guess", "initial_points", "allowed"):
        if settings.get(name) is not None:
            raise InputError(f"{name} is about the variables of the box, not of an embedding; leave it out.")
    for name in ("direction", "constraints", "conditions", "outcome"):
        if settings.get(name) is not None:
            raise InputError(f"an embedding maximizes one value and knows no {name}; leave it out.")
    if settings.get("noise") == "told":
        raise InputError("trials of an embedding tell no noise; give noise='inferred', or its standard deviation.")


def _positive(count: int) -> int:
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise InputError(f"{count!r} embeddings or trials; give a whole number of 1 or more.")
    return count


def _under_way(asked: list[tuple[NDArray[np.float64], int, Any]], x: NDArray[np.float64]) -> int:
    for i, entry in enumerate(asked):
        if np.array_equal(entry[0], x):
            return i
    raise InputError("this trial was not asked for, or has been told; an embedding takes the points that it gave.")


def _highest(told: list[tuple[NDArray[np.float64], float]]) -> tuple[NDArray[np.float64], float]:
    if not told:
        raise InputError("no trial has given a value yet; tell the outcome of at least one.")
    return max(told, key=lambda trial: trial[1])

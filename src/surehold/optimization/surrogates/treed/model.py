"""Treed Gaussian process: a tree cuts the inputs where the function changes character, each leaf has its own process.

Legend (the thesis' symbols in brackets)
    s_l   smallest number of trials in a leaf                                                         [s_l]
    k     weight power                                                                                [w_k]
    w_ji  weight of block i in the likelihood of leaf j: (2 / (1 + depth_j - depth_i))^k, 1 and 0 for k = inf  (3.12)
"""

from functools import partial
from math import inf
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.defaults import LEAF_MARGIN, LEAF_SIZES, MIN_LEAF, UNDIVIDED, WIDEST_LEAF_MARGIN
from surehold.errors import InputError
from surehold.optimization.numerics.threads import computing
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.gaussian_process.observations import checked_data, checked_noise
from surehold.optimization.surrogates.gaussian_process.outputs import Standardization
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.optimization.surrogates.memory import Remembered, fingerprint
from surehold.optimization.surrogates.protocol import Posterior, mixture
from surehold.optimization.surrogates.treed.partition import Partition, grow
from surehold.optimization.surrogates.treed.posterior import AveragedTrees, TreedPosterior

__all__ = ["TreedGaussianProcess", "least_leaf_width"]

_LEAVES: Final = 4096  # whose learning is kept


class TreedGaussianProcess:
    """Gaussian processes in the leaves of a regression tree: for functions that are smooth here and rough there.

    Parameters
    ----------
    min_leaf
        Smallest number of trials in a leaf, 2 or more; "evidence" takes the one of 8, 10, 15, 20, 30, 50 whose tree
        makes the data most probable, or no split at all (considered up to 300 trials).
    weight_power
        k of thesis (3.12): by how much the trials of a leaf's ancestors count less for its hyperparameters than its
        own, 0 or more; inf (default) leaves them out.
    process
        The Gaussian process of a leaf; the default one if None.
    trees
        Number of trees that are averaged: beside the one of the plain gain, some whose gain weights the trials at
        random (the Bayesian bootstrap, Rubin 1981). Softens the jumps between leaves, at that many times the cost.
    margin
        No split lies nearer to the border of a box than this, in widths of the unit cube: one number or one a
        dimension (d,). Under input noise, its standard deviation.
    continued
        Whether the chains of hyperparameters go on from the step before, leaf by leaf (the thesis). Otherwise a leaf's
        hyperparameters depend on its own trials and the seed alone, and are learnt again only when these change.
    seed
        Of the leaves' chains; non-negative integer.

    Raises
    ------
    InputError
        For numbers out of range.

    Examples
    --------
    >>> X = np.linspace(0.0, 1.0, 40)[:, None]
    >>> y = np.where(X[:, 0] < 0.5, X[:, 0], np.sin(60.0 * X[:, 0]))
    >>> model = TreedGaussianProcess(min_leaf=10).fit(X, y)
    >>> model.posterior.diagnostics.partition.leaves > 1
    True
    """

    def __init__(
        self,
        min_leaf: int | Literal["evidence"] = MIN_LEAF,
        weight_power: float = inf,
        *,
        process: GaussianProcess | None = None,
        trees: int = 1,
        margin: ArrayLike = LEAF_MARGIN,
        continued: bool = False,
        seed: int = 0,
    ):
        if not (isinstance(weight_power, (int, float)) and weight_power >= 0.0):  # False for NaN, too
            raise InputError(f"weight_power is {weight_power!r}; give 0 or more, inf for a leaf's own trials only.")
        if process is not None and not isinstance(process, GaussianProcess):
            raise InputError(f"process is {process!r}; give a surehold.GaussianProcess, or None.")
        self._margin = np.asarray(margin, dtype=np.float64)
        if self._margin.ndim > 1 or not np.all((self._margin >= 0.0) & (self._margin < 0.5)):
            raise InputError(f"margin is {margin!r}; give one number in [0, 0.5), or one a dimension.")
        self._min_leaf = min_leaf if min_leaf == "evidence" else _count("min_leaf", min_leaf, 2)
        self._trees = _count("trees", trees, 1)
        self._weight_power = float(weight_power)
        self._process = process or GaussianProcess()
        self._continued = continued
        self._seed = _count("seed", seed, 0)
        self._posterior: TreedPosterior | AveragedTrees | None = None
        self._learnt = Remembered[GaussianProcessPosterior](_LEAVES)
        self._evidences = Remembered[float](_LEAVES)

    def __repr__(self) -> str:
        return f"TreedGaussianProcess(min_leaf={self._min_leaf!r}, trees={self._trees}, process={self._process!r})"

    @property
    def known_noise(self) -> float | None:
        """Standard deviation of the observation noise, in the outputs' units, 0 for none; None where it is learnt."""
        return self._process.known_noise

    @property
    def noisy(self) -> bool:
        """Whether observations carry noise."""
        return self._process.noisy

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
        noise: NDArray[np.float64] | None = None,
    ) -> TreedPosterior | AveragedTrees:
        """Grow the tree and learn its leaves from X (n, d) in the unit cube and finite y (n,), n >= 1.

        `previous` is the posterior of the step before, looked at where chains continue. `noise` (n,) are known
        standard deviations of the observations, in the outputs' units. A tree of one leaf is the plain process.
        """
        d = X.shape[1]
        if self._margin.shape not in ((), (1,), (d,)):
            raise InputError(f"margin has shape {self._margin.shape}; the inputs need ({d},) or one number.")
        margin = np.broadcast_to(self._margin, (d,)).copy()
        old = previous.trees if isinstance(previous, AveragedTrees) else (previous,) * self._trees
        trees = []
        for t in range(self._trees):
            # One stream a tree: the weights of earlier trials do not change when another one is told.
            weights = None if t == 0 else np.random.default_rng([self._seed, t]).exponential(size=len(y))
            partition = self._partition(X, y, noise, margin, weights)
            trees.append(self._tree(partition, X, y, rng, old[t], noise))
        return trees[0] if self._trees == 1 else AveragedTrees(tuple(trees))

    def _partition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        noise: NDArray[np.float64] | None,
        margin: NDArray[np.float64],
        weights: NDArray[np.float64] | None,
    ) -> Partition:
        outputs = self._process.standardization(y)
        standardized = outputs.apply(y)
        if not isinstance(self._min_leaf, str):
            return grow(X, standardized, self._min_leaf, margin, weights)
        sizes = [*LEAF_SIZES, len(y) + 1] if len(y) <= UNDIVIDED else LEAF_SIZES
        partitions = [grow(X, standardized, size, margin, weights) for size in sizes]
        values = [self._log_evidence(partition, X, y, noise, outputs.coarse()) for partition in partitions]
        return partitions[int(np.argmax(values))]

    def _log_evidence(
        self,
        partition: Partition,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        noise: NDArray[np.float64] | None,
        outputs: Standardization,
    ) -> float:
        """Return about log p(y | X, tree), each trial counted in the leaf that owns it."""
        home = partition.route(X)
        total = 0.0
        for j in range(len(partition.leaves)):
            own = np.flatnonzero(home == j)
            if len(own) == 0:  # all its trials lie on a border that belongs to another leaf
                continue
            scaled = self._process.centered(outputs, y[own])
            known = None if noise is None else noise[own]
            key = fingerprint(X[own], y[own], known, scaled, [len(own)])
            total += self._evidences.value(key, partial(self._process.log_evidence, X[own], y[own], scaled, known))
        return total

    def _tree(
        self,
        partition: Partition,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None,
        noise: NDArray[np.float64] | None,
    ) -> TreedPosterior:
        old = previous if isinstance(previous, TreedPosterior) else None
        count = len(partition.leaves)
        if count == 1:
            before = None if old is None else old.leaves[_nearest(partition, 0, old)]
            return TreedPosterior(partition, (self._process.condition_on_all(X, y, rng, before, noise),), len(y))
        outputs = self._process.standardization(y).coarse()
        leaves = tuple(self._leaf(j, partition, X, y, noise, outputs, rng, old) for j in range(count))
        return TreedPosterior(partition, leaves, len(y))

    def _leaf(
        self,
        j: int,
        partition: Partition,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        noise: NDArray[np.float64] | None,
        outputs: Standardization,
        rng: np.random.Generator,
        old: TreedPosterior | None,
    ) -> GaussianProcessPosterior:
        blocks = partition.blocks(j) if self._weight_power < inf else [partition.nodes[partition.leaves[j]].members]
        order = np.concatenate(blocks)
        own = y[blocks[0]]
        outputs = self._process.centered(outputs, own)
        sizes = [len(block) for block in blocks]
        known = None if noise is None else noise[order]
        learn = partial(
            self._process.condition_on_blocks,
            X[order],
            y[order],
            outputs=outputs,
            sizes=sizes,
            weights=block_weights(len(blocks), self._weight_power),
            noise=known,
        )
        if self._continued:
            start = None if old is None else old.leaves[_nearest(partition, j, old)].hyperparameters.theta[-1]
            return learn(rng=rng, start=start)
        key = fingerprint(X[order], y[order], known, outputs, sizes)
        own_rng = np.random.default_rng([self._seed, *np.frombuffer(key[:16], dtype=np.uint32)])
        return self._learnt.value(key, partial(learn, rng=own_rng))

    def fit(
        self, X: ArrayLike, y: ArrayLike, seed: int | None = None, *, noise: ArrayLike | None = None
    ) -> "TreedGaussianProcess":
        """Learn from X (n, d), preferably scaled to the unit cube, and y (n,); returns itself.

        `seed` replaces the setting of the same name where given; `noise` (n,) are known standard deviations of the
        observations, in the outputs' units.

        Raises
        ------
        InputError
            If shapes do not fit, a value is not finite, or a standard deviation is negative.
        """
        inputs, outputs = checked_data(X, y)
        known = None if noise is None else checked_noise(noise, len(outputs))
        if seed is not None and seed != self._seed:
            self._seed = _count("seed", seed, 0)
            self._learnt.clear()
        with computing():
            self._posterior = self.condition(inputs, outputs, np.random.default_rng(self._seed), noise=known)
        return self

    @property
    def posterior(self) -> TreedPosterior | AveragedTrees:
        """What `fit` has learnt."""
        if self._posterior is None:
            raise InputError("this TreedGaussianProcess has seen no data; call fit(X, y) first.")
        return self._posterior

    def predict(self, X: ArrayLike, return_std: bool = False):
        """Return the mean (q,) at X (q, d), and the standard deviation (q,) of the latent function where asked for."""
        queries, _ = checked_data(X, None, self.posterior.regions.lower.shape[1])
        with computing():
            mean, variance = mixture(self.posterior.moments(queries))
        return (mean, np.sqrt(variance)) if return_std else mean

    def noise_std(self, X: ArrayLike) -> NDArray[np.float64]:
        """Return the standard deviation of the observation noise (q,) at X (q, d): what is known of it, or learnt."""
        queries, _ = checked_data(X, None, self.posterior.regions.lower.shape[1])
        return np.sqrt(self.posterior.noise_variance(queries).mean(axis=0))


def least_leaf_width(deviations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the margin (d,) under an input noise of standard deviations (d,) in the unit cube, 0 for exact variables.

    No leaf is narrower than the noise's standard deviation, or than 0.01 box widths where there is none.
    """
    return np.where(deviations > 0.0, np.minimum(deviations, WIDEST_LEAF_MARGIN), LEAF_MARGIN)


def _count(name: str, value: int, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise InputError(f"{name} is {value!r}; give a whole number of {least} or more.")
    return int(value)


def block_weights(count: int, power: float) -> NDArray[np.float64]:
    """Return the weights (count,) of a leaf's own block and of those of its ancestors, nearest first     thesis (3.12).

    For power inf the leaf's own block counts alone, with weight 1.
    """
    if power == inf:
        return np.concatenate([np.ones(1), np.zeros(count - 1)])
    return np.power(2.0 / (1.0 + np.arange(count, dtype=np.float64)), power)


def _nearest(partition: Partition, j: int, old: TreedPosterior) -> int:
    """Return the old leaf that shares the largest volume with leaf j."""
    lower = np.maximum(old.regions.lower, partition.lower[j])
    upper = np.minimum(old.regions.upper, partition.upper[j])
    return int(np.argmax(np.prod(np.maximum(upper - lower, 0.0), axis=1)))

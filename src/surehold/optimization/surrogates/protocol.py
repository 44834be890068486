"""What the optimizer asks of a surrogate: a distribution over functions, conditioned on trials.

Legend
    m   particles: equally likely settings of the hyperparameters, each a Gaussian process of its own
    q   queries in the unit cube (q, d)
    s   points of a quadrature of the input noise: offsets (s, d), weights (s,) that sum to 1
"""

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

_LARGEST = 1e150  # the square of a larger number is infinite

__all__ = [
    "FitDiagnostics",
    "KnowsMeans",
    "LeavesOut",
    "Moments",
    "NoisySurrogate",
    "PartitionSummary",
    "Posterior",
    "Regions",
    "Surrogate",
    "means",
    "mixture",
]


class Moments(NamedTuple):
    """Mean and variance under each particle, with gradients with respect to the queries where asked for."""

    mean: NDArray[np.float64]
    """(m, q), in the outputs' units"""
    variance: NDArray[np.float64]
    """(m, q), latent (no observation noise), never negative"""
    mean_gradient: NDArray[np.float64] | None
    """(m, q, d)"""
    variance_gradient: NDArray[np.float64] | None
    """(m, q, d)"""


class Regions(NamedTuple):
    """Boxes that together are the unit cube; within each the posterior is smooth, between them it may jump."""

    lower: NDArray[np.float64]
    """(r, d)"""
    upper: NDArray[np.float64]
    """(r, d)"""
    separable: bool = False
    """whether variables act each on its own there, so that hills are as many as the product of those along each"""

    @classmethod
    def whole(cls, d: int, separable: bool = False) -> "Regions":
        """Return the unit cube as one region."""
        return cls(np.zeros((1, d)), np.ones((1, d)), separable)

    def within(self, box: "Regions") -> "Regions":
        """Return the parts of these regions that lie in a box, given as a single region."""
        lower, upper = np.maximum(self.lower, box.lower), np.minimum(self.upper, box.upper)
        inside = (lower < upper).all(axis=1)
        return Regions(lower[inside], upper[inside], self.separable)


class PartitionSummary(NamedTuple):
    """The tree of a surrogate in short."""

    leaves: int
    """number of leaves"""
    depth: int
    """splits above the deepest one"""
    first_split: tuple[int, float] | None
    """dimension and threshold in the unit cube of the root's split; None where there is none"""


class FitDiagnostics(NamedTuple):
    """What learning did and what it cost."""

    observations: int
    """n"""
    evaluations: int
    """evaluations of the hyperparameters' density"""
    repaired: int
    """factorizations that needed a larger nugget than asked for"""
    flat: bool
    """whether all outputs were equal, so that nothing could be learnt and the prior stands in"""
    partition: PartitionSummary | None = None
    """the tree, of a surrogate that has one"""


class Posterior(Protocol):
    """A surrogate conditioned on trials."""

    diagnostics: FitDiagnostics
    regions: Regions

    def average(
        self,
        queries: NDArray[np.float64],
        offsets: NDArray[np.float64],
        weights: NDArray[np.float64],
        gradient: bool = False,
        slopes: NDArray[np.float64] | None = None,
    ) -> Moments:
        """Return the moments of sum_i weights[i] f(query + offsets[i]) for each query.

        offsets are (s, d), or (q, s, d) where each query has its own; slopes, of the same shape and 1 by default, are
        the derivatives of query + offset by the query, coordinate by coordinate (0 where a point is held at a border).
        """
        ...

    def moments(self, queries: NDArray[np.float64], gradient: bool = False) -> Moments:
        """Return the moments of f at each query."""
        ...

    def sample(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return joint draws (m, q, b, s) of f at points (q, s, d), made from independent standard normals (b, s)."""
        ...

    def thinned(self, count: int, first: int = 0) -> "Posterior":
        """Return the posterior of about `count` of the particles, evenly taken from number `first` on."""
        ...

    def with_pending(self, X: NDArray[np.float64]) -> "Posterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d)."""
        ...

    def noise_variance(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance of the observation noise (m, q) at X (q, d), in squared outputs.

        Known, or learnt: then particles differ, and their spread is what is not known of the noise.
        """
        ...


class Surrogate(Protocol):
    """A distribution over functions before any trial, and what it takes observations for."""

    @property
    def noisy(self) -> bool:
        """Whether observations carry noise, so that the highest one is not taken for the best.

        An object without this attribute takes observations for exact.
        """
        ...

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
    ) -> Posterior:
        """Learn the hyperparameters from inputs X (n, d) in the unit cube and outputs y (n,)."""
        ...


@runtime_checkable
class NoisySurrogate(Surrogate, Protocol):
    """A surrogate that takes a standard deviation of the observation noise for every single trial."""

    @property
    def known_noise(self) -> float | None:
        """Standard deviation of the observation noise of its settings, 0 for none; None where it is learnt."""
        ...

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
        noise: NDArray[np.float64] | None = None,
    ) -> Posterior:
        """Learn from X (n, d), y (n,) and known standard deviations of the observations (n,)."""
        ...


@runtime_checkable
class KnowsMeans(Protocol):
    """A posterior that gives means alone in less time than `moments` takes."""

    def means(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the means (m, q) at queries (q, d)."""
        ...


@runtime_checkable
class LeavesOut(Protocol):
    """A posterior that can say what it would think of each of its trials without it."""

    def left_out(self) -> Moments:
        """Return means and variances (m, n) of each trial's value given all other trials, observation noise included.

        The hyperparameters stay those that were learnt from all.
        """
        ...


def means(posterior: Posterior, queries: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of f (m, q) at queries (q, d) under each particle."""
    return posterior.means(queries) if isinstance(posterior, KnowsMeans) else posterior.moments(queries).mean


def mixture(moments: Moments) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean (q,) and variance (q,) of the equally weighted mixture of particles.

    The mean is the mean of the means, the variance follows from the law of total variance:
    E[variance] + Var[mean].
    """
    mean = moments.mean.mean(axis=0)
    spread = np.clip(moments.mean - mean, -_LARGEST, _LARGEST)
    return mean, moments.variance.mean(axis=0) + (spread**2).mean(axis=0)

"""What the optimizer asks of a surrogate: a distribution over functions, conditioned on trials.

Legend
    m   particles: equally likely settings of the hyperparameters, each a Gaussian process of its own
    q   queries in the unit cube (q, d)
    s   points of a quadrature of the input noise: offsets (s, d), weights (s,) that sum to 1
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

_LARGEST = 1e150  # the square of a larger number is infinite

__all__ = ["FitDiagnostics", "Moments", "Posterior", "Surrogate", "mixture"]


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


class Posterior(Protocol):
    """A surrogate conditioned on trials."""

    diagnostics: FitDiagnostics

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

    def with_pending(self, X: NDArray[np.float64]) -> "Posterior":
        """Return the posterior as if each particle's own mean had been observed at X (k, d)."""
        ...


class Surrogate(Protocol):
    """A distribution over functions before any trial."""

    def condition(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.float64],
        rng: np.random.Generator,
        previous: Posterior | None = None,
    ) -> Posterior:
        """Learn the hyperparameters from inputs X (n, d) in the unit cube and outputs y (n,)."""
        ...


def mixture(moments: Moments) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean (q,) and variance (q,) of the equally weighted mixture of particles.

    The mean is the mean of the means, the variance follows from the law of total variance:
    E[variance] + Var[mean].
    """
    mean = moments.mean.mean(axis=0)
    spread = np.clip(moments.mean - mean, -_LARGEST, _LARGEST)
    return mean, moments.variance.mean(axis=0) + (spread**2).mean(axis=0)

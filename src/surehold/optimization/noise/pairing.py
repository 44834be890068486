"""Input noise beside conditions that nobody sets: one set of points for both.

    z   points of the input noise, (s, r)        c   representative conditions, (k, u)
    J   quasi-random points of r + u dimensions, as many as there will be pairs, (n, r + u)

Each z goes to the point of J that is nearest to it in the first r dimensions, by ranks, each c to the one nearest in
the others; a pair is what meets there. Paired at random, the n points would be no better than random ones for all that
depends on both.
"""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import COARSE_CONDITIONS
from surehold.optimization.noise.quadratures import Quadrature, quasi_monte_carlo
from surehold.optimization.noise.samples import representatives
from surehold.optimization.uncontrolled import Conditions

__all__ = ["under_conditions"]


def under_conditions(points: Quadrature, conditions: Conditions, rule: str, exponent: int) -> Quadrature:
    """Return a quadrature of the input noise with the values of uncontrolled variables in their columns.

    Quasi-random points are paired with as many representative conditions; the few points of the other rules are
    combined with each of 8.
    """
    quasi = rule == "quasi_monte_carlo"
    taken = representatives(conditions.samples, 2**exponent if quasi else COARSE_CONDITIONS)
    s, c = len(points.weights), len(taken.weights)
    if quasi and s > 1:
        i, j = _paired(points.offsets[:, ~conditions.held], taken.offsets, exponent)
    else:
        i, j = np.repeat(np.arange(s), c), np.tile(np.arange(c), s)
    noise = points.offsets[i]
    noise[:, conditions.held] = taken.offsets[j]
    weights = (points.weights / np.bincount(i, minlength=s))[i] * (taken.weights / np.bincount(j, minlength=c))[j]
    return Quadrature(noise, weights / weights.sum())


def _paired(
    noise: NDArray[np.float64], conditions: NDArray[np.float64], exponent: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return which of the points of the noise (s, r) and of the conditions (c, u) make the 2**exponent pairs."""
    noise = noise[:, np.ptp(noise, axis=0) > 0.0]
    n, r = 2**exponent, noise.shape[1]
    joint = quasi_monte_carlo(np.eye(r + conditions.shape[1]), exponent).offsets
    i, j = np.arange(n) % len(noise), np.arange(n) % len(conditions)
    return i[_nearest(joint[:, :r], noise[i])], j[_nearest(joint[:, r:], conditions[j])]


def _nearest(standard: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return which of the points (n, k) goes to each of n standard normal ones, (n, k), all of them used once."""
    from scipy.optimize import linear_sum_assignment
    from scipy.special import ndtri
    from scipy.stats import rankdata

    shares = (rankdata(points, axis=0) - 0.5) / len(points)
    if points.shape[1] > 1:
        apart = ndtri(shares)[None, :, :] - standard[:, None, :]
        return linear_sum_assignment(np.einsum("ijk,ijk->ij", apart, apart))[1]
    return np.argsort(shares[:, 0], kind="stable")[rankdata(standard[:, 0], method="ordinal") - 1]

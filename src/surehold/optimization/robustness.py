"""Input noise as a weighted set of perturbations, and what it does to a posterior.

Legend (the thesis' symbols in brackets)
    S        covariance of the input noise in the unit cube, (d, d)           [Sigma_x]
    k        free parameter of the unscented transformation
    s        number of points: 2 d + 1, or 2 r + 1 where only r variables carry noise
    offsets  perturbations xi_i, (s, d)
    weights  w_i, (s,), summing to 1
    g(x)     E f(x + noise), about sum_i w_i f(x + xi_i)                      [unscented outcome, UO]
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.errors import InputError

__all__ = ["Quadrature", "exact", "gaussian_sample", "sigma_points"]


class Quadrature(NamedTuple):
    """Weighted perturbations of the input."""

    offsets: NDArray[np.float64]
    """(s, d)"""
    weights: NDArray[np.float64]
    """(s,), summing to 1"""


def sigma_points(covariance: ArrayLike, k: float = 1.0) -> Quadrature:
    """Return the sigma points of N(0, covariance), thesis (3.17), and their weights, thesis (3.18).

    The offsets are 0 and plus and minus the columns of the lower Cholesky factor of (r + k) S; the weights
    k / (r + k) and 1 / (2 (r + k)). Mean and covariance of the noise are met exactly. Variables without noise (zero
    row and column) get no points: r counts the others.

    Parameters
    ----------
    covariance : (d, d)
        Symmetric, positive definite in the variables that carry noise.
    k
        Weight of the center; r + k must be positive. A negative k gives a negative center weight.

    Raises
    ------
    InputError
        If the covariance is not such a matrix, or r + k is not positive.

    Examples
    --------
    >>> offsets, weights = sigma_points([[0.01]], k=1.0)
    >>> offsets.ravel().round(4), weights
    (array([ 0.    ,  0.1414, -0.1414]), array([0.5 , 0.25, 0.25]))
    """
    S = np.array(covariance, dtype=np.float64)
    if S.ndim != 2 or S.shape[0] != S.shape[1] or S.size == 0 or not np.all(np.isfinite(S)):
        raise InputError(f"covariance has shape {S.shape}; give a finite square matrix (d, d).")
    d = len(S)
    noisy = np.flatnonzero(np.any(S != 0.0, axis=0) | np.any(S != 0.0, axis=1))
    r = len(noisy)
    if r == 0:
        return exact(d)
    if not (np.isfinite(k) and r + k > 0.0):
        raise InputError(f"k is {k!r}; with {r} noisy variables it must be a finite number above {-r}.")
    part = S[np.ix_(noisy, noisy)]
    if not np.allclose(part, part.T, rtol=1e-10, atol=0.0):
        raise InputError("covariance is not symmetric; entry (i, j) must equal entry (j, i).")
    try:
        root = np.linalg.cholesky((r + k) * part)
    except np.linalg.LinAlgError:
        raise InputError("covariance is not positive definite; check its variances and correlations.") from None
    offsets = np.zeros((2 * r + 1, d))
    offsets[1 : r + 1, noisy] = root.T
    offsets[r + 1 :, noisy] = -root.T
    weights = np.full(2 * r + 1, 0.5 / (r + k))
    weights[0] = k / (r + k)
    return Quadrature(offsets, weights)


def exact(dimension: int) -> Quadrature:
    """Return the single point of an input that is reached exactly."""
    return Quadrature(np.zeros((1, dimension)), np.ones(1))


def gaussian_sample(covariance: NDArray[np.float64], exponent: int = 7) -> Quadrature:
    """Return 2**exponent equally weighted quasi-random points of N(0, covariance): an unscrambled Sobol sequence.

    For spread and quantiles, which a handful of sigma points cannot give. The covariance (d, d) may be singular.
    """
    from scipy.special import ndtri
    from scipy.stats import qmc

    d = len(covariance)
    n = 2**exponent
    uniform = (qmc.Sobol(d, scramble=False).random_base2(exponent) + 0.5 / n) % 1.0
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return Quadrature(ndtri(uniform) @ root.T, np.full(n, 1.0 / n))

"""Weighted perturbations that stand for the input noise: sigma points and other quadratures.

Legend (the thesis' symbols in brackets)
    S        covariance of the input noise in the unit cube, (d, d)           [Sigma_x]
    r        variables that carry noise; the others get no points
    R        a square root of S restricted to them, R R' = S
    k        free parameter of the unscented transformation
    s        number of points
    offsets  perturbations xi_i, (s, d)
    weights  w_i, (s,), summing to 1
Every rule has mean 0 and covariance S; quasi-random points of uniform noise, or of very many variables, have its
variances.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surehold.defaults import QUASI_RANDOM_EXPONENT, SCRAMBLINGS
from surehold.errors import InputError, unknown_name

__all__ = [
    "QUADRATURES",
    "Quadrature",
    "central_difference_points",
    "exact",
    "gauss_hermite",
    "quadrature",
    "quasi_monte_carlo",
    "scaled_sigma_points",
    "sigma_points",
]

QUADRATURES: Final = ("unscented", "scaled_unscented", "central_difference", "gauss_hermite", "quasi_monte_carlo")


class Quadrature(NamedTuple):
    """Weighted perturbations of the input."""

    offsets: NDArray[np.float64]
    """(s, d)"""
    weights: NDArray[np.float64]
    """(s,), summing to 1"""


def quadrature(
    name: str, covariance: ArrayLike, k: float = 1.0, *, bounded: bool = False, exponent: int = QUASI_RANDOM_EXPONENT
) -> Quadrature:
    """Return the rule of that name for N(0, covariance).

    `k` is of "unscented" alone, `exponent` of "quasi_monte_carlo". For `bounded` noise, uniform in every variable,
    "gauss_hermite" is the Gauss-Legendre rule and "quasi_monte_carlo" spreads its points evenly; the others know mean
    and covariance only. Raises InputError for an unknown name or a covariance that is not one.
    """
    if name == "unscented":
        return sigma_points(covariance, k)
    if name == "scaled_unscented":
        return scaled_sigma_points(covariance)
    if name == "central_difference":
        return central_difference_points(covariance)
    if name == "gauss_hermite":
        return gauss_hermite(covariance, bounded=bounded)
    if name == "quasi_monte_carlo":
        return quasi_monte_carlo(covariance, exponent, bounded)
    raise unknown_name("quadrature", name, (*QUADRATURES, "closed_form"))


def exact(dimension: int) -> Quadrature:
    """Return the single point of an input that is reached exactly."""
    return Quadrature(np.zeros((1, dimension)), np.ones(1))


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
    noisy, root, d = _root(covariance)
    r = len(noisy)
    if r == 0:
        return exact(d)
    if not (np.isfinite(k) and r + k > 0.0):
        raise InputError(f"k is {k!r}; with {r} noisy variables it must be a finite number above {-r}.")
    return _star(noisy, root, d, np.sqrt(r + k), k / (r + k))


def scaled_sigma_points(covariance: ArrayLike, alpha: float = 0.5, kappa: float = 0.0) -> Quadrature:
    """Return the scaled sigma points of N(0, covariance), the thesis' reference [32] (Julier 2002).

    The points lie at alpha sqrt(r + kappa) standard deviations and the center has the weight
    1 - 1 / (alpha^2 (1 + kappa / r)), which is negative for a small alpha. (The third parameter, beta, changes the
    transformed variance alone, not the mean.) Raises InputError unless alpha > 0 and r + kappa > 0.
    """
    noisy, root, d = _root(covariance)
    r = len(noisy)
    if r == 0:
        return exact(d)
    if not (np.isfinite(alpha) and alpha > 0.0):
        raise InputError(f"alpha is {alpha!r}; give a positive finite number, 1 for unscaled sigma points.")
    if not (np.isfinite(kappa) and r + kappa > 0.0):
        raise InputError(f"kappa is {kappa!r}; with {r} noisy variables it must be a finite number above {-r}.")
    spread = alpha * alpha * (r + kappa)
    return _star(noisy, root, d, np.sqrt(spread), 1.0 - r / spread)


def central_difference_points(covariance: ArrayLike, step: float = 3.0**0.5) -> Quadrature:
    """Return the points of the central (divided) difference transformation, the thesis' references [30] and [31].

    The center has the weight (h^2 - r) / h^2 and each of the 2 r points at h standard deviations 1 / (2 h^2), for the
    step h; sqrt(3) matches the fourth moment of a normal (Norgaard et al. 2000). Raises InputError unless h > 0.
    """
    noisy, root, d = _root(covariance)
    r = len(noisy)
    if r == 0:
        return exact(d)
    if not (np.isfinite(step) and step > 0.0):
        raise InputError(f"step is {step!r}; give a positive finite number of standard deviations.")
    return _star(noisy, root, d, step, 1.0 - r / step**2)


def gauss_hermite(covariance: ArrayLike, order: int = 3, bounded: bool = False) -> Quadrature:
    """Return the product Gauss-Hermite rule of `order` points a noisy variable: s = order ** r.

    The most accurate rule of its size for smooth models in two variables (GM, noise 0.1: 0.063 % of the range with 25
    points, quasi-Monte Carlo 1.5 % with 32), and not for a narrow peak (RKHS, noise 0.02: 1.05 % with 5, quasi-Monte
    Carlo 0.70 % with 32, sigma points 0.44 % with 3); `benchmarks.quadrature_error`, one seed.

    For `bounded` noise, uniform and independent, Gauss-Legendre instead. Exact for polynomials up to degree
    2 order - 1 in each variable. Raises InputError for an order below 1 or more than 10,000 points.
    """
    noisy, root, d = _root(covariance)
    r = len(noisy)
    if isinstance(order, bool) or not isinstance(order, int) or order < 1:
        raise InputError(f"order is {order!r}; give a whole number of 1 or more.")
    if r == 0:
        return exact(d)
    if order**r > 10_000:
        raise InputError(f"order {order} in {r} noisy variables makes {order**r} points; use 'unscented' instead.")
    nodes, weights = np.polynomial.legendre.leggauss(order) if bounded else np.polynomial.hermite_e.hermegauss(order)
    nodes = nodes * 3.0**0.5 if bounded else nodes  # unit variance
    grid = np.stack(np.meshgrid(*[nodes] * r, indexing="ij"), axis=-1).reshape(-1, r)
    product = np.ones(len(grid))
    for column in np.stack(np.meshgrid(*[weights / weights.sum()] * r, indexing="ij"), axis=-1).reshape(-1, r).T:
        product = product * column
    offsets = np.zeros((len(grid), d))
    offsets[:, noisy] = grid @ root.T
    return Quadrature(offsets, product / product.sum())


def quasi_monte_carlo(
    covariance: ArrayLike, exponent: int = QUASI_RANDOM_EXPONENT, bounded: bool = False
) -> Quadrature:
    """Return 2**exponent equally weighted quasi-random points of N(0, covariance).

    Of uniform noise with that covariance where it is `bounded`.

    For spread and quantiles, which a handful of sigma points cannot give. Points come in pairs of opposite sign, so
    that the mean is exactly 0. Normal points have the covariance exactly, too, in up to half as many noisy variables as
    there are points; others its variances.
    """
    noisy, root, d = _root(covariance)
    if len(noisy) == 0:
        return exact(d)
    points = _standard_points(len(noisy), exponent, bounded)
    offsets = np.zeros((len(points), d))
    offsets[:, noisy] = points @ root.T
    return Quadrature(offsets, np.full(len(points), 1.0 / len(points)))


@lru_cache(maxsize=64)
def _standard_points(r: int, exponent: int, bounded: bool) -> NDArray[np.float64]:
    """Return quasi-random points (2**exponent, r) with unit variances, the second half the mirror image of the first.

    Half are the cells of a scrambled Sobol sequence, a quarter of a cell from their border: mirrored points lie between
    the others, and along each variable all are different and evenly spaced, as shares of the noise. Of several
    scramblings the one with the least centered discrepancy is taken (Hickernell 1998): few points of an unscrambled
    sequence crowd in corners, and some of its variables are nearly the same.
    """
    from scipy.linalg import solve_triangular
    from scipy.special import ndtri
    from scipy.stats import qmc

    half = 2 ** (exponent - 1)
    few = r <= half

    def mirrored(seed: int) -> NDArray[np.float64]:
        cells = np.floor(half * qmc.Sobol(r, rng=seed).random_base2(exponent - 1))
        return np.concatenate([cells + 0.25, half - cells - 0.25]) / half

    shares = min((mirrored(seed) for seed in range(SCRAMBLINGS if few else 1)), key=qmc.discrepancy)
    points = 2.0 * shares - 1.0 if bounded else ndtri(shares)
    if few and not bounded:
        points = solve_triangular(np.linalg.cholesky(points.T @ points / len(points)), points.T, lower=True).T
    else:
        points /= np.sqrt(np.mean(points**2, axis=0))
    points.flags.writeable = False
    return points


def _star(noisy: NDArray[np.intp], root: NDArray[np.float64], d: int, distance: float, center: float) -> Quadrature:
    r = len(noisy)
    offsets = np.zeros((2 * r + 1, d))
    offsets[1 : r + 1, noisy] = distance * root.T
    offsets[r + 1 :, noisy] = -distance * root.T
    weights = np.full(2 * r + 1, 0.5 / distance**2)
    weights[0] = center
    return Quadrature(offsets, weights)


def _root(covariance: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.float64], int]:
    """Return the noisy variables (r,), the lower Cholesky factor of their covariance (r, r), and d."""
    try:
        S = np.array(covariance, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"covariance is {covariance!r}; give a finite square matrix (d, d).") from None
    if S.ndim != 2 or S.shape[0] != S.shape[1] or S.size == 0 or not np.all(np.isfinite(S)):
        raise InputError(f"covariance has shape {S.shape}; give a finite square matrix (d, d).")
    noisy = np.flatnonzero(np.any(S != 0.0, axis=0) | np.any(S != 0.0, axis=1))
    part = S[np.ix_(noisy, noisy)]
    if not np.allclose(part, part.T, rtol=1e-10, atol=0.0):
        raise InputError("covariance is not symmetric; entry (i, j) must equal entry (j, i).")
    try:
        return noisy, np.linalg.cholesky(part).astype(np.float64), len(S)
    except np.linalg.LinAlgError:
        raise InputError("covariance is not positive definite; check its variances and correlations.") from None

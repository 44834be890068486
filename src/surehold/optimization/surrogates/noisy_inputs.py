"""Learning from trials that did not reach what was commanded.

Legend
    X, y     commanded inputs (n, d) in the unit cube, and values (n,)
    S        covariance of the input noise, R R' = S, (d, d)
    z        independent standard normals (d,), of which the input noise is R z
    a, b     the model's mean along a column of R is m + a z + b z^2, (n, d) of each particle

A trial that strayed looks like one with an observation noise, large where the function is steep: to first order of
variance slope' S slope (McHutchon and Rasmussen 2011, equation 5), to second order, here by single columns of R, the
sum of a^2 + 2 b^2. On the top of a hill, where the answer is, the slope says that nothing strays. All of 2 b^2, as if
it were normal noise, flattens hills under wide noise: a part counts. To second order the mean of the trial is not f(x)
either, but f averaged over the noise, lower on a hill and higher in a hollow: the model would learn the averaged
function, and whoever averages it again would promise too little. What averaging changes, the sum of b, by the model of
the round before, is therefore taken off the values.
"""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import CURVATURE_WEIGHT, SLOPE_ROUNDS
from surehold.optimization.surrogates.protocol import NoisySurrogate, Posterior, means

__all__ = ["by_straying", "condition_on_noisy_inputs"]


def condition_on_noisy_inputs(
    surrogate: NoisySurrogate,
    X: NDArray[np.float64],
    y: NDArray[np.float64],
    roots: NDArray[np.float64],
    seed: list[int],
    told: NDArray[np.float64] | None = None,
) -> Posterior:
    """Return the surrogate conditioned on trials whose inputs strayed.

    Where the surrogate learns the observation noise, what comes of slopes and curvature is part of it.

    Parameters
    ----------
    X, y
        Commanded or, where known, reached inputs (n, d), and values (n,).
    roots : (n, d, d)
        Root of the input noise's covariance at each trial; 0 where the reached input is known.
    seed
        Of the surrogate's random numbers, the same in every round.
    told : (n,)
        Standard deviation of the observation noise of each trial, in place of the surrogate's.
    """
    known = surrogate.known_noise if told is None else told
    noise = None
    if known is not None:
        spread = float(np.abs(y - y.mean()).mean())
        size = np.sqrt(np.square(roots).sum(axis=(1, 2)))
        noise = np.hypot(known, spread * np.minimum(2.0 * size, 1.0))  # before slopes are known: those of half the box
    posterior = surrogate.condition(X, y, np.random.default_rng(seed), None, noise)
    for following in range(2, SLOPE_ROUNDS + 1):
        added, variance = by_straying(posterior, X, roots)
        if known is not None:
            noise = np.sqrt(known**2 + variance)
        # The first round knows no slopes and bends after the noise: what it says of averaging is left out.
        values = y - added if following > 2 or known is None else y
        posterior = surrogate.condition(X, values, np.random.default_rng(seed), None, noise)
    return posterior


def by_straying(
    posterior: Posterior, X: NDArray[np.float64], roots: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what straying adds to the mean of the outcome at each input, and the variance it counts as, (n,) each.

    Both are means over the particles, from three points along each column of the root: exact for sums of quadratic
    functions of one column. Of more than `defaults.MANY` trials each point is answered from neighbors of its own, and
    the curvature is known less exactly.
    """
    n, d = X.shape
    steps = np.sqrt(3.0) * np.swapaxes(roots, 1, 2)  # (n, d, d), column by column
    points = X[:, None, :] + np.concatenate([np.zeros((n, 1, d)), steps, -steps], axis=1)
    outcomes = np.asarray(means(posterior, points.reshape(-1, d))).reshape(-1, n, 1 + 2 * d)
    middle, ahead, behind = np.split(outcomes, [1, 1 + d], axis=2)
    a, b = (ahead - behind) / np.sqrt(12.0), (ahead + behind - 2.0 * middle) / 6.0  # (m, n, d)
    return b.sum(axis=2).mean(axis=0), (a**2 + CURVATURE_WEIGHT * b**2).sum(axis=2).mean(axis=0)

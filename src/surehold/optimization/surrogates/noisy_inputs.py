"""Learning from trials that did not reach what was commanded.

Legend
    X, y     commanded inputs (n, d) in the unit cube, and values (n,)
    S        covariance of the input noise, R R' = S, (d, d)
    slope    gradient of the model's mean at an input, (d,)

To first order y = f(x + xi) = f(x) + slope' xi: a trial that strayed looks like one with an observation noise of
variance slope' S slope, large where the function is steep (McHutchon and Rasmussen 2011, equation 5). To second order
its mean is not f(x) either, but f averaged over the noise, lower on a hill and higher in a hollow: the model would
learn the averaged function, and whoever averages it again would promise too little. What averaging changes, by the
model of the round before, is therefore taken off the values.
"""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import SLOPE_ROUNDS
from surehold.optimization.surrogates.protocol import NoisySurrogate, Posterior

__all__ = ["averaging", "condition_on_noisy_inputs"]


def condition_on_noisy_inputs(
    surrogate: NoisySurrogate,
    X: NDArray[np.float64],
    y: NDArray[np.float64],
    roots: NDArray[np.float64],
    seed: list[int],
    told: NDArray[np.float64] | None = None,
) -> Posterior:
    """Return the surrogate conditioned on trials whose inputs strayed.

    Where the surrogate learns the observation noise, what comes of slopes is part of it.

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
        if known is not None:
            slopes = np.asarray(posterior.moments(X, gradient=True).mean_gradient).mean(axis=0)  # (n, d)
            noise = np.sqrt(known**2 + np.square(np.einsum("nde,nd->ne", roots, slopes)).sum(axis=1))
        # The first round knows no slopes and bends after the noise: what it says of averaging is left out.
        values = y - averaging(posterior, X, roots) if following > 2 or known is None else y
        posterior = surrogate.condition(X, values, np.random.default_rng(seed), None, noise)
    return posterior


def averaging(posterior: Posterior, X: NDArray[np.float64], roots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what averaging over the input noise adds to the model's mean at each input, (n,).

    By three points of Gauss-Hermite quadrature along each column of the root: exact for sums of functions of one
    column, to the fifth degree.
    """
    n, d = X.shape
    steps = np.sqrt(3.0) * np.swapaxes(roots, 1, 2)  # (n, e, d)
    offsets = np.concatenate([np.zeros((n, 1, d)), steps, -steps], axis=1)
    weights = np.r_[-d / 3.0, np.full(2 * d, 1.0 / 6.0)]
    return posterior.average(X, offsets, weights).mean.mean(axis=0)

"""Learning from trials that did not reach what was commanded.

Legend
    X, y     commanded inputs (n, d) in the unit cube, and values (n,)
    S        covariance of the input noise, R R' = S, (d, d)
    slope    gradient of the model's mean at an input, (d,)

To first order y = f(x + xi) = f(x) + slope' xi: a trial that strayed looks like one with an observation noise of
variance slope' S slope, large where the function is steep (McHutchon and Rasmussen 2011, equation 5).
"""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import SLOPE_ROUNDS
from surehold.optimization.surrogates.protocol import NoisySurrogate, Posterior

__all__ = ["condition_on_noisy_inputs"]


def condition_on_noisy_inputs(
    surrogate: NoisySurrogate,
    X: NDArray[np.float64],
    y: NDArray[np.float64],
    roots: NDArray[np.float64],
    seed: list[int],
    told: NDArray[np.float64] | None = None,
) -> Posterior:
    """Return the surrogate conditioned on trials whose inputs strayed.

    Where the surrogate learns the observation noise the trials are taken as they are: what they strayed is part of it.

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
    if known is None:
        return surrogate.condition(X, y, np.random.default_rng(seed))
    spread = float(np.abs(y - y.mean()).mean())
    size = np.sqrt(np.square(roots).sum(axis=(1, 2)))
    noise = np.hypot(known, spread * np.minimum(2.0 * size, 1.0))  # before slopes are known: those of half the box
    posterior = surrogate.condition(X, y, np.random.default_rng(seed), None, noise)
    for _ in range(SLOPE_ROUNDS - 1):
        slopes = np.asarray(posterior.moments(X, gradient=True).mean_gradient).mean(axis=0)  # (n, d)
        noise = np.sqrt(known**2 + np.square(np.einsum("nde,nd->ne", roots, slopes)).sum(axis=1))
        posterior = surrogate.condition(X, y, np.random.default_rng(seed), None, noise)
    return posterior

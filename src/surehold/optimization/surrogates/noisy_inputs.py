"""Learning from trials that did not reach what was commanded: a correction of the surrogate, estimates of the noise.

Legend
    X, y     commanded inputs (n, d) in the unit cube, and values (n,)
    S        covariance of the input noise, R R' = S, (d, d)
    slope    gradient of the model's mean at an input, (d,)

To first order y = f(x + xi) = f(x) + slope' xi: a trial that strayed looks like one with an observation noise of
variance slope' S slope, large where the function is steep (McHutchon and Rasmussen 2011, equation 5).
"""

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.surrogates.protocol import Posterior
from surehold.optimization.trials import same

__all__ = ["condition_on_noisy_inputs", "noise_from_reached", "noise_from_repeats"]

_ROUNDS: Final = 3  # of learning and taking slopes; they settle in two
_FEWEST_REPEATS: Final = 4  # degrees of freedom below which a variance is a guess
_FULL: Final = 10  # reports a variable from which correlations are estimated, too


class NoisySurrogate(Protocol):
    """A surrogate that takes the observation noise of every single trial."""

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


def condition_on_noisy_inputs(
    surrogate: NoisySurrogate,
    X: NDArray[np.float64],
    y: NDArray[np.float64],
    roots: NDArray[np.float64],
    known: float,
    seed: list[int],
) -> Posterior:
    """Return the surrogate conditioned on trials whose inputs strayed.

    Parameters
    ----------
    X, y
        Commanded or, where known, reached inputs (n, d), and values (n,).
    roots : (n, d, d)
        Root of the input noise's covariance at each trial; 0 where the reached input is known.
    known
        Standard deviation of the observation noise beside, in the outputs' units.
    seed
        Of the surrogate's random numbers, the same in every round.
    """
    spread = float(np.abs(y - y.mean()).mean())
    size = np.sqrt(np.square(roots).sum(axis=(1, 2)))
    noise = np.hypot(known, spread * np.minimum(2.0 * size, 1.0))  # before slopes are known: those of half the box
    posterior = surrogate.condition(X, y, np.random.default_rng(seed), None, noise)
    for _ in range(_ROUNDS - 1):
        slopes = np.asarray(posterior.moments(X, gradient=True).mean_gradient).mean(axis=0)  # (n, d)
        noise = np.sqrt(known**2 + np.square(np.einsum("nde,nd->ne", roots, slopes)).sum(axis=1))
        posterior = surrogate.condition(X, y, np.random.default_rng(seed), None, noise)
    return posterior


def noise_from_reached(box: Box, commanded: NDArray[np.float64], reached: NDArray[np.float64]) -> InputNoise:
    """Return the input noise that reports of reached inputs show; both (n, d) in the unit cube.

    From 10 reports a variable on with correlations, from fewer the standard deviations alone. Raises InputError for
    less than d + 2 reports.
    """
    n, d = commanded.shape
    if n < d + 2:
        raise InputError(
            f"{n} trials tell what input they reached; to estimate the noise of {d} variables, tell reached= for at "
            f"least {d + 2}."
        )
    strays = (reached - commanded) * box.widths
    if n < _FULL * d:
        deviations = np.sqrt(np.mean(np.square(strays), axis=0))
        return InputNoise(dict(zip(box.names, deviations.tolist(), strict=True)))
    return InputNoise(covariance=strays.T @ strays / n)


def noise_from_repeats(X: NDArray[np.float64], y: NDArray[np.float64]) -> InputNoise:
    """Return the input noise that explains how values differ between trials of one commanded input.

    X (n, d) in the unit cube and y (n,). The noise is taken to be the same share of the box in every variable, and the
    only reason why values differ: variance of y = (share)^2 |slope|^2 at each repeated input. Raises InputError if
    there are fewer than 4 repetitions in all, or the function is level where they are.
    """
    groups: list[NDArray[np.intp]] = []
    left = np.arange(len(y))
    while len(left):
        alike = same(X[left[0]], X[left])
        groups.append(left[alike])
        left = left[~alike]
    repeated = [group for group in groups if len(group) > 1]
    freedom = sum(len(group) - 1 for group in repeated)
    if freedom < _FEWEST_REPEATS:
        raise InputError(
            "nothing to estimate the input noise from: no reached= inputs were told, and inputs were repeated "
            f"{freedom} times; repeat some on steep flanks, {_FEWEST_REPEATS} repetitions in all, or tell reached=."
        )
    model = GaussianProcess(noise="inferred").fit(X, y).posterior
    centers = np.array([X[group[0]] for group in repeated])
    slopes = np.asarray(model.moments(centers, gradient=True).mean_gradient).mean(axis=0)
    steepness = sum((len(g) - 1) * float(s @ s) for g, s in zip(repeated, slopes, strict=True))
    scatter = sum(float(np.square(y[g] - y[g].mean()).sum()) for g in repeated)
    if steepness * 0.25 < scatter:  # more than half of the box would be needed to explain it
        raise InputError(
            "the values of repeated inputs differ by more than input noise can explain where they were repeated: the "
            "function is too level there, or observations are noisy, too. Repeat trials on steep flanks, or tell "
            "reached=."
        )
    share = float(np.sqrt(scatter / steepness))
    if share < 1e-6:
        raise InputError("repeated inputs gave equal values: there is no sign of input noise; pass input_noise=None.")
    return InputNoise.unit(share)

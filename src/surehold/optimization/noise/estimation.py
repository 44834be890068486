"""Estimates of the input noise: from reported inputs, or from values that differ between repeated trials."""

import warnings
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess
from surehold.optimization.trials import same

__all__ = ["noise_from_reached", "noise_from_repeats"]

_FEWEST_REPEATS: Final = 4  # degrees of freedom below which a variance is a guess
_FULL: Final = 10  # reports a variable from which correlations are estimated, too
_ROUNDING: Final = 1e-12  # differences below this, in widths of the box, are rounding
_LEVEL: Final = 1e-3  # probability of naming an offset where there is none


def noise_from_reached(box: Box, commanded: NDArray[np.float64], reached: NDArray[np.float64]) -> InputNoise:
    """Return the input noise that reports of reached inputs show; both (n, d) in the unit cube.

    From 10 reports a variable on with correlations, from fewer the standard deviations alone, as where variables stray
    exactly in step. A constant offset is left out and named in a warning (UserWarning).

    Raises
    ------
    InputError
        For less than d + 2 reports, or if they show an offset and no noise.
    """
    n, d = commanded.shape
    if n < d + 2:
        raise InputError(
            f"{n} trials tell what input they reached; to estimate the noise of {d} variables, tell reached= for at "
            f"least {d + 2}."
        )
    strays = reached - commanded
    center = _offset(box, strays)
    strays = strays - center
    strays[:, np.sqrt(np.mean(np.square(strays), axis=0)) < _ROUNDING] = 0.0
    freedom = n - 1 if center.any() else n
    if not strays.any():
        raise InputError(
            "the reached inputs differ from the commanded ones by the same offset every time: correct it where inputs "
            "are commanded; there is no sign of input noise, pass input_noise=None."
        )
    strays = strays * box.widths
    if n >= _FULL * d:
        try:
            return InputNoise(covariance=strays.T @ strays / freedom)
        except InputError:  # some variables stray in step: no correlation below 1 says so
            pass
    deviations = np.sqrt(np.square(strays).sum(axis=0) / freedom)
    return InputNoise(dict(zip(box.names, deviations.tolist(), strict=True)))


def _offset(box: Box, strays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the constant offset (d,) of the reached inputs, 0 in variables without a significant one; warn of it.

    strays (n, d), reached less commanded inputs in the unit cube. Significant is a mean that a t test takes for 0 with
    a probability below 0.001 divided by the number of variables.
    """
    from scipy.stats import t

    n, d = strays.shape
    mean, error = strays.mean(axis=0), strays.std(axis=0, ddof=1) / np.sqrt(n)
    far = np.abs(mean) > np.maximum(t.isf(0.5 * _LEVEL / d, n - 1) * error, _ROUNDING)
    if far.any():
        named = ", ".join(
            f"{name} by {m:.4g} (standard error {e:.2g})"
            for name, m, e, shown in zip(box.names, mean * box.widths, error * box.widths, far, strict=True)
            if shown
        )
        warnings.warn(
            f"the reached inputs are off on average: {named}. A constant offset is not noise and is left out of the "
            "estimate; correct it where inputs are commanded.",
            stacklevel=4,
        )
    return np.where(far, mean, 0.0)


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

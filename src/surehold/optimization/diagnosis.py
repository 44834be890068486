"""Does the model explain the response? What it would have said of each trial without it.

Legend
    y_i        value of trial i of n
    mu_i, v_i  mean and variance of trial i by the model that has not seen it, observation noise included: of one
               Gaussian process in closed form (Rasmussen and Williams 2006, equation 5.12)
    w_i        share of the box that is nearer to trial i than to any other; they sum to 1

Trials crowd where the response is good, and there each is predicted well from its neighbors. Weighted by w the errors
speak of the whole box: on twelve grasp runs they agree with those at 512 fresh inputs (1.52 and 1.52 of a model that
had collapsed, .50 and .49 of one that had not; unweighted .81 and .30).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import DIAGNOSIS_LEAST, DIAGNOSIS_POINTS, POOR_COVERAGE
from surehold.optimization.surrogates.protocol import LeavesOut, Posterior, mixture

__all__ = ["Diagnosis", "diagnosis"]

_WITHIN: Final = 1.959964  # standard deviations of a 95 % interval
_APART: Final = 6.0  # standard deviations of the observation noise between two values at one input: noise explains less
_ROUNDING: Final = 1e-6  # a difference below this share of the range of all values


@dataclass(frozen=True)
class Diagnosis:
    """How well each trial is predicted from the others, in the box as a whole.

    Attributes
    ----------
    error
        Root mean square of y_i - mu_i, in that of the values about their mean: a constant has 1.
    excess
        Mean of the model's squared errors less the constant's, in standard errors of that mean: above 1, the model
        explains less than a constant, and not by chance.
    coverage
        Share of the box whose trials lie in the model's 95 % intervals.
    disagreement
        Share of the model's variance that is between its particles: settings, or kinds, of the model that disagree.
    resolution
        Shortest length-scale in units of the mean spacing of trials, n^(-1/d); below 1, nothing is known between
        trials. NaN of models without length-scales.
    n
        Number of trials.
    contradicted
        Whether trials at one input gave values that differ by more than the observation noise of the model explains.
    """

    error: float
    excess: float
    coverage: float
    disagreement: float
    resolution: float
    n: int
    contradicted: bool = False

    @property
    def explains_nothing(self) -> bool:
        """Whether a constant would explain more, and not by chance."""
        return self.n >= DIAGNOSIS_LEAST and self.error > 1.0 and self.excess > 1.0

    @property
    def warning(self) -> str:
        """What is wrong with the model, in one or two sentences; empty where nothing is."""
        if self.contradicted:
            return (
                "Trials at one input gave different values, and the model knows of no observation noise that explains "
                "it: give noise='inferred', or its standard deviation; of a study, when it is created "
                "(--observation-noise)."
            )
        if self.explains_nothing:
            return (
                f"The model explains less of the response than a constant would: of a trial that it has not seen it "
                f"misses the value by {self.error:.2g} standard deviations, their mean by 1. Do not rely on what it "
                "expects; make more trials, or narrow the box."
            )
        if self.n >= DIAGNOSIS_LEAST and self.coverage < POOR_COVERAGE:
            return (
                f"The model is too sure of itself: its 95 % intervals hold {100 * self.coverage:.0f} % of the trials "
                "that it has not seen. What it expects may be off by more than it says."
            )
        return ""


def diagnosis(posterior: Posterior, X: NDArray[np.float64], y: NDArray[np.float64]) -> Diagnosis | None:
    """Return how well a posterior explains the trials X (n, d), y (n,) that it is conditioned on.

    None where it cannot leave a trial out, where all trials are at one place, or where all values are equal.
    """
    n, d = X.shape
    if n < 2 or not isinstance(posterior, LeavesOut) or np.ptp(y) == 0.0:
        return None
    w = shares(X)
    if w.max() == 1.0:
        return None
    unit = float(np.abs(y - y.mean()).max())  # squares may overflow
    left_out = posterior.left_out()
    mean, variance = mixture(left_out)
    error = (y - mean) / unit
    constant = (y - w @ y) / unit / (1.0 - w)  # the mean, too, has not seen the trial
    if not w @ constant**2 > 0.0:  # the first trials of all places gave the same
        return None
    excess = error**2 - constant**2
    gap = float(w @ excess)
    chance = float(np.sqrt(np.sum((w * (excess - gap)) ** 2)))
    between = variance - left_out.variance.mean(axis=0)
    scales = getattr(posterior, "length_scales", None)
    return Diagnosis(
        error=float(np.sqrt(w @ error**2 / (w @ constant**2))),
        excess=gap / chance if chance > 0.0 else 0.0,
        coverage=float(w @ (np.abs(y - mean) <= _WITHIN * np.sqrt(variance))),
        disagreement=float(w @ (between / np.maximum(variance, np.finfo(np.float64).tiny))),
        resolution=float("nan") if scales is None else float(np.median(scales, axis=0).min() * n ** (1.0 / d)),
        n=n,
        contradicted=_contradicted(posterior, X, y),
    )


def _contradicted(posterior: Posterior, X: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    places, of = np.unique(X, axis=0, return_inverse=True)
    if len(places) == len(X):
        return False
    highest, lowest = (np.full(len(places), bound) for bound in (-np.inf, np.inf))
    np.maximum.at(highest, of.ravel(), y)
    np.minimum.at(lowest, of.ravel(), y)
    explained = _APART * np.sqrt(posterior.noise_variance(places).mean(axis=0))
    return bool(np.any(highest - lowest > np.maximum(explained, _ROUNDING * np.ptp(y))))


def shares(X: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share (n,) of the unit cube that is nearer to each point of X (n, d) than to any other.

    By the points of a Sobol sequence; of equal points the first has all.
    """
    from scipy.spatial import KDTree
    from scipy.stats import qmc

    points = qmc.Sobol(X.shape[1], scramble=False).random(DIAGNOSIS_POINTS)
    _, nearest = KDTree(X).query(points)
    return np.bincount(nearest, minlength=len(X)) / DIAGNOSIS_POINTS

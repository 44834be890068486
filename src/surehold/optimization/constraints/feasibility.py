"""The probability that a trial succeeds, learnt from which trials failed: a Gaussian process with a probit likelihood.

The model of `surrogates.success`, with its settings (length-scale, signal variance) on a grid, weighed by their
evidence: few labels say little about both, and an edge of failure is sharper than the prior of a success that is to be
maximized allows. Laplace's approximation, at the mode, would be so unsure where labels agree that the search keeps
returning to places that failed. That a criterion times this probability converges is shown by Bachoc, Helbert and
Picheny 2020.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import FAILURE_LENGTHS, FAILURE_SIGNALS
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.numerics.differences import by_differences
from surehold.optimization.surrogates.gaussian_process.kernels import kernel_number
from surehold.optimization.surrogates.success.model import counted
from surehold.optimization.surrogates.success.posterior import SuccessPosterior, sites_of

__all__ = ["Succeeds", "SuccessModel"]

_LIGHT: Final = 1e-3  # settings of less evidence, relative to the largest, are left out


class SuccessModel:
    """Where trials succeed.

    Parameters
    ----------
    X : (n, d)
        Where trials were, the unit cube being the box.
    succeeded : (n,)
        Whether each gave a value.
    """

    def __init__(self, X: NDArray[np.float64], succeeded: NDArray[np.bool_]):
        d = X.shape[1]
        counts = counted(X, succeeded.astype(np.float64), np.ones(len(X)), kernel_number("matern52"))
        grid = [[length * d**0.5] * d + [s2] for length in FAILURE_LENGTHS for s2 in FAILURE_SIGNALS]
        theta = np.log(grid)
        sites = [sites_of(counts, one) for one in theta]
        logs = np.array([one.log_evidence for one in sites])
        weights = np.exp(logs - logs.max())
        kept = np.flatnonzero(weights > _LIGHT)
        self._weights: Final = weights[kept] / weights[kept].sum()
        self._posterior: Final = SuccessPosterior(counts, theta[kept], 0, sites=[sites[j] for j in kept])

    def probability(
        self, U: NDArray[np.float64], gradient: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return P (q,) at U (q, d) and its gradients (q, d), (0, d) where they are not asked for."""
        moments = self._posterior.moments(U, gradient)
        slopes = moments.mean_gradient
        none = np.zeros((0, U.shape[1]))
        return self._weights @ moments.mean, none if slopes is None else np.einsum("m,mqd->qd", self._weights, slopes)


class Succeeds:
    """The requirement that an execution succeeds, over the input noise; its probability counts to the given power."""

    def __init__(self, model: SuccessModel, perturbations: Perturbations, power: float = 1.0):
        self._power: Final = power
        self._model: Final = model
        self._perturbations: Final = perturbations

    def log_probability(
        self, U: NDArray[np.float64], gradient: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the logarithm of the probability (q,) at U (q, d), and its gradients (q, d) where asked for."""
        if gradient and self._perturbations.unknown_slopes:
            return by_differences(lambda V: self.log_probability(V)[0], U)
        q, d = U.shape
        weights = self._perturbations.quadrature.weights
        points, free = self._perturbations.with_slopes(U)
        P, slopes = self._model.probability(points.reshape(-1, d), gradient)
        total = np.maximum(P.reshape(q, -1) @ weights, 1e-300)
        if not gradient:
            return self._power * np.log(total), np.zeros((0, d))
        slopes = slopes.reshape(q, -1, d) if free is None else slopes.reshape(q, -1, d) * free
        return self._power * np.log(total), self._power * np.einsum("s,qsd->qd", weights, slopes) / total[:, None]

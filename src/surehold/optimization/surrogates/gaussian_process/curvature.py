"""Covariance of the hyperparameters by Laplace's method: the inverse curvature of their log posterior at its mode.

Legend
    D    prior standard deviations of theta, a diagonal matrix (p, p)
    S    D (- d^2 log posterior / d theta^2) D, whose eigenvalues are 1 where the trials say nothing
    R    a root of theta's covariance, R R' = D S^-1 D; eigenvalues of S below 1 count as 1: nothing is wider than its
         prior
Of many hyperparameters the trials determine few: S is taken along the directions of its largest eigenvalues (Lanczos'
method), and as the same in all others, the mean over some random ones.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import CURVATURE_STEP, DETERMINED, MANY_HYPERPARAMETERS, UNDETERMINED_PROBES
from surehold.optimization.surrogates.gaussian_process.likelihood import Evidence, log_posterior_and_gradient

__all__ = ["root_of_covariance"]

Array = NDArray[np.float64]

_RESTARTS = 20  # of Lanczos' method, which needs one to three


def root_of_covariance(evidence: Evidence, center: Array, held: int = 0) -> Array:
    """Return R (p, p) at the mode `center` (p,) of the log posterior; D where the curvature is not finite.

    R (p - held, p - held) is of the others where the first hyperparameters are held.
    """
    if center.size - held > MANY_HYPERPARAMETERS:
        return _root_along_few_directions(evidence, center)
    level = log_posterior_and_gradient(center, evidence)[1]
    steps = CURVATURE_STEP * np.eye(center.size)[held:]
    precision = np.array([_curvature_along(step, evidence, center, level)[held:] for step in steps])
    deviation = evidence.prior_deviation[held:]
    scaled = 0.5 * (precision + precision.T) * np.outer(deviation, deviation)
    if not np.all(np.isfinite(scaled)):
        return np.diag(deviation)
    values, vectors = np.linalg.eigh(scaled)
    return deviation[:, None] * vectors / np.sqrt(np.maximum(values, 1.0))


def _root_along_few_directions(evidence: Evidence, center: Array) -> Array:
    from scipy.sparse import linalg

    p, deviation = center.size, evidence.prior_deviation
    level = log_posterior_and_gradient(center, evidence)[1]
    if not (np.all(np.isfinite(level)) and level.any()):  # zeros are the gradient where there is no density
        return np.diag(deviation)

    def scaled(direction: Array) -> Array:
        """Return S times a direction (p,)."""
        length = np.linalg.norm(direction)
        step = CURVATURE_STEP * deviation * direction.ravel() / length
        product = length * deviation * _curvature_along(step, evidence, center, level)
        return np.where(np.isfinite(product), product, 0.0)

    sparse: Any = linalg  # whose stubs know neither operators by function nor tolerances
    operator = sparse.LinearOperator((p, p), matvec=scaled, dtype=np.float64)
    try:
        values, vectors = sparse.eigsh(operator, k=DETERMINED, which="LA", tol=0.1, v0=np.ones(p), maxiter=_RESTARTS)
    except sparse.ArpackNoConvergence as error:  # differences are no exact products: what has converged counts
        values, vectors = error.eigenvalues, error.eigenvectors
    others = np.random.default_rng(0).choice([-1.0, 1.0], (p, UNDETERMINED_PROBES))
    others -= vectors @ (vectors.T @ others)
    rest = max(float(np.mean([z @ scaled(z) / (z @ z) for z in others.T])), 1.0)
    shrunk = 1.0 / np.sqrt(np.maximum(values, 1.0)) - rest**-0.5
    return deviation[:, None] * (rest**-0.5 * np.eye(p) + (vectors * shrunk) @ vectors.T)


def _curvature_along(step: Array, evidence: Evidence, center: Array, level: Array) -> Array:
    """Return minus the second derivatives of the log posterior times step / CURVATURE_STEP (p,).

    `level` is the gradient (p,) at the mode.
    """
    return (level - log_posterior_and_gradient(center + step, evidence)[1]) / CURVATURE_STEP

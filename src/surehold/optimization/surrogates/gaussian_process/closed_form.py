"""The outcome under Gaussian input noise without a quadrature, for the squared-exponential kernel.

Legend
    S     covariance of the input noise in the unit cube, (d, d)
    Lam   diag(l^2), the squared length-scales of a particle, (d, d)
    M     Lam + S for the covariance with the data, Lam + 2 S for the prior variance

    k_g(x, x')  = s2 (|Lam| / |Lam + S|)^(1/2) exp(-(x - x')' (Lam + S)^-1 (x - x') / 2)
    k_gg(x, x)  = s2 (|Lam| / |Lam + 2 S|)^(1/2)
(products of normal densities, Girard et al. 2003, section 3.2; two independent draws of the noise differ by N(0, 2 S)).
"""

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.optimization.surrogates.gaussian_process.kernels import cross_correlation, kernel_number
from surehold.optimization.surrogates.gaussian_process.posterior import GaussianProcessPosterior
from surehold.optimization.surrogates.protocol import Moments, Posterior

__all__ = ["closed_form"]

_SQUARED_EXPONENTIAL = kernel_number("squared_exponential")


def closed_form(
    posterior: Posterior, queries: NDArray[np.float64], covariance: NDArray[np.float64], gradient: bool = False
) -> Moments:
    """Return the moments of g(x) = E f(x + noise), noise ~ N(0, covariance), at queries (q, d).

    Raises
    ------
    InputError
        If the posterior is not that of one Gaussian process with the squared-exponential kernel.
    """
    if not isinstance(posterior, GaussianProcessPosterior) or posterior.evidence.kernel != _SQUARED_EXPONENTIAL:
        raise InputError(
            "the quadrature 'closed_form' is of one Gaussian process with the squared-exponential kernel; give "
            "surrogate=GaussianProcess(kernel='squared_exponential'), or choose another quadrature."
        )
    X, parameters = posterior.evidence.X, posterior.hyperparameters
    shift = posterior.evidence.mean_variance
    q, d = queries.shape
    m, n = posterior.factors.alpha.shape
    mean, variance = np.empty((m, q)), np.empty((m, q))
    by_mean, by_variance = np.empty((m, q, d)), np.empty((m, q, d))
    K = np.empty((n, q))
    for j in range(m):
        squares = np.diag(parameters.inverse_l[j] ** -2)
        inverse_L, alpha = posterior.factors.inverse_L[j], posterior.factors.alpha[j]
        W = np.linalg.inv(np.linalg.cholesky(squares + covariance))
        at_x, at_q = np.ascontiguousarray(X @ W.T), np.ascontiguousarray(queries @ W.T)
        cross_correlation(_SQUARED_EXPONENTIAL, at_x, at_q, np.ones(d), K)
        K *= parameters.s2[j] * np.sqrt(_ratio(squares, squares + covariance))
        V = inverse_L @ (K + shift)
        mean[j] = alpha @ (K + shift)
        prior = parameters.s2[j] * np.sqrt(_ratio(squares, squares + 2.0 * covariance)) + shift
        variance[j] = np.maximum(prior - np.square(V).sum(axis=0), 0.0)
        if gradient:
            slopes = -K[:, :, None] * ((at_q - at_x[:, None]) @ W)  # (n, q, d)
            by_mean[j] = np.einsum("n,nqd->qd", alpha, slopes)
            by_variance[j] = -2.0 * np.einsum("nq,nqd->qd", inverse_L.T @ V, slopes)
    outputs = posterior.outputs
    return Moments(
        outputs.shift + outputs.scale * mean,
        outputs.square * variance,
        outputs.scale * by_mean if gradient else None,
        outputs.square * by_variance if gradient else None,
    )


def _ratio(A: NDArray[np.float64], B: NDArray[np.float64]) -> float:
    return float(np.exp(np.linalg.slogdet(A)[1] - np.linalg.slogdet(B)[1]))

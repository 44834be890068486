"""Where a trial tells most about the outcome of a candidate under input noise.

Legend
    f   the function; a posterior describes it
    g   its outcome under the input noise, sum_i w_i f(x + xi_i)
    m   particles, c points that are considered
"""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import AT_THE_PLACE, LOOK_BETWEEN
from surehold.optimization.noise.perturbations import Perturbations
from surehold.optimization.surrogates.protocol import Posterior

__all__ = ["where_to_look"]


def where_to_look(
    posterior: Posterior,
    u: NDArray[np.float64],
    perturbations: Perturbations,
    beside: Perturbations,
) -> NDArray[np.float64]:
    """Return points (c, d) of the cube near the candidate u (d,), the one that tells most about g(u) first.

    A trial at u does not remove the uncertainty about g(u). Considered are z = u, u + step and u + step / 2 for the
    perturbations `beside`. A trial at z reduces the variance of g(u) by cov(g(u), f(z))^2 / (var f(z) + noise), where
    the covariance comes from var(g + f) = var g + var f + 2 cov(g, f). The reduction by a trial at u counts threefold.
    """
    steps = beside.around(u[None, :])[0] - u  # (s, d)
    steps = steps[np.any(steps != 0.0, axis=1)]
    points = np.clip(u + np.concatenate([np.zeros((1, len(u))), steps, LOOK_BETWEEN * steps]), 0.0, 1.0)
    offsets = perturbations.around(u[None, :])[0] - u  # (s, d)
    weights = np.append(perturbations.quadrature.weights, 1.0)
    variance_g = posterior.average(u[None, :], offsets, weights[:-1]).variance  # (m, 1)
    variance_f = posterior.moments(points).variance  # (m, c)
    together = np.concatenate(
        [np.tile(offsets, (len(points), 1, 1)), (points - u)[:, None, :]], axis=1
    )  # (c, s + 1, d)
    both = posterior.average(np.tile(u, (len(points), 1)), together, weights).variance
    covariance = 0.5 * (both - variance_g - variance_f)  # (m, c)
    total = variance_f + posterior.noise_variance(points).mean(axis=0)
    share = np.divide(covariance, np.sqrt(total), out=np.zeros_like(total), where=total > 0.0)
    gain = np.mean(share**2, axis=0)
    if perturbations.held is None:  # the candidate's own values of uncontrolled variables mean nothing
        gain[0] *= AT_THE_PLACE
    return points[np.argsort(-gain, kind="stable")]

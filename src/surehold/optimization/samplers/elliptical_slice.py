"""Generalized elliptical slice sampling: all coordinates move at once along an ellipse (compiled).

Legend
    theta    state (p,)
    center   mode of the density, (p,)
    root     R (p, p): R R' is about the covariance of the density
    z        R^-1 (theta - center), (p,)
    nu       degrees of freedom of the Student t distribution of z that stands for the density

The density is taken apart into that t distribution and a remainder, nearly constant where the approximation is good.
A t distribution is a mixture of normals: given its scale, the remainder plays the likelihood and the normal the prior
of elliptical slice sampling (Murray, Adams and MacKay 2010, figure 2; the mixture: Nishihara, Murray and Adams 2014,
algorithm 3). The samples follow the density however poor the approximation; a good one accepts nearly every first
proposal, so that a step costs one or two evaluations where coordinate-wise sampling takes four for every coordinate.
"""

from math import cos, log, pi, sin, sqrt
from typing import Any, Final

import numpy as np
from numba import types
from numpy.typing import NDArray

from surehold.optimization.samplers.slice import SHRINKS, SliceSamples, compiled_for
from surehold.store.kernels import njit

__all__ = ["elliptical_slice_sample"]

_NU: Final = 5.0


@njit(cache=True)
def _minus_log_t(z):
    """Return - log of the t density of z (p,), up to a constant."""
    total = 0.0
    for i in range(z.size):
        total += z[i] * z[i]
    return 0.5 * (_NU + z.size) * log(1.0 + total / _NU), total


@njit(cache=True)
def _sample(density, evidence, center, root, burn_in, thin, states, log_densities, rng):
    p = center.size
    z = np.zeros(p)
    theta = center.copy()
    proposal = np.empty(p)
    direction = np.empty(p)
    value = density(theta, evidence)
    remainder, square = value, 0.0
    evaluations = 1
    for step in range(burn_in + thin * states.shape[0]):
        scale = sqrt(0.5 * (_NU + square) / rng.standard_gamma(0.5 * (_NU + p)))
        for i in range(p):
            direction[i] = scale * rng.standard_normal()
        level = remainder + log(1.0 - rng.random())
        angle = 2.0 * pi * rng.random()
        left, right = angle - 2.0 * pi, angle
        shrinks = 0
        while True:
            for i in range(p):
                proposal[i] = z[i] * cos(angle) + direction[i] * sin(angle)
            for i in range(p):
                t = center[i]
                for k in range(p):
                    t += root[i, k] * proposal[k]
                theta[i] = t
            proposed = density(theta, evidence)
            correction, length = _minus_log_t(proposal)
            evaluations += 1
            if proposed + correction >= level or angle == 0.0:  # at 0 it is the present state, which lies in the slice
                value, remainder, square = proposed, proposed + correction, length
                for i in range(p):
                    z[i] = proposal[i]
                break
            if angle < 0.0:
                left = angle
            else:
                right = angle
            shrinks += 1
            angle = left + rng.random() * (right - left) if shrinks < SHRINKS else 0.0
        kept = step - burn_in + 1
        if kept > 0 and kept % thin == 0:
            for i in range(p):
                states[kept // thin - 1, i] = theta[i]
            log_densities[kept // thin - 1] = value
    return evaluations


def elliptical_slice_sample(
    density: Any,
    evidence: Any,
    center: NDArray[np.float64],
    root: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    keep: int,
    burn_in: int,
    thin: int = 1,
) -> SliceSamples:
    """Draw `keep` states from exp(density), after `burn_in` steps from the center, one every `thin` steps.

    Parameters
    ----------
    density
        Compiled function (theta (p,), evidence) -> log density, of one signature; -inf outside the support.
    evidence
        What the density depends on besides, of the type of its second argument.
    center : (p,)
        About the density's mode; its density must be finite.
    root : (p, p)
        root root' is about the density's covariance.
    """
    states = np.empty((keep, center.size))
    log_densities = np.empty(keep)
    vector, matrix, count = types.float64[::1], types.float64[:, ::1], types.int64
    evaluations = compiled_for(_sample, density, evidence, vector, matrix, count, count, matrix, vector)(
        density,
        evidence,
        np.array(center, dtype=np.float64),
        np.ascontiguousarray(root, dtype=np.float64),
        burn_in,
        thin,
        states,
        log_densities,
        rng,
    )
    return SliceSamples(states, log_densities, int(evaluations))

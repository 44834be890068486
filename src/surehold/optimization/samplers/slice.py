"""Univariate slice sampling of a log density, one coordinate after the other in random order (compiled).

Legend
    theta    state (p,)
    level    log height of the slice under the density at theta
    widths   first guess of the slice's width along each coordinate, in theta's units, (p,)
The interval is stepped out and shrunk on rejection: Neal 2003, figures 3 and 5. Both loops have a limit that no proper
density reaches, so that one that is NaN everywhere, or does not fall off, ends them, too.
"""

from functools import cache
from math import log
from typing import Any, Final, NamedTuple

import numpy as np
from numba import typeof, types
from numpy.typing import NDArray

from surehold.store.kernels import njit

__all__ = ["SHRINKS", "SliceSamples", "compiled_for", "slice_sample"]

_STEPS: Final = 10_000  # of the interval to either side
SHRINKS: Final = 1_000  # an interval shrinks to the present state, to the last bit, in about a hundred


class SliceSamples(NamedTuple):
    """Kept states of the chain and what they cost."""

    states: NDArray[np.float64]
    """kept states, (m, p)"""
    log_densities: NDArray[np.float64]
    """log density of each kept state, (m,)"""
    evaluations: int
    """number of times the density was evaluated"""


@njit(cache=True)
def _update(density, evidence, theta, i, value, width, rng):
    """Replace theta[i] by a draw from its slice; return the log density there and the number of evaluations."""
    level = value + log(1.0 - rng.random())  # 1 - u lies in (0, 1]
    x = theta[i]
    left = x - width * rng.random()
    right = left + width
    evaluations = 0
    for _ in range(_STEPS):
        theta[i] = left
        evaluations += 1
        if not density(theta, evidence) > level:
            break
        left -= width
    for _ in range(_STEPS):
        theta[i] = right
        evaluations += 1
        if not density(theta, evidence) > level:
            break
        right += width
    for _ in range(SHRINKS):
        theta[i] = left + rng.random() * (right - left)
        proposed = density(theta, evidence)
        evaluations += 1
        if proposed >= level:
            return proposed, evaluations
        if theta[i] == x:  # the interval has shrunk to the present state, which always lies in the slice
            return value, evaluations
        if theta[i] < x:
            left = theta[i]
        else:
            right = theta[i]
    theta[i] = x
    return value, evaluations


@njit(cache=True)
def _sample(density, evidence, theta, widths, burn_in, thin, states, log_densities, rng):
    p = theta.size
    order = np.arange(p)
    value = density(theta, evidence)
    evaluations = 1
    for sweep in range(burn_in + thin * states.shape[0]):
        for i in range(p - 1, 0, -1):  # Fisher-Yates
            j = int(rng.random() * (i + 1))
            order[i], order[j] = order[j], order[i]
        for i in order:
            value, cost = _update(density, evidence, theta, i, value, widths[i], rng)
            evaluations += cost
        kept = sweep - burn_in + 1
        if kept > 0 and kept % thin == 0:
            states[kept // thin - 1] = theta
            log_densities[kept // thin - 1] = value
    return evaluations


def compiled_for(sampler: Any, density: Any, evidence: Any, *arguments: Any) -> Any:
    """Return `sampler` compiled for densities with the signature of `density` and further `arguments` (types).

    A density that is not compiled yet is compiled for `evidence`: not when its module is imported, which would keep
    everybody waiting who only wants to see a help text.

    The density is passed as a first-class function of one signature, so that one compiled sampler, cached on disk,
    serves every density; left to itself numba would compile the sampler again for each function it is given.
    """
    if not density.nopython_signatures:
        density.compile((types.float64[::1], typeof(evidence)))
    return _compiled(sampler, density.nopython_signatures[0], arguments)


@cache
def _compiled(sampler: Any, signature: Any, arguments: tuple[Any, ...]) -> Any:
    generator = typeof(np.random.default_rng(0))
    sampler.disable_compile(False)
    sampler.compile((types.FunctionType(signature), signature.args[1], *arguments, generator))
    sampler.disable_compile()
    return sampler


def slice_sample(
    density: Any,
    evidence: Any,
    start: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    keep: int,
    burn_in: int,
    thin: int = 1,
    widths: float | NDArray[np.float64] = 6.0,
) -> SliceSamples:
    """Draw `keep` states from exp(density), after `burn_in` sweeps, one every `thin` sweeps.

    Parameters
    ----------
    density
        Compiled function (theta (p,), evidence) -> log density, of one signature; -inf outside the support. A sweep
        updates every coordinate once.
    evidence
        What the density depends on besides, of the type of its second argument.
    start : (p,)
        First state; its density must be finite.
    widths
        First guess of a slice's width in theta's units, one number or one a coordinate (6 in the thesis, in log space).
    """
    states = np.empty((keep, start.size))
    log_densities = np.empty(keep)
    theta = np.array(start, dtype=np.float64)
    guesses = np.broadcast_to(np.asarray(widths, dtype=np.float64), theta.shape).copy()
    vector, count = types.float64[::1], types.int64
    sampler = compiled_for(_sample, density, evidence, vector, vector, count, count, types.float64[:, ::1], vector)
    evaluations = sampler(density, evidence, theta, guesses, burn_in, thin, states, log_densities, rng)
    return SliceSamples(states, log_densities, int(evaluations))

"""Gradient ascents from several starts together, each inside a box of its own.

One call of the objective serves every start that is still climbing: a call costs hardly more for six points than for
one, which a library's ascents, made one after the other, cannot use.

Legend
    r   starts still climbing
    U   their points (r, d), values F (r,), gradients G (r, d)
    B   approximations of the inverse of minus the Hessian, (r, d, d)
    t   step lengths (r,), 1 for the quasi-Newton step

BFGS (Nocedal and Wright 2006, formula 6.17) with backtracking; coordinates at a border that the gradient points out of
stay there, the others' steps are cut off at the borders (Bertsekas 1982).
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    ASCENT_EVALUATIONS,
    ASCENT_FIRST_STEP,
    ASCENT_LONGEST_STEP,
    ASCENT_PRECISION,
    ASCENT_SHORTEN,
    ASCENT_SUFFICIENT,
)

__all__ = ["Objective", "climb"]


class Objective(Protocol):
    """Something to maximize over the unit cube, with gradients."""

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values (q,) at points U (q, d)."""
        ...

    def with_gradient(self, U: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values (q,) and gradients (q, d) at points U (q, d)."""
        ...


def climb(
    objective: Objective,
    starts: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    evaluations: int = ASCENT_EVALUATIONS,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points (a, d) reached from starts (a, d) inside boxes [lower, upper] (a, d), and their values (a,).

    Each ascent makes up to `evaluations` evaluations with gradient. A start whose value is not finite stays.
    """
    points = np.clip(starts, lower, upper)
    values, gradients = objective.with_gradient(points)
    sound = np.isfinite(values) & np.isfinite(gradients).all(axis=1)
    values = np.where(sound, values, -np.inf)
    alive = np.flatnonzero(sound)
    U, F, G = points[alive], values[alive], gradients[alive]
    low, high = lower[alive], upper[alive]
    d = U.shape[1]
    B = _scaled_identity(ASCENT_FIRST_STEP / np.maximum(np.abs(G).max(axis=1), 1e-300), d)
    fresh = np.ones(len(U), dtype=bool)
    t = np.ones(len(U))
    for _ in range(evaluations - 1):
        if len(alive) == 0:
            break
        held = ((low >= U) & (G < 0.0)) | ((high <= U) & (G > 0.0))
        free = np.where(held, 0.0, G)
        direction = np.where(held, 0.0, np.einsum("rij,rj->ri", B, free))
        length = np.abs(direction).max(axis=1)
        direction *= np.minimum(1.0, ASCENT_LONGEST_STEP / np.maximum(length, 1e-300))[:, None]
        V = np.clip(U + t[:, None] * direction, low, high)
        S = V - U
        value, gradient = objective.with_gradient(V)
        promised = np.einsum("ri,ri->r", G, S)
        with np.errstate(invalid="ignore"):  # a value may be infinite
            better = (value >= F + ASCENT_SUFFICIENT * promised) & np.isfinite(gradient).all(axis=1)
        gain = np.where(better, value, F) - F
        moved = np.abs(S).max(axis=1)
        Y = G - np.where(better[:, None], gradient, G)
        B, fresh = _updated(B, S, Y, better, fresh)
        U, G = np.where(better[:, None], V, U), np.where(better[:, None], gradient, G)
        F = F + gain
        t = np.where(better, 1.0, ASCENT_SHORTEN * t)
        points[alive], values[alive] = U, F
        going = (moved > ASCENT_PRECISION) & ~(better & (gain <= ASCENT_PRECISION * (1.0 + np.abs(F))))
        if not going.all():
            alive, U, F, G, B = alive[going], U[going], F[going], G[going], B[going]
            t, fresh, low, high = t[going], fresh[going], low[going], high[going]
    return points, values


def _scaled_identity(scales: NDArray[np.float64], d: int) -> NDArray[np.float64]:
    return scales[:, None, None] * np.eye(d)


def _updated(
    B: NDArray[np.float64],
    S: NDArray[np.float64],
    Y: NDArray[np.float64],
    accepted: NDArray[np.bool_],
    fresh: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return B after steps S (r, d) that changed the gradient by -Y (r, d), and which are still without an update."""
    # c S and c Y give the same B. A power of two as c rounds nothing, and keeps 1 / s'y finite at steps of 1e-155.
    exponent = (np.frexp(np.abs(S).max(axis=1))[1] + np.frexp(np.abs(Y).max(axis=1))[1]) // 2
    S, Y = np.ldexp(S, -exponent[:, None]), np.ldexp(Y, -exponent[:, None])
    sy = np.einsum("ri,ri->r", S, Y)
    yy = np.einsum("ri,ri->r", Y, Y)
    curved = accepted & (sy > 1e-12 * np.sqrt(yy) * np.abs(S).max(axis=1)) & (yy > 0.0) & np.isfinite(yy)
    if not curved.any():
        return B, fresh
    sy, yy = np.where(curved, sy, 1.0), np.where(curved, yy, 1.0)
    d = S.shape[1]
    base = np.where((curved & fresh)[:, None, None], _scaled_identity(sy / yy, d), B)  # Nocedal and Wright (6.20)
    BY = np.einsum("rij,rj->ri", base, Y)
    outer = np.einsum("ri,rj->rij", S, BY)
    factor = (1.0 + np.einsum("ri,ri->r", Y, BY) / sy) / sy
    new = base + factor[:, None, None] * np.einsum("ri,rj->rij", S, S)
    new -= (outer + np.swapaxes(outer, 1, 2)) / sy[:, None, None]
    return np.where(curved[:, None, None], new, B), fresh & ~curved

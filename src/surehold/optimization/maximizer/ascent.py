"""Gradient ascents from several starts together, each inside a box of its own.

One call of the objective serves every start that is still climbing: a call costs hardly more for six points than for
one, which a library's ascents, made one after the other, cannot use.

Legend
    r   starts still climbing
    U   their points (r, d), values F (r,), gradients G (r, d)
    B   approximations of the inverse of minus the Hessian, (r, d, d)
    t   step lengths (r,), 1 for the quasi-Newton step
    S   steps (r, d), Y what they took off the gradients (r, d)

BFGS (Nocedal and Wright 2006, formula 6.17) with backtracking; coordinates at a border that the gradient points out of
stay there, the others' steps are cut off at the borders (Bertsekas 1982).
"""

from math import frexp, isfinite, isnan, ldexp, nan, sqrt
from typing import NamedTuple, Protocol

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
from surehold.store.kernels import njit

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
    unit: float | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points (a, d) reached from starts (a, d) inside boxes [lower, upper] (a, d), and their values (a,).

    Each ascent makes up to `evaluations` evaluations with gradient. A start whose value is not finite stays. `unit` is
    how large a difference of values is, for values in the user's units: one too small to tell ends an ascent. None: a
    difference of 1 and of the value itself, as of logarithms.
    """
    points = np.clip(starts, lower, upper)
    values, gradients = objective.with_gradient(points)
    sound = np.isfinite(values) & np.isfinite(gradients).all(axis=1)
    values = np.where(sound, values, -np.inf)
    alive = np.flatnonzero(sound)
    state = _State.at(points[alive], values[alive], gradients[alive], lower[alive], upper[alive])
    size = nan if unit is None else unit
    for _ in range(evaluations - 1):
        if len(alive) == 0:
            break
        _propose(state)
        value, gradient = objective.with_gradient(state.V)
        going = _advance(state, np.ascontiguousarray(value), np.ascontiguousarray(gradient), size)
        points[alive], values[alive] = state.U, state.F
        if not going.all():
            alive, state = alive[going], _State._make(part[going] for part in state)
    return points, values


class _State(NamedTuple):
    """Where the starts that are still climbing are; plain arrays for compiled code, which writes into them."""

    U: NDArray[np.float64]
    F: NDArray[np.float64]
    G: NDArray[np.float64]
    B: NDArray[np.float64]
    t: NDArray[np.float64]
    fresh: NDArray[np.bool_]
    """whether B is still without an update, (r,)"""
    low: NDArray[np.float64]
    """corners of their boxes, (r, d)"""
    high: NDArray[np.float64]
    V: NDArray[np.float64]
    """points that are tried next, (r, d)"""

    @classmethod
    def at(
        cls,
        U: NDArray[np.float64],
        F: NDArray[np.float64],
        G: NDArray[np.float64],
        low: NDArray[np.float64],
        high: NDArray[np.float64],
    ) -> "_State":
        """Return the state of starts that have made no step."""
        r, d = U.shape
        scales = ASCENT_FIRST_STEP / np.maximum(np.abs(G).max(axis=1, initial=0.0), 1e-300)
        return cls(U, F, G, scales[:, None, None] * np.eye(d), np.ones(r), np.ones(r, dtype=bool), low, high, U.copy())


@njit(cache=True)
def _propose(state):
    """Fill V with the points that the next steps lead to."""
    r, d = state.U.shape
    held = np.empty(d, dtype=np.bool_)
    direction = np.empty(d)
    for i in range(r):
        U, G, B, low, high = state.U[i], state.G[i], state.B[i], state.low[i], state.high[i]
        for k in range(d):
            held[k] = (low[k] >= U[k] and G[k] < 0.0) or (high[k] <= U[k] and G[k] > 0.0)
        length = 0.0
        for k in range(d):
            direction[k] = 0.0
            if not held[k]:
                for o in range(d):
                    if not held[o]:
                        direction[k] += B[k, o] * G[o]
                length = max(length, abs(direction[k]))
        shortened = min(1.0, ASCENT_LONGEST_STEP / max(length, 1e-300))
        for k in range(d):
            state.V[i, k] = min(max(U[k] + state.t[i] * (shortened * direction[k]), low[k]), high[k])


@njit(cache=True)
def _advance(state, value, gradient, size):
    """Take the steps that gain enough, shorten the others, and return which ascents go on (r,).

    `size` is that of a difference of values; NaN: 1 and the value itself.
    """
    r, d = state.U.shape
    going = np.empty(r, dtype=np.bool_)
    S, Y, BY = np.empty(d), np.empty(d), np.empty(d)
    for i in range(r):
        U, G, V = state.U[i], state.G[i], state.V[i]
        promised, moved, change = 0.0, 0.0, 0.0
        finite = True
        for k in range(d):
            S[k] = V[k] - U[k]
            promised += G[k] * S[k]
            moved = max(moved, abs(S[k]))
            finite = finite and isfinite(gradient[i, k])
        better = finite and value[i] >= state.F[i] + ASCENT_SUFFICIENT * promised
        gain = 0.0
        if better:
            gain = value[i] - state.F[i]
            for k in range(d):
                Y[k] = G[k] - gradient[i, k]
                change = max(change, abs(Y[k]))
                U[k] = V[k]
                G[k] = gradient[i, k]
            if _bend(state.B[i], S, Y, BY, moved, change, state.fresh[i]):
                state.fresh[i] = False
            state.F[i] += gain
            state.t[i] = 1.0
        else:
            state.t[i] *= ASCENT_SHORTEN
        unit = 1.0 + abs(state.F[i]) if isnan(size) else size
        settled = better and gain <= ASCENT_PRECISION * unit
        going[i] = moved > ASCENT_PRECISION and not settled
    return going


@njit(cache=True)
def _bend(B, S, Y, BY, largest_step, largest_change, fresh):
    """Update B (d, d) after a step S (d,) that changed the gradient by -Y (d,); False if it tells nothing.

    S and Y are scaled on the way: c S and c Y give the same B. A power of two as c rounds nothing, and keeps 1 / s'y
    finite at steps of 1e-155. BY (d,) is room to work in.
    """
    d = S.size
    exponent = (frexp(largest_step)[1] + frexp(largest_change)[1]) // 2
    sy, yy = 0.0, 0.0
    for k in range(d):
        S[k], Y[k] = ldexp(S[k], -exponent), ldexp(Y[k], -exponent)
        sy += S[k] * Y[k]
        yy += Y[k] * Y[k]
    if not (sy > 1e-12 * sqrt(yy) * ldexp(largest_step, -exponent) and yy > 0.0 and isfinite(yy)):
        return False
    if fresh:
        B[:] = 0.0
        for k in range(d):
            B[k, k] = sy / yy  # Nocedal and Wright (6.20)
    yBy = 0.0
    for k in range(d):
        BY[k] = 0.0
        for o in range(d):
            BY[k] += B[k, o] * Y[o]
        yBy += Y[k] * BY[k]
    factor = (1.0 + yBy / sy) / sy
    for k in range(d):
        for o in range(d):
            B[k, o] += factor * S[k] * S[o] - (S[k] * BY[o] + S[o] * BY[k]) / sy
    return True

"""How fast a link of a closing hand can move from a time on, and when it begins to (compiled).

Notation: see closing.py.
"""

import numpy as np

from surehold.store.kernels import njit

__all__ = ["begins", "lasts", "speed", "speed_along"]


@njit(cache=True)
def _rate(f, j, t, motion, stop):
    """Return the largest absolute rate of joint j of finger f from time t on; 0 if it has stopped or is at its end."""
    rate = motion[1, f, j]
    if stop[f, j] <= t or rate == 0.0:
        return 0.0
    final = motion[3, f, j] if rate > 0.0 else motion[2, f, j]
    return abs(rate) if (motion[0, f, j] + rate * t - final) * rate < 0.0 else 0.0


@njit(cache=True)
def speed(f, k, t, motion, stop, reach):
    """Return an upper bound of the speed of link k of finger f from time t on."""
    v = 0.0
    for j in range(k + 1):
        v += _rate(f, j, t, motion, stop) * reach[f, j, k]
    return v


@njit(cache=True)
def speed_along(f, k, t, across, motion, stop, reach, chains, turns):
    """Return V, W: in the time s from t on, link k of finger f moves along a unit vector by at most V s + W s^2 / 2.

    A joint that turns at the rate r about an axis a moves a point at the lever l by r across . (a x l), at most
    r |l| |across x a|. The axis itself turns no faster than the joints before it do, each by the sine of its angle to
    a, and that is at most the sum of the sines from joint to joint. `turns` (j, 3) are the axes
    of the joints at t.
    """
    v, w = 0.0, 0.0
    rates, turning = 0.0, 0.0  # of the joints before, and how fast the axis turns with them
    for j in range(k + 1):
        if j > 0:
            turning += rates * np.sqrt(chains[f, j - 1, 9] ** 2 + chains[f, j - 1, 13] ** 2)
        rate = _rate(f, j, t, motion, stop)
        if rate == 0.0:
            continue
        if chains[f, j, 0] > 0.0:
            v += rate
            continue
        x = across[1] * turns[j, 2] - across[2] * turns[j, 1]
        y = across[2] * turns[j, 0] - across[0] * turns[j, 2]
        z = across[0] * turns[j, 1] - across[1] * turns[j, 0]
        v += rate * reach[f, j, k] * np.sqrt(x * x + y * y + z * z)
        w += rate * reach[f, j, k] * turning
        rates += rate
    return v, w


@njit(cache=True)
def lasts(way, v, w):
    """Return how long v s + w s^2 / 2 stays below a way [m]."""
    if way <= 0.0:
        return 0.0
    most = v + np.sqrt(v * v + 2.0 * w * way)
    return 2.0 * way / most if most > 0.0 else np.inf


@njit(cache=True)
def begins(f, k, motion, stop):
    """Return the time at which the first joint that moves link k of finger f leaves the end of its range."""
    first = np.inf
    for j in range(k + 1):
        rate = motion[1, f, j]
        if stop[f, j] > 0.0 and rate != 0.0:
            origin = motion[2, f, j] if rate > 0.0 else motion[3, f, j]
            first = min(first, max((origin - motion[0, f, j]) / rate, 0.0))
    return first

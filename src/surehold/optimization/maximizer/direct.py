"""DIRECT: maximization without gradients by dividing rectangles, in several regions together (compiled in part).

Legend
    r       regions, each a box with a search of its own
    level   how often a side of a rectangle was cut into three: its length is 3^-level of the region's, (d,)
    size    of a rectangle: the length of its longest side

Jones, Perttunen and Stuckman 1993, in the locally biased form of Gablonsky and Kelley 2001: size is the longest side,
and of the rectangles of one size only the best is divided. As NLopt's GN_DIRECT_L, with the tolerances that the thesis'
program gave it: no least gain is asked of a divided rectangle, and a round that raises the highest value by next to
nothing is the last. Libraries' routines ask for one value at a time; here one call of the objective serves all
rectangles divided in a round, in all regions.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import THESIS_EVALUATIONS, THESIS_LOCAL_SCALE, THESIS_LOCAL_TRIALS, THESIS_POLISH_DIVISOR
from surehold.optimization.maximizer.ascent import Objective, climb
from surehold.optimization.surrogates.protocol import Regions
from surehold.store.kernels import njit

__all__ = ["divide_and_climb", "divide_rectangles"]

_DEEPEST: Final = 40  # levels of a side; 3^-40 is beyond double precision
_TOLERANCE: Final = 1e-12  # a gain below this, or below this share of the value, ends a search
_LOWEST: Final = -1e300  # stands for values that are not finite


@njit(cache=True)
def _least(levels):
    least = levels[0]
    for k in range(1, levels.size):
        least = min(least, levels[k])
    return least


@njit(cache=True)
def _chosen(sizes, values, count, best_of, chosen):
    """Fill `chosen` with the rectangles to be divided, largest first; return their number.

    sizes (c,), the least level of each, and values (c,), of which the first `count` are in use; best_of is work space.
    """
    for level in range(best_of.size):
        best_of[level] = -1
    for i in range(count):
        level = sizes[i]
        if level < best_of.size and (best_of[level] < 0 or values[i] > values[best_of[level]]):
            best_of[level] = i
    found = 0
    for a in range(best_of.size):
        if best_of[a] < 0:
            continue
        size, value = 3.0**-a, values[best_of[a]]
        slope_up, slope_down = np.inf, 0.0  # slopes k for which value + k size is the highest of all
        for b in range(best_of.size):
            if b == a or best_of[b] < 0:
                continue
            slope = (value - values[best_of[b]]) / (3.0**-b - size)
            if b < a:  # larger ones limit k from above
                slope_up = min(slope_up, slope)
            else:
                slope_down = max(slope_down, slope)
        if slope_down > slope_up:
            continue
        chosen[found] = best_of[a]
        found += 1
    return found


@njit(cache=True)
def _propose(centers, levels, sizes, values, counts, budgets, best_of, chosen, points, owners):
    """Fill points (k, d) with both children along every longest side of the chosen rectangles of every region.

    owners (k, 3): region, parent and side of each. Returns the number of points.
    """
    d = centers.shape[2]
    total = 0
    for r in range(counts.size):
        count = counts[r]
        left = budgets[r] - count
        if left < 2:
            continue
        for c in range(_chosen(sizes[r], values[r], count, best_of, chosen)):
            parent = chosen[c]
            shortest = sizes[r, parent]
            sides = 0
            for k in range(d):
                sides += levels[r, parent, k] == shortest
            if 2 * sides > left:
                continue
            left -= 2 * sides
            for k in range(d):
                if levels[r, parent, k] == shortest:
                    step = 3.0 ** -(shortest + 1.0)
                    for sign in range(2):
                        for j in range(d):
                            points[total, j] = centers[r, parent, j]
                        points[total, k] += step if sign else -step
                        owners[total, 0], owners[total, 1], owners[total, 2] = r, parent, k
                        total += 1
    return total


@njit(cache=True)
def _divide(centers, levels, sizes, values, counts, points, owners, found, total):
    """Add the points (k, d) with their values `found` (k,) as rectangles; the best sides stay longest."""
    d = centers.shape[2]
    start = 0
    while start < total:
        r, parent = owners[start, 0], owners[start, 1]
        stop = start
        while stop < total and owners[stop, 0] == r and owners[stop, 1] == parent:
            stop += 2
        used = np.zeros(d, dtype=np.bool_)
        for _ in range((stop - start) // 2):
            best, pair = -np.inf, -1
            for i in range(start, stop, 2):
                value = max(found[i], found[i + 1])
                if not used[owners[i, 2]] and (pair < 0 or value > best):
                    best, pair = value, i
            side = owners[pair, 2]
            used[side] = True
            levels[r, parent, side] += 1
            for i in range(pair, pair + 2):
                n = counts[r]
                for k in range(d):
                    centers[r, n, k] = points[i, k]
                    levels[r, n, k] = levels[r, parent, k]
                sizes[r, n] = _least(levels[r, n])
                values[r, n] = found[i]
                counts[r] += 1
        sizes[r, parent] = _least(levels[r, parent])
        start = stop


def divide_rectangles(
    objective: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    evaluations: int,
) -> NDArray[np.float64]:
    """Return the highest point found in each box [lower, upper] (r, d), with up to `evaluations` evaluations each.

    A search ends early with the round, the first one excepted, that raises its highest value by less than 1e-12, or by
    less than 1e-12 of it. Where the objective is as small as that everywhere, the point is close to the center.
    """
    regions, d = lower.shape
    width = upper - lower
    centers = np.full((regions, evaluations, d), 0.5)
    levels = np.zeros((regions, evaluations, d), dtype=np.int64)
    sizes = np.zeros((regions, evaluations), dtype=np.int64)
    values = np.full((regions, evaluations), -np.inf)
    counts = np.ones(regions, dtype=np.int64)
    best_of, chosen = np.empty(_DEEPEST, dtype=np.int64), np.empty(_DEEPEST, dtype=np.int64)
    points = np.empty((2 * d * _DEEPEST * regions, d))
    owners = np.empty((len(points), 3), dtype=np.int64)
    budgets = np.full(regions, evaluations)
    values[:, 0] = _finite(objective(lower + 0.5 * width))
    best, first = values[:, 0].copy(), True
    while True:
        total = _propose(centers, levels, sizes, values, counts, budgets, best_of, chosen, points, owners)
        if total == 0:
            break
        home = owners[:total, 0]
        found = _finite(objective(lower[home] + width[home] * points[:total]))
        _divide(centers, levels, sizes, values, counts, points, owners, found, total)
        raised = values.max(axis=1)
        gain = raised - best
        negligible = _TOLERANCE * np.maximum(1.0, 0.5 * (np.abs(raised) + np.abs(best)))
        if not first:
            budgets[(gain > 0.0) & (gain < negligible)] = 0
        best, first = raised, False
    return lower + width * centers[np.arange(regions), values.argmax(axis=1)]


def divide_and_climb(
    objective: Objective,
    dimension: int,
    incumbent: NDArray[np.float64],
    rng: np.random.Generator,
    regions: Regions | None = None,
) -> NDArray[np.float64]:
    """Return points (c, d) worth trying, best first, found as in the original program of the thesis.

    DIRECT with 500 d evaluations in each of the regions (None: in the cube), a tenth of them for a local polish, then
    local searches from five points around the incumbent (d,) over the whole cube. The local search climbs the gradient.
    """
    lower, upper, _ = regions or Regions.whole(dimension)
    budget = THESIS_EVALUATIONS * dimension
    polish = budget // THESIS_POLISH_DIVISOR
    found = divide_rectangles(objective, lower, upper, budget - polish)
    around = incumbent + THESIS_LOCAL_SCALE * rng.standard_normal((THESIS_LOCAL_TRIALS, dimension))
    starts = np.concatenate([found, np.clip(around, 0.0, 1.0)])
    low = np.concatenate([lower, np.zeros_like(around)])
    high = np.concatenate([upper, np.ones_like(around)])
    tops, values = climb(objective, starts, low, high, polish)
    return tops[np.argsort(-values, kind="stable")]


def _finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.isfinite(values), values, _LOWEST)

"""Finding the highest point of an acquisition over the unit cube."""

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.maximizer.ascent import Objective, climb
from surehold.optimization.maximizer.dividing_rectangles import divide_rectangles
from surehold.optimization.surrogates.protocol import Regions

__all__ = ["direct", "largest_holes", "multistart", "promising"]

_CANDIDATES = 256
_HOLES = 1024
_SCALES = (0.1, 0.03, 0.01, 0.003)  # of the perturbed copies of each anchor, in box widths
_COPIES = 8
_STARTS = 4
_IN_REGIONS = 512  # candidates shared out to the regions, where there are several
_STARTS_IN_REGIONS = 6
_LOCAL_TRIALS = 5
_LOCAL_SCALE = 0.05


def multistart(
    objective: Objective,
    screen: Objective,
    dimension: int,
    anchors: NDArray[np.float64],
    rng: np.random.Generator,
    regions: Regions | None = None,
) -> NDArray[np.float64]:
    """Return points (c, d) worth trying, best first: gradient ascents from a Sobol sequence and perturbed anchors.

    Parameters
    ----------
    screen
        The objective, or a cheaper approximation of it, by which the starts of the ascents are chosen.
    anchors : (a, d)
        Promising points, such as the best trials so far: a narrow peak is found from its flank, hardly by chance.
    regions
        Boxes in each of which candidates are laid, and which no ascent leaves; together they are a box, too. None is
        the cube.
    """
    regions = regions or Regions.whole(dimension)
    points = promising(dimension, anchors, rng, regions)
    points = points[np.argsort(-screen(points), kind="stable")]
    home = _regions_of(points, regions)
    starts = _spread(points, _STARTS)
    if len(regions.lower) > 1:  # the best candidate of each of the best regions, then the best ones wherever they are
        leaders = np.sort(np.unique(home, return_index=True)[1])[:_STARTS_IN_REGIONS]
        starts = sorted({*leaders.tolist(), *starts})
    tops, values = climb(objective, points[starts], regions.lower[home[starts]], regions.upper[home[starts]])
    return np.concatenate([tops[np.argsort(-values, kind="stable")], points])


def promising(
    dimension: int, anchors: NDArray[np.float64], rng: np.random.Generator, regions: Regions
) -> NDArray[np.float64]:
    """Return points (c, d) where a maximum may be: a Sobol sequence, another in every region, copies of the anchors."""
    from scipy.stats import qmc

    lower, upper = regions.lower.min(axis=0), regions.upper.max(axis=0)
    candidates = [lower + (upper - lower) * qmc.Sobol(dimension, rng=rng).random(_CANDIDATES)]
    for scale in _SCALES:
        noise = scale * (upper - lower) * rng.standard_normal((_COPIES, *anchors.shape))
        candidates.append(np.clip(anchors + noise, lower, upper).reshape(-1, dimension))
    if len(regions.lower) > 1:
        inside = qmc.Sobol(dimension, rng=rng).random(_IN_REGIONS)[: max(1, _IN_REGIONS // len(regions.lower))]
        width = regions.upper - regions.lower
        candidates.append((regions.lower[:, None] + inside * width[:, None]).reshape(-1, dimension))
    return np.concatenate(candidates)


def direct(
    objective: Objective,
    dimension: int,
    incumbent: NDArray[np.float64],
    rng: np.random.Generator,
    regions: Regions | None = None,
) -> NDArray[np.float64]:
    """Return points (c, d) worth trying, best first, found as the thesis does.

    DIRECT with 500 d evaluations in each of the regions (None: in the cube), a tenth of them for a local polish, then
    local trials around the incumbent (d,) over the whole cube. The local search climbs the gradient.
    """
    lower, upper = regions or Regions.whole(dimension)
    budget = 500 * dimension
    found = divide_rectangles(objective, lower, upper, budget - budget // 10)
    around = incumbent + _LOCAL_SCALE * rng.standard_normal((_LOCAL_TRIALS, dimension))
    starts = np.concatenate([found, np.clip(around, 0.0, 1.0)])
    low = np.concatenate([lower, np.zeros_like(around)])
    high = np.concatenate([upper, np.ones_like(around)])
    tops, values = climb(objective, starts, low, high, budget // 10)
    return tops[np.argsort(-values, kind="stable")]


def largest_holes(points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return points (c, d) of a Sobol sequence, the center of the largest empty ball first.

    Empty of `points` (n, d), and not reaching beyond the cube by more than half its radius: the corners are farthest
    from everything, and seldom where the answer is.
    """
    from scipy.spatial import KDTree
    from scipy.stats import qmc

    centers = qmc.Sobol(points.shape[1], rng=rng).random(_HOLES)
    radius = np.minimum(KDTree(points).query(centers)[0], 2.0 * np.minimum(centers, 1.0 - centers).min(axis=1))
    return centers[np.argsort(-radius, kind="stable")]


def _regions_of(points: NDArray[np.float64], regions: Regions) -> NDArray[np.intp]:
    """Return for each point (q, d) of the cube the first region that holds it, (q,)."""
    home = np.empty(len(points), dtype=np.intp)
    for start in range(0, len(points), 64):  # in pieces: all pairs of many points and regions would fill the memory
        part = points[start : start + 64, None]
        home[start : start + 64] = np.argmax(((part >= regions.lower) & (part <= regions.upper)).all(axis=2), axis=1)
    return home


def _spread(points: NDArray[np.float64], count: int, distance: float = 0.02) -> list[int]:
    """Return the indices of up to `count` of the first points, no two closer than `distance`."""
    chosen: list[int] = []
    for i, point in enumerate(points):
        if all(np.linalg.norm(point - points[j]) >= distance for j in chosen):
            chosen.append(i)
            if len(chosen) == count:
                break
    return chosen

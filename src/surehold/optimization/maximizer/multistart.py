"""The highest point of an acquisition function over the unit cube, by gradient ascents from many candidates."""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    CANDIDATES,
    CANDIDATES_IN_REGIONS,
    COPIES,
    COPY_SCALES,
    START_DISTANCE,
    STARTS,
    STARTS_IN_REGIONS,
)
from surehold.optimization.maximizer.ascent import Objective, climb
from surehold.optimization.surrogates.protocol import Regions

__all__ = ["multistart", "promising"]


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
        Boxes, together a box, in each of which candidates are laid and which no ascent leaves; None: the whole cube.
    """
    regions = regions or Regions.whole(dimension)
    points = promising(dimension, anchors, rng, regions)
    points = points[np.argsort(-screen(points), kind="stable")]
    home = _regions_of(points, regions)
    starts = _spread(points, STARTS)
    if len(regions.lower) > 1:  # the best candidate of each of the best regions, then the best ones wherever they are
        leaders = np.sort(np.unique(home, return_index=True)[1])[:STARTS_IN_REGIONS]
        starts = sorted({*leaders.tolist(), *starts})
    tops, values = climb(objective, points[starts], regions.lower[home[starts]], regions.upper[home[starts]])
    return np.concatenate([tops[np.argsort(-values, kind="stable")], points])


def promising(
    dimension: int, anchors: NDArray[np.float64], rng: np.random.Generator, regions: Regions
) -> NDArray[np.float64]:
    """Return points (c, d) where a maximum may be: a Sobol sequence, another in every region, copies of the anchors."""
    from scipy.stats import qmc

    lower, upper = regions.lower.min(axis=0), regions.upper.max(axis=0)
    candidates = [lower + (upper - lower) * qmc.Sobol(dimension, rng=rng).random(CANDIDATES)]
    for scale in COPY_SCALES:
        noise = scale * (upper - lower) * rng.standard_normal((COPIES, *anchors.shape))
        candidates.append(np.clip(anchors + noise, lower, upper).reshape(-1, dimension))
    if len(regions.lower) > 1:
        inside = qmc.Sobol(dimension, rng=rng).random(CANDIDATES_IN_REGIONS)[
            : max(1, CANDIDATES_IN_REGIONS // len(regions.lower))
        ]
        width = regions.upper - regions.lower
        candidates.append((regions.lower[:, None] + inside * width[:, None]).reshape(-1, dimension))
    return np.concatenate(candidates)


def _regions_of(points: NDArray[np.float64], regions: Regions) -> NDArray[np.intp]:
    """Return for each point (q, d) of the cube the first region that holds it, (q,)."""
    home = np.empty(len(points), dtype=np.intp)
    for start in range(0, len(points), 64):  # in pieces: all pairs of many points and regions would fill the memory
        part = points[start : start + 64, None]
        home[start : start + 64] = np.argmax(((part >= regions.lower) & (part <= regions.upper)).all(axis=2), axis=1)
    return home


def _spread(points: NDArray[np.float64], count: int) -> list[int]:
    """Return the indices of up to `count` of the first points, no two closer than START_DISTANCE."""
    chosen: list[int] = []
    for i, point in enumerate(points):
        if all(np.linalg.norm(point - points[j]) >= START_DISTANCE for j in chosen):
            chosen.append(i)
            if len(chosen) == count:
                break
    return chosen

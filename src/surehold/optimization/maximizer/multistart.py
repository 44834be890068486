"""The highest point of an acquisition function over the unit cube, by gradient ascents from many candidates.

Where variables act each on its own, and are more than three, the highest of these tops is looked at once more, variable
by variable.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import (
    CANDIDATES,
    CANDIDATES_IN_REGIONS,
    COPIES,
    COPY_SCALES,
    FEW_VARIABLES,
    SETTLING_COPIES,
    SETTLING_FIRST,
    SETTLING_ROUNDS,
    SETTLING_SHORTEN,
    START_DISTANCE,
    STARTS,
    STARTS_IN_REGIONS,
)
from surehold.optimization.maximizer.ascent import Objective, climb
from surehold.optimization.maximizer.coordinate_exchange import exchanged
from surehold.optimization.surrogates.protocol import Regions

__all__ = ["Admits", "multistart", "promising"]


class Admits(Protocol):
    """What decides which points are candidates at all; see `constraints.admission.Admission`."""

    def weighed(self, objective: Objective) -> Objective:
        """Return the objective, -inf where nothing can be tried."""
        ...

    def among(self, points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Return those of the points (c, d) that can be tried, or others that can; (0, d) if there are none."""
        ...


def multistart(
    objective: Objective,
    screen: Objective,
    dimension: int,
    anchors: NDArray[np.float64],
    rng: np.random.Generator,
    regions: Regions | None = None,
    admission: Admits | None = None,
    unit: float | None = None,
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
    admission
        Which points can be tried; None: all. Only such are returned: none at all, (0, d), where none is found.
    unit
        How large a difference of the objective is, see `climb`.
    """
    regions = regions or Regions.whole(dimension)
    points = promising(dimension, anchors, rng, regions)
    if admission is not None:
        objective, screen = admission.weighed(objective), admission.weighed(screen)
        points = admission.among(np.concatenate([anchors, points]), rng)
        if not len(points):
            return points
    points = points[np.argsort(-screen(points), kind="stable")]
    home = _regions_of(points, regions)
    starts = _spread(points, STARTS)
    if len(regions.lower) > 1:  # the best candidate of each of the best regions, then the best ones wherever they are
        leaders = np.sort(np.unique(home, return_index=True)[1])[:STARTS_IN_REGIONS]
        starts = sorted({*leaders.tolist(), *starts})
    lower, upper = regions.lower[home[starts]], regions.upper[home[starts]]
    tops, values = climb(objective, points[starts], lower, upper, unit=unit)
    if regions.separable and dimension > FEW_VARIABLES:
        better = exchanged(screen, tops[np.argmax(values)], regions.lower.min(axis=0), regions.upper.max(axis=0), rng)
        if better is not None:
            i = _regions_of(better[None, :], regions)
            top, value = climb(objective, better[None, :], regions.lower[i], regions.upper[i], unit=unit)
            tops, values = np.concatenate([tops, top]), np.concatenate([values, value])
    order = np.argsort(-values, kind="stable")
    if admission is not None:  # ascents stop at a border which is no box's; the best one goes along it
        tops = np.concatenate([_settled(objective, tops[order[0]], float(values[order[0]]), rng)[None, :], tops[order]])
        return np.concatenate([tops, points])
    return np.concatenate([tops[order], points])


def _settled(
    objective: Objective, top: NDArray[np.float64], value: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the best point (d,) found from a top by a random search whose steps shrink after each failure."""
    scale = SETTLING_FIRST
    for _ in range(SETTLING_ROUNDS):
        copies = np.clip(top + scale * rng.standard_normal((SETTLING_COPIES, len(top))), 0.0, 1.0)
        values = objective(copies)
        best = int(np.argmax(values))
        if values[best] > value:
            top, value = copies[best], float(values[best])
        else:
            scale *= SETTLING_SHORTEN
    return top


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

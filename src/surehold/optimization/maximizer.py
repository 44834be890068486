"""Finding the highest point of an acquisition over the unit cube."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surehold.optimization.surrogate import Regions

__all__ = ["Objective", "direct", "largest_holes", "multistart"]

_CANDIDATES = 256
_HOLES = 1024
_SCALES = (0.1, 0.03, 0.01, 0.003)  # of the perturbed copies of each anchor, in box widths
_COPIES = 8
_STARTS = 4
_IN_REGIONS = 512  # candidates shared out to the regions, where there are several
_STARTS_IN_REGIONS = 6
_LOCAL_TRIALS = 5
_LOCAL_SCALE = 0.05


class Objective(Protocol):
    """Something to maximize over the unit cube, with gradients."""

    def __call__(self, U: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values (q,) at points (q, d)."""
        ...

    def with_gradient(self, u: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return value and gradient (d,) at one point (d,)."""
        ...


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
        Boxes in each of which candidates are laid, and which no ascent leaves; None is the cube.
    """
    from scipy.stats import qmc

    candidates = [qmc.Sobol(dimension, rng=rng).random(_CANDIDATES)]
    for scale in _SCALES:
        noise = scale * rng.standard_normal((_COPIES, *anchors.shape))
        candidates.append(np.clip(anchors + noise, 0.0, 1.0).reshape(-1, dimension))
    if regions is None or len(regions.lower) == 1:
        regions = Regions.whole(dimension)
    else:
        inside = qmc.Sobol(dimension, rng=rng).random(_IN_REGIONS)[: max(1, _IN_REGIONS // len(regions.lower))]
        width = regions.upper - regions.lower
        candidates.append((regions.lower[:, None] + inside * width[:, None]).reshape(-1, dimension))
    points = np.concatenate(candidates)
    points = points[np.argsort(-screen(points), kind="stable")]
    home = _regions_of(points, regions)
    starts = _spread(points, _STARTS)
    if len(regions.lower) > 1:  # the best candidate of each of the best regions, then the best ones wherever they are
        leaders = np.sort(np.unique(home, return_index=True)[1])[:_STARTS_IN_REGIONS]
        starts = sorted({*leaders.tolist(), *starts})
    ascents = [_ascend(objective, points[i], box=(regions.lower[home[i]], regions.upper[home[i]])) for i in starts]
    return np.concatenate([_best_first(ascents), points])


def direct(
    objective: Objective,
    dimension: int,
    incumbent: NDArray[np.float64],
    rng: np.random.Generator,
    regions: Regions | None = None,
) -> NDArray[np.float64]:
    """Return points (c, d) worth trying, best first, found as the thesis does.

    DIRECT with 500 d evaluations in each of the regions (None: in the cube), a tenth of them for a local polish, then
    local trials around the incumbent (d,) over the whole cube. The local search is L-BFGS-B.
    """
    from scipy.optimize import direct

    budget = 500 * dimension
    ascents = []
    for lower, upper in zip(*(regions or Regions.whole(dimension)), strict=True):
        found = direct(
            lambda u: -float(objective(u[None, :])[0]),
            list(zip(lower, upper, strict=True)),
            maxfun=budget - budget // 10,
            maxiter=budget,
            vol_tol=0.0,
            len_tol=0.0,
        )
        ascents.append(_ascend(objective, found.x, budget // 10, (lower, upper)))
    for _ in range(_LOCAL_TRIALS):
        start = np.clip(incumbent + _LOCAL_SCALE * rng.standard_normal(dimension), 0.0, 1.0)
        ascents.append(_ascend(objective, start, budget // 10))
    return _best_first(ascents)


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


def _best_first(ascents: list[tuple[NDArray[np.float64], float]]) -> NDArray[np.float64]:
    order = np.argsort([-value for _, value in ascents], kind="stable")
    return np.array([ascents[i][0] for i in order])


def _ascend(
    objective: Objective,
    start: NDArray[np.float64],
    evaluations: int = 40,
    box: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> tuple[NDArray[np.float64], float]:
    from scipy.optimize import minimize

    def negative(u: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        value, gradient = objective.with_gradient(u)
        return (-value, -gradient) if np.isfinite(value) else (1e25, np.zeros_like(gradient))

    found = minimize(
        negative,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * len(start) if box is None else list(zip(*box, strict=True)),
        options={"maxfun": evaluations, "maxiter": evaluations},
    )
    return found.x, -float(found.fun)


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

"""Finding the highest point of an acquisition over the unit cube."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Found", "direct", "multistart"]

_CANDIDATES = 256
_SCALES = (0.1, 0.03, 0.01, 0.003)  # of the perturbed copies of each anchor, in box widths
_COPIES = 8
_STARTS = 4
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


class Found(NamedTuple):
    """Points of the unit cube worth trying, best first."""

    points: NDArray[np.float64]
    """(c, d)"""
    values: NDArray[np.float64]
    """the objective there, (c,)"""


def multistart(objective: Objective, dimension: int, anchors: NDArray[np.float64], rng: np.random.Generator) -> Found:
    """Maximize from a scrambled Sobol sequence and from perturbed copies of the anchors, by gradient ascent.

    Parameters
    ----------
    anchors : (a, d)
        Promising points, such as the best trials so far: a narrow peak is found from its flank, hardly by chance.
    """
    from scipy.stats import qmc

    candidates = [qmc.Sobol(dimension, rng=rng).random(_CANDIDATES)]
    for scale in _SCALES:
        noise = scale * rng.standard_normal((_COPIES, *anchors.shape))
        candidates.append(np.clip(anchors + noise, 0.0, 1.0).reshape(-1, dimension))
    points = np.concatenate(candidates)
    values = objective(points)
    points, values = _sorted(points, values)
    refined = [_ascend(objective, start) for start in _spread(points, _STARTS)]
    return Found(
        *_sorted(
            np.concatenate([np.array([point for point, _ in refined]), points]),
            np.concatenate([np.array([value for _, value in refined]), values]),
        )
    )


def direct(objective: Objective, dimension: int, incumbent: NDArray[np.float64], rng: np.random.Generator) -> Found:
    """Maximize as the thesis does: DIRECT, a local polish, then local trials around the incumbent (d,).

    500 d evaluations, a tenth of them for the polish (spec of the thesis' programs). The local search is L-BFGS-B.
    """
    from scipy.optimize import direct

    budget = 500 * dimension
    found = direct(
        lambda u: -float(objective(u[None, :])[0]),
        [(0.0, 1.0)] * dimension,
        maxfun=budget - budget // 10,
        maxiter=budget,
        vol_tol=0.0,
        len_tol=0.0,
    )
    ascended = [_ascend(objective, found.x, budget // 10)]
    for _ in range(_LOCAL_TRIALS):
        start = np.clip(incumbent + _LOCAL_SCALE * rng.standard_normal(dimension), 0.0, 1.0)
        ascended.append(_ascend(objective, start, budget // 10))
    return Found(*_sorted(np.array([point for point, _ in ascended]), np.array([value for _, value in ascended])))


def _ascend(
    objective: Objective, start: NDArray[np.float64], evaluations: int = 40
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
        bounds=[(0.0, 1.0)] * len(start),
        options={"maxfun": evaluations, "maxiter": evaluations},
    )
    return found.x, -float(found.fun)


def _sorted(points: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    order = np.argsort(-values, kind="stable")
    return points[order], values[order]


def _spread(points: NDArray[np.float64], count: int, distance: float = 0.02) -> list[NDArray[np.float64]]:
    """Return up to `count` of the first points, no two closer than `distance`."""
    chosen: list[NDArray[np.float64]] = []
    for point in points:
        if all(np.linalg.norm(point - other) >= distance for other in chosen):
            chosen.append(point)
            if len(chosen) == count:
                break
    return chosen

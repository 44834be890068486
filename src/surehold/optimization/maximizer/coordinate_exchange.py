"""Better hills, found by changing single variables: a coordinate exchange (Meyer and Nachtsheim 1995).

Where variables act each on its own, hills are as many as the product of those along each of them, and hardly any of a
few hundred candidates lies near the highest; but along each variable the whole box is looked at with a few points.
"""

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import EXCHANGE_PLACES, EXCHANGE_POINTS, EXCHANGE_ROUNDS
from surehold.optimization.maximizer.ascent import Objective

__all__ = ["exchanged"]


def exchanged(
    screen: Objective,
    point: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float64] | None:
    """Return what a point (d,) of the box [lower, upper] becomes by changes of its variables; None if none is better.

    Each round looks at places along every variable, or along some drawn at random where they are many, and takes the
    best of them or the best ones of all variables together.
    """
    d = len(point)
    start, value = point, float(screen(point[None, :])[0])
    shares = np.linspace(0.0, 1.0, EXCHANGE_PLACES)
    for _ in range(EXCHANGE_ROUNDS):
        along = np.arange(d)
        if d * EXCHANGE_PLACES > EXCHANGE_POINTS:
            along = rng.choice(d, EXCHANGE_POINTS // EXCHANGE_PLACES, replace=False)
        row = np.arange(len(along))
        lines = np.tile(point, (len(along), EXCHANGE_PLACES, 1))
        lines[row, :, along] = lower[along, None] + (upper - lower)[along, None] * shares
        values = screen(lines.reshape(-1, d)).reshape(len(along), EXCHANGE_PLACES)
        best = values.argmax(axis=1)
        tops, found = lines[row, best], values[row, best]  # the best place along each variable
        together = point.copy()
        together[along] = np.where(found > value, tops[row, along], point[along])
        changed = np.vstack([tops[found.argmax()], together])
        values = screen(changed)
        if not values.max() > value:
            break
        point, value = changed[values.argmax()], float(values.max())
    return None if point is start else point

"""Sums and products of functions of one variable each, drawn by seed, for `benchmarks.default_parts`.

Legend
    x    points of the unit cube (n, d), d from 4 to 8 or as asked for; the function goes on beyond it
    p_k  part of variable k: sum_i h_i exp(-(x_k - c_i)^2 / (2 w_i^2)), two to four bumps
    f    a sum, sum_k a_k p_k, or a product, prod_k (1 + a_k p_k); a_k says how much variable k matters
    g    E f(x + noise), noise of the same deviation along every variable or none: closed form, part by part
    D    scale of a problem: best g minus the mean of g over the cube; regrets are (best g - g(answer)) / D

Each part has tops of its own: f has as many hills as the product of their numbers, one of which is best. A prior was
chosen on seeds 0 to 29.
"""

import numpy as np
from scipy.stats import qmc

import surehold as sh
from benchmarks.generated_landscapes import BUDGETS

FORMS = ("sum", "product")
_GRID = 20_001


class Separable:
    """A function of the unit cube, its noise, and its expectation under it; drawn by `separable`."""

    def __init__(self, form, parts, deviation):
        self.form, self._parts, self.deviation = form, parts, deviation
        self.box = sh.Box.unit(len(parts))
        self.noise = sh.InputNoise.unit(deviation) if deviation else None

    @property
    def dimension(self):
        return len(self._parts)

    @property
    def budget(self):
        return BUDGETS[self.dimension]

    def __call__(self, x):
        values = self._joined(np.atleast_2d(x), 0.0)
        return float(values[0]) if np.ndim(x) == 1 else values

    def expectation(self, x):
        """Return g (n,) at x (n, d)."""
        return self._joined(np.atleast_2d(x), self.deviation)

    def _joined(self, x, deviation):
        columns = np.stack([_part(bumps, x[:, k], deviation) for k, bumps in enumerate(self._parts)])
        return columns.sum(axis=0) if self.form == "sum" else np.prod(1.0 + columns, axis=0)

    def best(self):
        """Return the value of g where it is best, on a grid of each variable, and the scale D of regrets."""
        grid = np.linspace(0.0, 1.0, _GRID)
        tops = [grid[np.argmax(_part(bumps, grid, self.deviation))] for bumps in self._parts]
        value = float(self.expectation(np.array(tops))[0])
        return value, value - float(self.expectation(qmc.Sobol(self.dimension, scramble=False).random_base2(13)).mean())


def separable(seed, fewest=4, most=8):
    """Return the function of a seed, of that many variables."""
    rng = np.random.default_rng([seed, 62])
    d = int(rng.integers(fewest, most + 1))
    form = FORMS[rng.integers(len(FORMS))]
    deviation = float(rng.choice([0.0, 1.0])) * rng.uniform(0.02, 0.06)
    parts = []
    for _ in range(d):
        count = int(rng.integers(2, 5))
        size = np.exp(rng.uniform(np.log(0.2), 0.0))
        heights = size * rng.uniform(0.4, 1.0, count)
        parts.append((heights, rng.uniform(-0.05, 1.05, count), rng.uniform(0.05, 0.2, count)))
    return Separable(form, parts, deviation)


def _part(bumps, x, deviation):
    """Return the expectation (n,) of a part at x (n,)."""
    heights, centers, widths = bumps
    wider = np.sqrt(widths**2 + deviation**2)
    return np.exp(-0.5 * ((x[:, None] - centers) / wider) ** 2) @ (heights * widths / wider)

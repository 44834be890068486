"""Fourteen kinds of functions by which nothing was chosen, for `benchmarks.generated_family --set kinds`.

Legend
    x    points of the unit cube (n, d); the function goes on beyond it
    c    a place in the cube, or several
    g    E f(x + noise): normal noise of the same deviation along every variable, by the mean over 2^17 quasi-random
         perturbations; the same ones judge all answers
    D    scale of a problem: best g minus the mean of g over the cube; regrets are (best g - g(answer)) / D

Seed k is the (k // 14)-th function of the kind number k % 14. Each has its own number of variables, noise and places.
"""

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, ndtri
from scipy.stats import ortho_group, qmc

import surehold as sh
from benchmarks.generated_landscapes import Best

_PERTURBATIONS = 2**17  # of 2^11 the error would be larger than that of a model that is sure of a smooth function


def _ring(rng, d):
    """A circular ridge in two variables, higher on one side; one hill along the others."""
    c, radius = rng.uniform(0.35, 0.65, d), rng.uniform(0.2, 0.35)
    side, width = rng.uniform(0, 6.28), rng.uniform(0.05, 0.09)

    def f(x):
        a, b = x[:, 0] - c[0], x[:, 1] - c[1]
        ridge = np.exp(-0.5 * ((np.hypot(a, b) - radius) / width) ** 2)
        height = 0.75 + 0.25 * np.cos(np.arctan2(b, a) - side)
        return ridge * height * np.exp(-2.0 * ((x[:, 2:] - c[2:]) ** 2).sum(axis=1))

    return f


def _plateau(rng, d):
    """Two flat tops on a plain, the narrow one higher."""
    c = rng.uniform(0.2, 0.8, (2, d))
    tops = [(1.0, c[0], 0.09 * d**0.7), (0.7, c[1], 0.2 * d**0.5)]

    def f(x):
        return np.max([h * expit((r - np.linalg.norm(x - at, axis=1)) / 0.01) for h, at, r in tops], axis=0)

    return f


def _clipped(rng, d):
    """A bowl upside down, cut off flat, with a cliff near its middle."""
    c, steep, normal = rng.uniform(0.3, 0.7, d), rng.uniform(0.5, 2.0, d), rng.standard_normal(d)
    normal /= np.linalg.norm(normal)
    threshold = normal @ c + rng.uniform(0.0, 0.08)

    def f(x):
        return np.minimum(1.0 - ((x - c) ** 2 * steep).sum(axis=1) * 4.0 / d, 0.85) - 1.5 * (x @ normal > threshold)

    return f


def _curved(rng, d):
    """A slope towards a round cliff, behind which there is nothing; the cliff may lie just outside the cube."""
    c = rng.uniform(-0.2, 0.3, d)
    radius = rng.uniform(0.6, 0.9) * d**0.5 * 0.8

    def f(x):
        t = np.linalg.norm(x - c, axis=1)
        return np.where(t < radius, (t / radius) ** 2 - 0.3 * (x[:, 0] - 0.5) ** 2, 0.0)

    return f


def _product(rng, d):
    """One smooth hill under wide noise."""
    c, width = rng.uniform(0.2, 0.8, d), rng.uniform(0.15, 0.4, d)
    return lambda x: np.exp(-0.5 * (((x - c) / width) ** 2).sum(axis=1))


def _banana(rng, d):
    """Rosenbrock's valley turned and upside down, on a logarithmic scale."""
    turn, c = ortho_group.rvs(d, random_state=rng), rng.uniform(0.4, 0.6, d)

    def f(x):
        z = ((x - c) @ turn) * 4.0
        return -np.log1p((30.0 * (z[:, 1:] - z[:, :-1] ** 2) ** 2 + (0.5 - z[:, :-1]) ** 2).sum(axis=1))

    return f


def _waves(rng, d):
    """A bowl upside down under waves that the noise averages out."""
    c, number, phase = rng.uniform(0.2, 0.8, d), rng.uniform(40.0, 70.0, d), rng.uniform(0, 6.28, d)
    return lambda x: -((x - c) ** 2).sum(axis=1) + 0.25 * np.sin(x * number + phase).mean(axis=1)


def _cells(rng, d):
    """Constant in each of 12 d cells."""
    count = 12 * d
    c, values = rng.random((count, d)), rng.random(count) ** 2
    return lambda x: values[((x[:, None] - c) ** 2).sum(axis=2).argmin(axis=1)]


def _skewed(rng, d):
    """Values over six orders of magnitude; the highest hill is narrow."""
    c, width, height = rng.uniform(0.2, 0.8, (3, d)), np.array([0.05, 0.2, 0.15]) * d**0.5, np.array([14, 12.5, 10.0])

    def f(x):
        logs = [h - 0.5 * (((x - at) / w) ** 2).sum(axis=1) for h, at, w in zip(height, c, width, strict=True)]
        return np.exp(np.max(logs, axis=0))

    return f


def _deceptive(rng, d):
    """A broad hill in one corner, a higher narrow one in the opposite one."""
    corner = rng.integers(0, 2, d).astype(float)
    broad, narrow = np.abs(corner - 0.25), np.abs(corner - 0.8)

    def f(x):
        wide = 0.8 * np.exp(-0.5 * (((x - broad) / 0.4) ** 2).sum(axis=1) / d**0.5)
        return wide + np.exp(-0.5 * (((x - narrow) / 0.13) ** 2).sum(axis=1) / d**0.7)

    return f


def _embedded(rng, d):
    """A hill and four needles in two of the variables; the others do nothing."""
    i, j = rng.permutation(d)[:2]
    c, needles = rng.uniform(0.2, 0.8, 2), rng.uniform(0.1, 0.9, (4, 2))

    def f(x):
        u = x[:, [i, j]]
        spikes = sum(0.9 * np.exp(-0.5 * (((u - at) / 0.02) ** 2).sum(axis=1)) for at in needles)
        return np.exp(-0.5 * (((u - c) / 0.15) ** 2).sum(axis=1)) + spikes

    return f


def _network(rng, d):
    """A neural network of sixteen neurons with random weights."""
    inner, shift = rng.standard_normal((16, d)) * 3.0, rng.uniform(-1.5, 1.5, 16) * d**0.5
    outer = rng.standard_normal(16)
    return lambda x: np.tanh((x - 0.5) @ inner.T * 1.5 + shift) @ outer / 4.0


def _weakest(rng, d):
    """The least of 3 d linear functions: a roof with edges."""
    normals = rng.standard_normal((3 * d, d))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    c, steep = rng.uniform(0.3, 0.7, d), rng.uniform(0.5, 3.0, 3 * d)
    return lambda x: np.min(-np.maximum((x - c) @ normals.T, -0.02) * steep, axis=1)


def _periodic(rng, d):
    """Hills in rows, higher towards one of them."""
    c, number = rng.uniform(0.2, 0.8, d), rng.uniform(2.5, 4.0, d)

    def f(x):
        hills = 0.5 + 0.5 * np.cos(2.0 * np.pi * number * (x - c))
        return np.prod(hills, axis=1) ** 0.5 - 0.5 * ((x - c) ** 2).sum(axis=1)

    return f


#: kind -> (what draws a function, fewest and most variables, deviation of the noise)
_DRAWN = {
    "ring": (_ring, 2, 4, 0.03),
    "plateau": (_plateau, 1, 4, 0.03),
    "clipped": (_clipped, 1, 6, 0.04),
    "curved": (_curved, 2, 6, 0.03),
    "product": (_product, 3, 8, 0.06),
    "banana": (_banana, 2, 5, 0.02),
    "waves": (_waves, 1, 5, 0.05),
    "cells": (_cells, 1, 3, 0.04),
    "skewed": (_skewed, 1, 5, 0.03),
    "deceptive": (_deceptive, 2, 5, 0.03),
    "embedded": (_embedded, 3, 8, 0.03),
    "network": (_network, 2, 6, 0.04),
    "weakest": (_weakest, 2, 7, 0.04),
    "periodic": (_periodic, 1, 4, 0.03),
}
KINDS = tuple(_DRAWN)


class Kind:
    """A function of one of the kinds, its noise, and its expectation under it; drawn by `of_kind`."""

    kind = "isotropic"

    def __init__(self, shape, function, dimension, deviation):
        self.shape, self._function, self.dimension = shape, function, dimension
        self.box, self.noise = sh.Box.unit(dimension), sh.InputNoise.unit(deviation)
        uniform = qmc.Sobol(dimension, rng=1).random(_PERTURBATIONS)
        self._offsets = deviation * ndtri(np.clip(uniform, 1e-12, 1.0 - 1e-12))

    def __call__(self, x):
        values = self._function(np.atleast_2d(x))
        return float(values[0]) if np.ndim(x) == 1 else values

    def expectation(self, x, perturbations=_PERTURBATIONS):
        """Return g (n,) at x (n, d), by the first of the perturbations."""
        offsets = self._offsets[:perturbations]
        return np.array([self._function(u + offsets).mean() for u in np.atleast_2d(x)])

    def best(self):
        """Return the best place by brute force: 2^13 points, the best ranked by ever more perturbations, and climbs."""
        d = self.dimension
        points = qmc.Sobol(d, rng=2).random_base2(13)
        values = self.expectation(points, 64)
        tops = points[np.argsort(-values)[:150]]
        tops = tops[np.argsort(-self.expectation(tops, 512))[:12]]
        found = np.array([self._climbed(u) for u in tops])
        outcomes = self.expectation(found)
        top = int(outcomes.argmax())
        return Best(found[top], float(outcomes[top]), float(outcomes[top] - values.mean()))

    def _climbed(self, start):
        d = self.dimension
        simplex = np.vstack([start, start + 0.03 * np.eye(d)])

        def lacking(u):
            beyond = np.maximum(np.abs(u - 0.5) - 0.5, 0.0).sum()
            return 100.0 * beyond - self.expectation(np.clip(u, 0.0, 1.0), 512)[0]

        settings = {"maxfev": 60 * d, "initial_simplex": simplex}
        return np.clip(minimize(lacking, start, method="Nelder-Mead", options=settings).x, 0.0, 1.0)


def of_kind(seed):
    """Return the function of a seed."""
    which, number = seed % len(KINDS), seed // len(KINDS)
    draw, fewest, most, deviation = _DRAWN[KINDS[which]]
    rng = np.random.default_rng([number, which, 7])
    d = int(rng.integers(fewest, most + 1))
    function = draw(rng, d)
    return Kind(KINDS[which], function, d, deviation * rng.uniform(0.7, 1.3) * (1.0 if d < 3 else d**0.25))

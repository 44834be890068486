"""
Noise with a direction
======================

An arm that strays along one diagonal may stand on a ridge along it, not on one across.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh


def ridges(x):
    """Return a ridge along each diagonal; the one that falls is a little higher."""
    a, b = x[..., 0], x[..., 1]
    falling = 1.1 * np.exp(-(((a + b - 0.6) / 0.08) ** 2) - ((a - b) / 0.9) ** 2)
    rising = np.exp(-(((a - b - 0.4) / 0.08) ** 2) - ((a + b - 1.2) / 0.9) ** 2)
    return np.maximum(falling, rising)


box = sh.Box({"a": (0.0, 1.0), "b": (0.0, 1.0)})
noise = sh.InputNoise(covariance=[[0.0036, 0.0034], [0.0034, 0.0036]])
result = sh.maximize(lambda x: float(ridges(x)), box, n_trials=45, input_noise=noise, seed=0)
strays = np.random.default_rng(0).multivariate_normal(
    result.recommendation.x, [[0.0036, 0.0034], [0.0034, 0.0036]], 200
)

axis = np.linspace(0.0, 1.0, 100)
grid = np.stack(np.meshgrid(axis, axis), axis=-1)
figure, axes = plt.subplots(figsize=(5, 4.4))
axes.contourf(axis, axis, ridges(grid), levels=20)
axes.plot(*strays.T, ".", color="w", markersize=3)
axes.plot(*result.recommendation.x, "*", color="C1", markersize=15)
axes.set(xlabel="a", ylabel="b", xlim=(0, 1), ylim=(0, 1))
figure.tight_layout()

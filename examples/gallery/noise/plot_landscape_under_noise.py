"""
A landscape, hit exactly and under noise
========================================

The mixture of Gaussians of the published experiments has its highest peak where it is narrowest. Averaged over an input
noise of a tenth of each range, another peak is the highest, and that is where the trials gather.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

function, noise = sh.problems.GM(), sh.InputNoise.unit(0.1)
result = sh.maximize(function, function.box, n_trials=50, input_noise=noise, seed=0)

axis = np.linspace(0.0, 1.0, 60)
points = function.box.from_unit(np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2))
smooth = sum(
    function(points + shift) for shift in np.random.default_rng(0).normal(0.0, 0.1, (200, 2)) * function.box.widths
)
figure, panels = plt.subplots(1, 2, figsize=(8, 3.8), sharey=True)
for panel, values, title in zip(
    panels, (function(points), smooth / 200), ("hit exactly", "mean under the noise"), strict=True
):
    panel.tricontourf(*points.T, values, levels=20)
    panel.plot(*result.X.T, "o", color="w", markersize=3)
    panel.plot(*result.recommendation.x, "*", color="C1", markersize=14)
    panel.set(title=title, xlabel=function.box.names[0])
panels[0].set_ylabel(function.box.names[1])
figure.tight_layout()

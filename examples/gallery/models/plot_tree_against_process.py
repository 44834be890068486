"""
A tree of processes against one process
=======================================

One length scale cannot be right on both sides of this function: what the right side needs makes the left one unsure and
rough. The treed process cuts the range and learns one on each side. On the right side both know little from 40 trials;
with 60 and more their errors there are about equal, and on the left the tree stays far surer.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

rng = np.random.default_rng(0)
f = lambda x: np.where(x < 0.5, np.sin(2 * np.pi * x), np.sin(30 * np.pi * x) * 0.5)
X = np.sort(rng.random((40, 1)), axis=0)
x = np.linspace(0.0, 1.0, 400)
figure, panels = plt.subplots(2, 1, figsize=(7, 4.6), sharex=True, sharey=True)
for panel, model, name in zip(
    panels, (sh.GaussianProcess(), sh.TreedGaussianProcess()), ("one process", "treed"), strict=True
):
    model.fit(X, f(X[:, 0]))
    mean, std = model.predict(x[:, None], return_std=True)
    smooth, rough = (np.sqrt(np.mean((mean - f(x))[side] ** 2)) for side in (x < 0.5, x >= 0.5))
    panel.plot(x, f(x), color="0.6")
    panel.plot(x, mean, color="C0")
    panel.fill_between(x, mean - 2 * std, mean + 2 * std, color="C0", alpha=0.2)
    panel.plot(X[:, 0], f(X[:, 0]), ".", color="k", markersize=4)
    panel.set_title(f"{name}: error {smooth:.3f} on the smooth side, {rough:.3f} on the rough one", fontsize=11)
figure.tight_layout()

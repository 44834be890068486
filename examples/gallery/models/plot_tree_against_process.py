"""
A tree of processes against one process
=======================================

One length scale cannot be right on both sides of this function. The treed process cuts the range and learns one on each
side.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

rng = np.random.default_rng(0)
f = lambda x: np.where(x < 0.5, np.sin(2 * np.pi * x), np.sin(30 * np.pi * x) * 0.5)
X = np.sort(rng.random((60, 1)), axis=0)
x = np.linspace(0.0, 1.0, 400)
figure, panels = plt.subplots(2, 1, figsize=(7, 4.6), sharex=True, sharey=True)
for panel, model, name in zip(
    panels, (sh.GaussianProcess(), sh.TreedGaussianProcess()), ("one process", "treed"), strict=True
):
    model.fit(X, f(X[:, 0]))
    mean, std = model.predict(x[:, None], return_std=True)
    error = np.sqrt(np.mean((mean - f(x)) ** 2))
    panel.plot(x, f(x), color="0.6")
    panel.plot(x, mean, color="C0")
    panel.fill_between(x, mean - 2 * std, mean + 2 * std, color="C0", alpha=0.2)
    panel.plot(X[:, 0], f(X[:, 0]), ".", color="k", markersize=4)
    panel.set_title(f"{name}: error {error:.3f}")
figure.tight_layout()

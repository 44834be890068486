"""
Trials that give nothing
========================

A trial may fail without a value. It is told as failed; the model avoids the place and goes on. Crosses are failures.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

box = sh.Box({"dx": (-0.05, 0.05), "dy": (-0.03, 0.03)})
optimizer = sh.Optimizer(box, input_noise=sh.InputNoise.unit(0.03), seed=0)
for _ in range(35):
    x = optimizer.ask()
    if np.hypot(x[0] + 0.01, x[1]) > 0.03:  # out of reach
        optimizer.tell(x, failed=True)
    else:
        optimizer.tell(x, 1.0 - 30.0 * abs(x[0] - 0.01) - 20.0 * abs(x[1]))
best = optimizer.recommend()

failed = np.isnan(optimizer.y)
figure, axes = plt.subplots(figsize=(6, 3.8))
shown = axes.scatter(*(1000 * optimizer.X[~failed]).T, c=optimizer.y[~failed])
axes.plot(*(1000 * optimizer.X[failed]).T, "x", color="0.4")
axes.plot(*(1000 * best.x), "*", color="C1", markersize=15)
axes.set(xlabel="dx [mm]", ylabel="dy [mm]")
figure.colorbar(shown, label="value")
figure.tight_layout()

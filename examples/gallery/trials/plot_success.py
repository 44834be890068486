"""
Held or dropped
===============

Each trial only succeeds or fails, by chance with a probability that nobody sees. It is found from yes and no alone; the
answer keeps away from the edge on the right, where a small error drops the grasp.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh


def held(x):  # true probability to hold: rises to the right, and ends at an edge
    return 0.98 * (x < 0.8) / (1.0 + np.exp(-(x - 0.4) / 0.05))


rng = np.random.default_rng(0)
box = sh.Box({"x": (0.0, 1.0)})
optimizer = sh.Optimizer(box, outcome="success", input_noise=sh.InputNoise.unit(0.04), seed=0)
for _ in range(40):
    x = optimizer.ask()
    optimizer.tell(x, success=bool(rng.random() < held(x[0])))
best = optimizer.recommend()

line = np.linspace(0.0, 1.0, 400)
mean, spread = optimizer.predict(line[:, None])
figure, axes = plt.subplots(figsize=(7, 3.6))
axes.plot(line, held(line), color="0.6", label="true probability")
axes.plot(line, mean, color="C0", label="predicted")
axes.fill_between(line, np.clip(mean - spread, 0, 1), np.clip(mean + spread, 0, 1), color="C0", alpha=0.2)
axes.plot(optimizer.X[:, 0], optimizer.y, "|", color="k", markersize=12, label="trials")
axes.axvline(best.x[0], color="C1", linestyle="--", label=f"recommended: {best.x[0]:.2f}")
axes.set(xlabel="x", ylabel="probability to hold")
axes.legend(loc="center left")
figure.tight_layout()

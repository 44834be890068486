"""
A tolerance instead of a deviation
==================================

A part that passed inspection lies anywhere within its tolerance, and nowhere else. Bounded noise has no tails, so that
the answer may stand nearer to an edge.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

f = lambda x: float(x[0] if x[0] < 0.7 else -1.0)
box = sh.Box({"x": (0.0, 1.0)})
figure, axes = plt.subplots(figsize=(7, 3.4))
x = np.linspace(0.0, 1.0, 400)
axes.plot(x, [f([one]) for one in x], color="0.5")
for noise, color, name in (
    (sh.InputNoise.uniform({"x": 0.05}), "C0", "within 0.05"),
    (sh.InputNoise({"x": 0.05}), "C1", "standard deviation 0.05"),
):
    best = sh.maximize(f, box, n_trials=30, input_noise=noise, seed=0).recommendation
    axes.axvline(best.x[0], color=color, linestyle="--", label=f"{name}: x = {best.x[0]:.2f}")
axes.set(xlabel="x", ylabel="value")
axes.legend()
figure.tight_layout()

"""
A cliff
=======

The nearer to the edge, the better, and beyond it all is lost. How far to stay away is a question of the noise.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh


def cliff(x):
    """Rise slowly up to 0.6, then fall to nothing."""
    return float(x[0]) if x[0] < 0.6 else 0.0


box = sh.Box({"x": (0.0, 1.0)})
x = np.linspace(0.0, 1.0, 400)
figure, axes = plt.subplots(figsize=(7, 3.4))
axes.plot(x, [cliff([one]) for one in x], color="0.5", label="hit exactly")
for share, color in ((0.01, "C0"), (0.03, "C2"), (0.08, "C1")):
    noise = sh.InputNoise.unit(share)
    best = sh.maximize(cliff, box, n_trials=30, input_noise=noise, seed=1).recommendation
    axes.axvline(best.x[0], color=color, linestyle="--", label=f"noise {share}: x = {best.x[0]:.2f}")
axes.set(xlabel="x", ylabel="value")
axes.legend()
figure.tight_layout()

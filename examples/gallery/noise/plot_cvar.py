"""
Mean or bad cases: conditional value at risk
============================================

The left hill is higher in the mean; a ditch in it makes one case in ten bad. CVaR looks at the bad tenth only.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh


def hills(x):
    """Return a high hill with a ditch at its side, and a lower one without."""
    a = x[0]
    ditch = -1.2 * np.exp(-0.5 * ((a - 0.37) / 0.012) ** 2)
    return float(np.exp(-0.5 * ((a - 0.3) / 0.1) ** 2) + ditch + 0.8 * np.exp(-0.5 * ((a - 0.75) / 0.12) ** 2))


box, noise = sh.Box({"x": (0.0, 1.0)}), sh.InputNoise.unit(0.04)
x = np.linspace(0.0, 1.0, 500)
figure, axes = plt.subplots(figsize=(7, 3.4))
axes.plot(x, [hills([one]) for one in x], color="0.5")
for risk, color in (("mean", "C0"), (sh.Risk("cvar", alpha=0.1), "C1")):
    best = sh.maximize(hills, box, n_trials=40, input_noise=noise, risk=risk, seed=0).recommendation
    score = sh.problems.robust_score(sh.problems.Function(hills, box), best.x, noise, n=500, seed=0)
    name = risk if isinstance(risk, str) else risk.name
    axes.axvline(
        best.x[0], color=color, linestyle="--", label=f"{name}: mean {score.mean:.2f}, worst {score.worst:.2f}"
    )
axes.set(xlabel="x", ylabel="value")
axes.legend()
figure.tight_layout()

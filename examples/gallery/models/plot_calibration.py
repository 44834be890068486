"""
Do the predictions hold?
========================

Of a well calibrated model half the values lie below the median, and nine tenths below the 90 % quantile. A curve that
is steeper than the diagonal in the middle is of a model that is too careful, a flatter one of a model that is too sure.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm

import surehold as sh

levels = np.linspace(0.05, 0.95, 19)
below = np.zeros_like(levels)
rng = np.random.default_rng(0)
n = 0
for _ in range(6):
    X = rng.random((25, 2))
    phase = rng.random(2) * 6
    f = lambda x, phase=phase: np.sin(5 * x[:, 0] + phase[0]) * np.cos(4 * x[:, 1] + phase[1])
    model = sh.GaussianProcess().fit(X, f(X))
    test = rng.random((80, 2))
    mean, std = model.predict(test, return_std=True)
    score = norm.cdf((f(test) - mean) / std)
    below += (score[:, None] < levels).sum(axis=0)
    n += len(test)
figure, axes = plt.subplots(figsize=(4.4, 4.2))
axes.plot([0, 1], [0, 1], color="0.6")
axes.plot(levels, below / n, "o-")
axes.set(xlabel="level", ylabel="share of values below the quantile", aspect="equal")
figure.tight_layout()

"""
A needle that the noise removes
===============================

The highest value of this function of a reproducing kernel Hilbert space stands on a needle. Plain Bayesian optimization
finds it; told of the input noise, the optimizer prefers the broad hill.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

function = sh.problems.RKHS()
noise = sh.InputNoise.unit(0.03)
robust = sh.maximize(function, function.box, n_trials=40, input_noise=noise, seed=0).recommendation
plain = sh.maximize(function, function.box, n_trials=40, seed=0).recommendation

x = np.linspace(0.0, 1.0, 800)
held = [sh.problems.robust_score(function, [one], noise, n=200, seed=0).mean for one in x[::8]]
figure, axes = plt.subplots(figsize=(7, 3.6))
axes.plot(x, function(x[:, None]), color="0.6", label="hit exactly")
axes.plot(x[::8], held, color="C0", label="mean under the noise")
for answer, color, name in ((plain, "C1", "plain"), (robust, "C0", "robust")):
    axes.axvline(answer.x[0], color=color, linestyle="--", label=f"{name}: x = {answer.x[0]:.3f}")
axes.set(xlabel="x", ylabel="value")
axes.legend()
figure.tight_layout()

"""
Many variables
==============

In eight variables and sixty trials most of the box stays unknown. The trust region searches near the best trial.
On a smooth bowl both ways find it.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

box = sh.Box.unit(8)
goal = np.random.default_rng(0).uniform(0.2, 0.8, 8)
f = lambda x: -float(np.sum((x - goal) ** 2))
figure, axes = plt.subplots(figsize=(7, 3.4))
for trust_region, name in ((False, "everywhere"), (True, "trust region")):
    result = sh.maximize(f, box, n_trials=60, n_initial=24, trust_region=trust_region, seed=0)
    axes.plot(np.maximum.accumulate(result.y), label=name)
axes.set(xlabel="trial", ylabel="highest value so far")
axes.legend()
figure.tight_layout()

"""
Numbers, logarithms and choices
===============================

A force over two decades and two types of grip; lower is better.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

box = sh.Box({"force": (0.1, 10.0, "log"), "grip": ["pinch", "power"]})
optimizer = sh.Optimizer(box, direction="minimize", seed=0)
made = []
for _ in range(25):
    trial = optimizer.ask_trial()
    force, grip = trial.parameters["force"], trial.parameters["grip"]
    cost = (np.log10(force) - (0.3 if grip == "power" else -0.4)) ** 2 + (0.2 if grip == "pinch" else 0.0)
    optimizer.tell(trial, cost)
    made.append((force, grip, cost))
best = box.as_dict(optimizer.recommend().x)

figure, axes = plt.subplots(figsize=(6, 3.4))
for grip in ("pinch", "power"):
    axes.semilogx(*zip(*[(f, c) for f, g, c in made if g == grip], strict=True), "o", label=grip)
axes.axvline(best["force"], color="k", linestyle="--", label=f"{best['grip']} with {best['force']:.2f}")
axes.set(xlabel="force", ylabel="cost")
axes.legend()
figure.tight_layout()

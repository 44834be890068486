"""
A limit of a further output
===========================

The harder it presses the better it holds, and the force must stay below 0.5. The answer keeps a margin for the noise.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

box = sh.Box({"press": (0.0, 1.0)})
x = np.linspace(0.0, 1.0, 200)
figure, axes = plt.subplots(figsize=(7, 3.4))
axes.plot(x, x, color="0.5", label="value")
axes.plot(x, 0.7 * x**1.5 + 0.05, color="0.2", linestyle=":", label="force")
axes.axhline(0.5, color="C3", linewidth=1)
for share, color in ((0.01, "C0"), (0.06, "C2")):
    noise = sh.InputNoise.unit(share)
    optimizer = sh.Optimizer(box, input_noise=noise, constraints={"force": (None, 0.5)}, seed=0)
    for _ in range(20):
        (press,) = optimizer.ask()
        optimizer.tell([press], press, constraints={"force": 0.7 * press**1.5 + 0.05})
    answer = optimizer.recommend().x[0]
    axes.axvline(answer, color=color, linestyle="--", label=f"noise {share}: press = {answer:.2f}")
axes.set(xlabel="press", ylabel="value, force")
axes.legend()
figure.tight_layout()

"""
Trials that stray
=================

Real trials do not reach what is commanded. Told where they went, the model learns from there; told only that they
stray, it trusts them less where the function is steep.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

f = lambda x: float(np.exp(-0.5 * ((x - 0.3) / 0.02) ** 2) + 0.8 * np.exp(-0.5 * ((x - 0.7) / 0.12) ** 2))
box, noise = sh.Box({"x": (0.0, 1.0)}), sh.InputNoise.unit(0.04)
x = np.linspace(0.0, 1.0, 300)
figure, panels = plt.subplots(1, 2, figsize=(8, 3.4), sharey=True)
for panel, told in zip(panels, (True, False), strict=True):
    rng = np.random.default_rng(1)
    optimizer = sh.Optimizer(box, input_noise=noise, noise_while_exploring=True, seed=0)
    for _ in range(30):
        asked = optimizer.ask()
        reached = asked + rng.normal(0.0, 0.04, 1)
        optimizer.tell(asked, f(reached[0]), reached=reached if told else None)
    mean, std = optimizer.predict(x[:, None])
    panel.plot(x, [f(one) for one in x], color="0.6")
    panel.plot(x, mean)
    panel.fill_between(x, mean - 2 * std, mean + 2 * std, alpha=0.2)
    panel.plot(optimizer.reached[:, 0], optimizer.y, ".k")
    panel.axvline(optimizer.recommend().x[0], color="C1", linestyle="--")
    panel.set(xlabel="x", title="reached inputs told" if told else "not told")
figure.tight_layout()

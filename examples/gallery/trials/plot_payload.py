"""
A payload that nobody sets
==========================

The heavier the load, the harder it must be gripped, and what is light breaks. The dashed line is the best for the mean
payload, the star the answer: the best on average over the payloads that were measured.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

payloads = np.random.default_rng(0).gamma(2.0, 0.12, 200).clip(0.02, 1.0)
box = sh.Box({"grip": (0.0, 1.0), "payload": (0.0, 1.0)}, uncontrolled={"payload": payloads})


def held(grip, payload):
    return np.where(grip > payload, 1.0 - 0.5 * (grip - payload), 1.0 - 4.0 * (payload - grip))


optimizer = sh.Optimizer(box, seed=0)
for _ in range(35):
    x = optimizer.ask()  # a simulator: the payload of each trial is chosen, too
    optimizer.tell(x, float(held(*x)))
answer = optimizer.recommend("box").x[0]

grips = np.linspace(0.0, 1.0, 200)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4))
shown = left.scatter(*optimizer.X.T, c=optimizer.y)
left.set(xlabel="grip", ylabel="payload", title="trials")
figure.colorbar(shown, label="value")
average = held(grips[:, None], payloads).mean(axis=1)
right.plot(grips, average, color="0.4", label="average over payloads")
right.axvline(payloads.mean(), color="0.6", linestyle="--", label="best for the mean payload")
right.plot(answer, np.interp(answer, grips, average), "*", color="C1", markersize=15, label="answer")
right.set(xlabel="grip", ylabel="value")
right.legend()
figure.tight_layout()

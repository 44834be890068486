"""
Sigma points and quasi-Monte Carlo points
=========================================

Five weighted points carry mean and covariance of a noise; its tails and its shape need more.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

covariance = np.array([[0.0009, 0.0006], [0.0006, 0.0016]])
offsets, weights = sh.sigma_points(covariance, k=1.0)
draws = np.random.default_rng(0).multivariate_normal([0.0, 0.0], covariance, 1500)
figure, axes = plt.subplots(figsize=(5, 4.2))
axes.plot(*draws.T, ".", color="0.75", markersize=3)
axes.scatter(*offsets.T, s=600 * weights, color="C1", zorder=3)
axes.set(xlabel="dx", ylabel="dy", aspect="equal")
figure.tight_layout()

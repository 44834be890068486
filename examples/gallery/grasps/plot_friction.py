"""
Quality and friction
====================

Three contacts around a disk. Below a certain friction no force closes the grasp; above it the weakest push that is
resisted grows. The round cone is bracketed by polyhedral ones with more and more edges.
"""

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh

angles = 2.0 * np.pi * np.arange(3) / 3.0
points = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
friction = np.linspace(0.05, 1.0, 20)
figure, axes = plt.subplots(figsize=(6, 3.6))
for edges in (4, 8, 32):
    quality = [sh.grasping.wrench_quality(points, -points, friction=mu, edges=edges).epsilon for mu in friction]
    axes.plot(friction, quality, label=f"{edges} edges")
axes.set(xlabel="coefficient of friction", ylabel="epsilon")
axes.legend()
figure.tight_layout()

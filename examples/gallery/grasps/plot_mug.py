"""
A grasp of the mug
==================

The iCub's left hand closes on the mug. Along the fingers the quality rises to an edge where the open
hand runs into the mug: the place not to be.
"""

import io

import matplotlib.pyplot as plt
import numpy as np

import surehold as sh
from surehold.reports.scene import drawn_scene
from surehold.reports.still import still_picture

problem = sh.problems.GraspProblem("mug", variables=("dx", "dy"))
dx = np.linspace(-0.075, -0.03, 46)
quality = [problem.grasp([one, 0.0086]).quality for one in dx]
grasp = problem.grasp([-0.0498, 0.0086])
picture, _ = still_picture(drawn_scene(sh.grasping.grasp_scene(problem.simulator, grasp)))

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6))
left.plot(1000 * dx, quality)
left.axvline(-49.8, color="C1", linestyle="--")
left.set(xlabel="dx [mm]", ylabel="quality (epsilon)")
right.imshow(plt.imread(io.BytesIO(picture)))
right.set_axis_off()
figure.tight_layout()

"""
Types of grasp
==============

One hand, three preshapes: power, tripod and pinch, closed on the glass at the default pose.
"""

import io

import matplotlib.pyplot as plt

import surehold as sh
from surehold.reports.gather import drawn_scene
from surehold.reports.still import still_picture

figure, panels = plt.subplots(1, 3, figsize=(9, 2.8))
for panel, preshape in zip(panels, ("power", "tripod", "pinch"), strict=True):
    problem = sh.problems.GraspProblem("glass", "right-front", ("dx", "dy"), preshape=preshape)
    grasp = problem.grasp([0.0, 0.0])
    picture, _ = still_picture(drawn_scene(sh.grasping.grasp_scene(problem.simulator, grasp)))
    panel.imshow(plt.imread(io.BytesIO(picture)))
    panel.set_title(f"{preshape}: {grasp.quality:.3f}")
    panel.set_axis_off()
figure.tight_layout()

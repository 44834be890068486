"""
Types of grasp
==============

One hand, three preshapes: power, tripod and pinch, closed on the drill at the default pose. The power
grasp resists more than four times what those of fewer fingers do.
"""

import io

import matplotlib.pyplot as plt

import surehold as sh
from surehold.reports.scene import drawn_scene
from surehold.reports.still import still_picture

figure, panels = plt.subplots(1, 3, figsize=(9, 3))
for panel, preshape in zip(panels, ("power", "tripod", "pinch"), strict=True):
    problem = sh.problems.GraspProblem("drill", "front-right", ("dx", "dy"), preshape=preshape)
    grasp = problem.grasp([0.0, 0.0])
    picture, _ = still_picture(drawn_scene(sh.grasping.grasp_scene(problem.simulator, grasp)))
    panel.imshow(plt.imread(io.BytesIO(picture)))
    panel.set_title(f"{preshape}, {grasp.status}: quality {grasp.quality:.3f}", fontsize=11)
    panel.set_axis_off()
figure.tight_layout()

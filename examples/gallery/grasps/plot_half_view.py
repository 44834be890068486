"""
Half a mug
==========

A camera sees one side of a mug. What is believed of the rest is colored by how far it may be off.
"""

import io

import matplotlib.pyplot as plt
import numpy as np

from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.shape.completion import belief_of_cloud
from surehold.grasping.shape.point_cloud import cleaned
from surehold.grasping.shape.views import camera_towards, half_view
from surehold.reports.run_report import Scene
from surehold.reports.still import still_picture
from surehold.reports.uncertain_shape import LEGEND, shape_meshes

mug = shipped_object("mug")
camera = camera_towards(mug, azimuth=0.6, elevation=0.3)
points = half_view(mug, camera, 800, 0.001, np.random.default_rng(0))
belief = belief_of_cloud(cleaned(points, camera=camera), cell=0.004)
mean = belief.mean_object()
deviation = belief.surface.deviation(mean.vertices)
picture, _ = still_picture(Scene(shape_meshes(mean.vertices, mean.faces, deviation)))

figure, axes = plt.subplots(figsize=(6, 4.8))
axes.imshow(plt.imread(io.BytesIO(picture)))
axes.set_title(LEGEND, fontsize=7)
axes.set_axis_off()
figure.tight_layout()

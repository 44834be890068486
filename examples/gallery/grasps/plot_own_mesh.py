"""
A mesh of your own
==================

Any STL, OBJ, PLY or glTF becomes an object: here a box with a hole, written and read again.
"""

import io
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import trimesh

import surehold as sh
from surehold.grasping.object.mesh_files import load_mesh
from surehold.reports.scene import drawn_scene
from surehold.reports.still import still_picture

solid = trimesh.boolean.difference(
    [trimesh.creation.box((0.04, 0.04, 0.07)), trimesh.creation.cylinder(radius=0.012, height=0.2)]
)
with TemporaryDirectory() as folder:
    solid.export(Path(folder, "part.stl"))
    loaded = load_mesh(Path(folder, "part.stl"), unit="m", mass=0.4)
problem = sh.problems.GraspProblem(loaded.object, "right-front", ("dx", "dy"))
best = max((problem.grasp([a, b]) for a in (-0.03, 0.0, 0.03) for b in (-0.02, 0.0, 0.02)), key=lambda g: g.quality)
picture, _ = still_picture(drawn_scene(sh.grasping.grasp_scene(problem.simulator, best)))

figure, axes = plt.subplots(figsize=(6, 4.4))
axes.imshow(plt.imread(io.BytesIO(picture)))
axes.set_title(f"quality {best.quality:.3f}, {len(best.contacts)} contacts")
axes.set_axis_off()
figure.tight_layout()

"""What reading a mesh takes: `python -m benchmarks.mesh_loading [NAME ...]`.

A ball of 80 mm from 20 faces whose triangles are cut into four again and again, as STL, OBJ, PLY and GLB, and a scan of
the mug: its triangles cut likewise and its vertices moved by .03 mm (standard deviation), as OBJ. Each is read and
mended, its distances are computed, and the default pose is searched, in a process of its own with an empty cache:
printed are CPU seconds (on up to two threads where a library uses them) and the most memory [MB]. Compiling is not
counted.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.arguments import chosen
from surehold.grasping.object.shipped import shipped_object

#: name -> (what, times that triangles are cut into four, ending)
MESHES = {
    "ball STL": ("ball", 7, "stl"),
    "ball OBJ": ("ball", 7, "obj"),
    "ball PLY": ("ball", 7, "ply"),
    "ball GLB": ("ball", 7, "glb"),
    "ball OBJ, large": ("ball", 8, "obj"),
    "mug OBJ": ("mug", 2, "obj"),
}


def mesh(what, times):
    if what == "ball":
        return trimesh.creation.icosphere(times, 0.04)
    obj = shipped_object(what)
    found = trimesh.Trimesh(obj.vertices, obj.faces, process=False)
    for _ in range(times):
        found = found.subdivide()
    found.vertices += 3e-5 * np.random.default_rng(0).standard_normal(found.vertices.shape)
    return found


def read(file):
    """Print CPU seconds and MB of reading a file to the problem of grasping it."""
    from surehold.grasping.object.mesh_files import load_mesh
    from surehold.problems import GraspProblem

    GraspProblem("mug").warm_up()
    started = time.process_time()
    GraspProblem(load_mesh(file, unit="m").object, variables=("dx", "dy"))
    print(time.process_time() - started, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)


def main():
    if sys.argv[1:2] == ["--read"]:
        read(Path(sys.argv[2]))
        return
    print(f"{'mesh':18}{'triangles':>12}{'CPU s':>8}{'MB':>8}")
    for name in chosen(__doc__, MESHES, MESHES, "mesh"):
        what, times, ending = MESHES[name]
        made = mesh(what, times)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"{what}.{ending}"
            made.export(file)
            told = subprocess.run(
                [sys.executable, "-m", "benchmarks.mesh_loading", "--read", str(file)],
                env=os.environ | {"SUREHOLD_CACHE": folder},
                capture_output=True,
                text=True,
                check=True,
            )
        seconds, most = map(float, told.stdout.split()[-2:])
        print(f"{name:18}{len(made.faces):12,}{seconds:8.1f}{most:8.0f}", flush=True)


if __name__ == "__main__":
    main()

"""The readers of files, given damaged ones: bytes changed, left out, repeated, numbers replaced by strange ones."""

import json
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

import surehold as sh
from benchmarks.fuzz.findings import Findings
from surehold.campaigns.plan_file import load_plan
from surehold.grasping.formats import StoredGrasp, read_isaac_grasps, write_isaac_grasps
from surehold.grasping.hand.files import load_hand
from surehold.grasping.object.mesh_files import load_mesh
from surehold.grasping.shape.cloud_files import read_cloud
from surehold.studies.robot import RobotStudy
from surehold.studies.search_space import SearchSpace
from surehold.studies.settings import StudySettings
from surehold.studies.warm_start import trials_of_csv

NUMBERS = [b"nan", b"inf", b"1e999", b"-1", b"0", b"9" * 400, b"1e308", b"[]", b"null", b"", b"99999999999", b"*"]
HAND = """<mujoco><worldbody><body name="palm"><geom type="box" size=".02 .04 .01" pos="0 0 -.01"/>
<body name="a" pos="-.03 0 0"><joint name="a1" axis="0 1 0" range="-20 90"/>
<geom type="capsule" fromto="0 0 .01 0 0 .04" size=".008"/></body>
<body name="c" pos=".03 0 0"><joint name="c1" axis="0 -1 0" range="-20 90"/>
<geom type="capsule" fromto="0 0 .01 0 0 .06" size=".008"/></body></body></worldbody></mujoco>"""
CONFIG = {
    "name": "two",
    "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
    "fingers": {"left": ["a1"], "right": ["c1"]},
    "preshapes": {"close": {"closed": {"a1": 1.2, "c1": 1.0}}},
}
PLAN = """title: small
problems: {gm: {function: gm, trials: 20, initial: 5}}
methods: {plain: {criterion: ei}, robust: {criterion: robust_ei}}
runs: 2
"""

Reader = Callable[[Path], Any]


def readers(folder: Path) -> list[tuple[str, bytes, Reader]]:
    """Return (name of the file, its sound content, what reads it); they are made in `folder`."""
    solid = trimesh.creation.icosphere(subdivisions=1, radius=30.0)
    cloud = np.random.default_rng(0).normal(size=(40, 3))
    found: list[tuple[str, bytes, Reader]] = []
    for kind in ("stl", "stl_ascii", "obj", "ply", "glb"):
        content = solid.export(file_type=kind)
        found.append((f"solid.{kind[:3]}", _bytes(content), lambda path: load_mesh(path, unit="mm")))
    found.append(("scan.ply", _bytes(trimesh.PointCloud(cloud).export(file_type="ply")), read_cloud))
    rows = "\n".join(" ".join(f"{v:.4f}" for v in row) for row in cloud)
    found.append(("scan.xyz", rows.encode(), read_cloud))
    head = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 40\nHEIGHT 1\nPOINTS 40\nDATA ascii\n"
    found.append(("scan.pcd", (head + rows).encode(), read_cloud))
    np.savez(folder / "scan.npz", points=cloud)
    found.append(("scan.npz", (folder / "scan.npz").read_bytes(), read_cloud))
    (folder / "model.xml").write_text(HAND)
    (folder / "model.yaml").write_text(yaml.safe_dump(CONFIG))
    found.append(("hand.xml", HAND.encode(), lambda path: load_hand(path, folder / "model.yaml")))
    found.append(("hand.yaml", yaml.safe_dump(CONFIG).encode(), lambda path: load_hand(folder / "model.xml", path)))
    found.append(("plan.yaml", PLAN.encode(), lambda path: load_plan(str(path))))
    optimizer = sh.Optimizer(sh.Box({"x": (0.0, 1.0)}), input_noise=sh.InputNoise.unit(0.05), constraints={"t": (0, 1)})
    for value in (0.2, 0.7):
        optimizer.tell(optimizer.ask(), value, constraints={"t": value})
    optimizer.save(folder / "run.json")
    found.append(("run.json", (folder / "run.json").read_bytes(), lambda path: sh.Optimizer.load(path).ask()))
    grasp = StoredGrasp("g", 0.5, (0.0, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0), {"a": 0.1}, {"a": 0.2})
    write_isaac_grasps(folder / "grasps.yaml", [grasp], "object", "hand")
    found.append(("grasps.yaml", (folder / "grasps.yaml").read_bytes(), read_isaac_grasps))
    table = b"x,value,state\n0.1,0.5,ok\n0.2,,\n0.3,0.7,ok\n"
    found.append(("former.csv", table, lambda path: trials_of_csv(str(path), {"x": "x"})))
    return [*found, ("journal.log", _journal(folder), _opened)]


def _bytes(exported: Any) -> bytes:
    return exported.encode() if isinstance(exported, str) else bytes(exported)


def _journal(folder: Path) -> bytes:
    path = folder / "sound.log"
    study = RobotStudy.create("rig", StudySettings(SearchSpace({"x": (0.0, 1.0)}), None), str(path))
    for value in (0.1, 0.4):
        study.tell(study.ask().id, value)
    study.close()
    return path.read_bytes()


def _opened(path: Path) -> None:
    study = RobotStudy.open("rig", str(path))
    try:
        study.tell(study.ask().id, 0.3)
    finally:
        study.close()


def damaged(content: bytes, draw: random.Random) -> bytes:
    """Return the content with one to four changes."""
    for _ in range(draw.randint(1, 4)):
        kind, n = draw.randrange(7), len(content)
        a, b = sorted(draw.randrange(n + 1) for _ in range(2)) if n else (0, 0)
        if kind == 0 and n:
            content = content[:a] + bytes([draw.randrange(256)]) + content[a + 1 :]
        elif kind == 1:
            content = content[:a] + content[min(b, a + 40) :]
        elif kind == 2:
            content = content[:a]
        elif kind == 3:
            content = content[:b] + content[a : min(b, a + 200)] + content[b:]
        elif kind == 4:
            content = content[:a] + draw.randbytes(draw.randint(1, 8)) + content[a:]
        else:
            found = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?", content))
            if found:
                hit = draw.choice(found)
                content = content[: hit.start()] + draw.choice(NUMBERS) + content[hit.end() :]
    return content


def read(draw: random.Random, findings: Findings, folder: Path, known: list[tuple[str, bytes, Reader]]) -> None:
    """Read one damaged file."""
    name, content, reader = draw.choice(known)
    path = folder / f"damaged-{name}"
    data = damaged(content, draw)
    path.write_bytes(data)
    findings.attempt(f"{name}: {json.dumps(data[:400].decode('latin-1'))}", lambda: reader(path))

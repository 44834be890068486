import numpy as np
import pytest
import trimesh

import surehold as sh
from surehold.problems import GM, RKHS, robust_score
from surehold.reports import gather
from surehold.reports.run_report import ContactSet, ObjectBox, Scene, SceneMesh


def judged(problem, noise, n, seed, extra=()):
    """A plain run's trials and some more points, all told to an optimizer that knows the noise: a real result."""
    plain = sh.maximize(problem, problem.box, n, n_initial=8, seed=seed)
    optimizer = sh.Optimizer(problem.box, input_noise=noise, n_initial=8, seed=seed)
    trials = []
    for k, x in enumerate([*plain.X, *extra]):
        optimizer.tell(x, problem(x))
        best = float(np.nanmax(optimizer.y))
        trials.append(sh.Trial(k, x, problem(x), "", best, optimizer.recommend() if k >= 8 else None, 0.0))
    return sh.Result(optimizer, tuple(trials), optimizer.recommend(), False)


def cylinder_scene(turn=0.0):
    """A cylinder held by four capsules."""
    can = trimesh.creation.cylinder(radius=0.035, height=0.12, sections=32)
    meshes = [SceneMesh("object", np.array(can.vertices), np.array(can.faces), "#7fa6c9", see_through=True)]
    points, normals = [], []
    for k, angle in enumerate((0.2 + turn, 2.2, 2.7, 3.4)):
        finger = trimesh.creation.capsule(height=0.05, radius=0.0065, count=[12, 8])
        normal = np.array([-np.cos(angle), -np.sin(angle), 0.0])
        point = np.array([0.035 * np.cos(angle), 0.035 * np.sin(angle), 0.03 * np.sin(3 * k)])
        place = trimesh.geometry.align_vectors([0, 0, 1], np.cross(normal, [0, 0, 1]))
        place[:3, 3] = point - 0.0065 * normal
        finger.apply_transform(place)
        meshes.append(SceneMesh(f"finger {k}", np.array(finger.vertices), np.array(finger.faces)))
        points.append(point)
        normals.append(normal)
    contacts = ContactSet(np.array(points), np.array(normals), np.full(4, 0.5), np.array([1.0, 1.0, 0.7, 0.3]))
    return Scene(tuple(meshes), contacts, ObjectBox(np.zeros(3), np.array([0.07, 0.07, 0.12])))


@pytest.fixture(scope="session", name="cylinder_scene")
def cylinder_scene_fixture():
    return cylinder_scene


def report_of(problem, noise, result, scenes=(None, None), **changes):
    candidates = [
        gather.candidate(result, label, index, robust_score(problem, result.X[index], noise), scene=scene)
        for (label, index), scene in zip(gather.answers(result).items(), scenes, strict=False)
    ]
    options = {"title": f"Maximize {problem.name}", "settings": {"method": "ubo"}, "noise": noise} | changes
    return gather.report_of(result, candidates, **options)


@pytest.fixture(scope="session")
def gm_result():
    p = GM()
    around = p.optimum.x + 0.07 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    return judged(p, sh.InputNoise.unit(0.1), 24, 1, [p.optimum.x, *around, [0.44, 0.48]])


@pytest.fixture(scope="session")
def gm_report(gm_result):
    """The narrow peak was observed and is refused; with scenes."""
    return report_of(GM(), sh.InputNoise.unit(0.1), gm_result, (cylinder_scene(), cylinder_scene(0.4)))


@pytest.fixture(scope="session")
def rkhs_report():
    p, noise = RKHS(), sh.InputNoise.unit(0.01)
    return report_of(p, noise, judged(p, noise, 16, 0))

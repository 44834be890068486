from dataclasses import replace

import numpy as np
import pytest
import trimesh
from exact_mesh import ExactMesh

from surehold.errors import InputError
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import OBJECTS, shipped_object
from surehold.grasping.object.solids import RevolvedProfile, RoundedBox, Tube, signed_distance


def around(obj, n, seed=0, reach=1.3):
    return obj.box_center + np.random.default_rng(seed).uniform(-reach, reach, (n, 3)) * obj.box_half_extents


@pytest.mark.parametrize("name", OBJECTS)
def test_mesh_is_watertight_and_its_volume_matches_the_field(name):
    obj = shipped_object(name)
    mesh = trimesh.Trimesh(obj.vertices, obj.faces, process=False)
    assert mesh.is_watertight
    assert mesh.euler_number == (0 if name == "mug" else 2), "a mug has one handle, the others have none"
    points = around(obj, 60_000, reach=1.0)
    share = np.mean(signed_distance(obj.solids, points)[0] < 0.0)
    box = 8.0 * np.prod(obj.box_half_extents)
    assert share * box == pytest.approx(mesh.volume, abs=4.0 * box * np.sqrt(share * (1 - share) / len(points)))


@pytest.mark.parametrize(
    ("name", "size"),
    [("mug", (80, 117, 95)), ("bottle", (52.5, 52.5, 160)), ("glass", (71, 71, 159)), ("drill", (190, 60, 180))],
)
def test_shipped_objects_have_their_size(name, size):
    np.testing.assert_allclose(2e3 * shipped_object(name).box_half_extents, size, atol=0.01)


def test_masses_are_plausible():
    masses = {name: shipped_object(name).mass for name in OBJECTS}
    assert 0.2 < masses["mug"] < 0.4
    assert 0.2 < masses["bottle"] < 0.35
    assert 0.15 < masses["glass"] < 0.35
    assert 0.6 < masses["drill"] < 1.5


@pytest.mark.parametrize("name", OBJECTS)
def test_distance_equals_the_exact_mesh_distance_outside(name):
    obj = shipped_object(name)
    exact = ExactMesh(obj)
    points = around(obj, 150)
    distance, _ = signed_distance(obj.solids, points)
    ball = 1e-4
    for point, d in zip(points, distance, strict=True):
        if d > 2 * ball:
            end = np.array([0.0, 0.0, 0.5 * ball])
            found = exact.capsule(point - end, point + end, ball)
            assert found == pytest.approx(d - ball, abs=2e-5 + ball), f"{name} at {point}"


@pytest.mark.parametrize(
    "solid",
    [
        RevolvedProfile(((0.0, 0.0), (0.03, 0.0), (0.02, 0.08), (0.0, 0.08)), 0.002, (0.01, 0.0, 0.02)),
        RevolvedProfile(((0.0, 0.0), (0.03, 0.0), (0.02, 0.08), (0.0, 0.08)), 0.002, (0.01, 0.0, 0.02), "x"),
        Tube(((0.0, 0.0, 0.0), (0.03, 0.0, 0.01), (0.03, 0.04, 0.0)), 0.006),
        RoundedBox((0.01, 0.0, 0.02), (0.03, 0.02, 0.04), 0.005, 0.3),
    ],
)
def test_gradient_equals_the_finite_difference_and_the_ball_holds_the_solid(solid):
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (400, 3))
    distance, gradient = solid.signed_distance(points)
    h = 1e-7
    steps = [(solid.signed_distance(points + h * e)[0] - solid.signed_distance(points - h * e)[0]) for e in np.eye(3)]
    difference = np.column_stack(steps) / (2 * h)
    smooth = np.abs(np.linalg.norm(difference, axis=1) - 1.0) < 1e-6  # elsewhere two surfaces are equally near
    assert smooth.mean() > 0.98
    np.testing.assert_allclose(gradient[smooth], difference[smooth], atol=1e-6)
    center, radius = solid.bounding_ball()
    assert np.all(np.linalg.norm(points - center, axis=1)[distance < 0] <= radius)
    assert solid.manifold().volume() > 0


def test_unknown_object_and_bad_numbers_are_explained():
    with pytest.raises(InputError, match="did you mean 'mug'"):
        shipped_object("mugg")
    mug = shipped_object("mug")
    with pytest.raises(InputError, match="friction"):
        GraspObject("thing", mug.vertices, mug.faces, 1.0, mug.center_of_mass, friction=-1.0)
    with pytest.raises(InputError, match="mass"):
        GraspObject("thing", mug.vertices, mug.faces, float("nan"), mug.center_of_mass)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"vertices": np.full((4, 3), np.nan)}, "vertices of 'mug' are not finite"),
        ({"vertices": np.empty((0, 3))}, "vertices of 'mug'"),
        ({"faces": np.array([[0, 1, -1]])}, r"faces of 'mug' are not \(f, 3\), one or more, of 0 to"),
        ({"faces": np.array([[0, 1, 10**6]])}, "faces of 'mug'"),
        ({"center_of_mass": np.array([np.nan, 0.0, 0.0])}, "center_of_mass of 'mug' is"),
        ({"axes": 2.0 * np.eye(3)}, "axes of 'mug' are no rotation"),
        ({"axes": np.diag([1.0, 1.0, -1.0])}, "axes of 'mug' are no rotation .* right-handed"),
    ],
)
def test_arrays_that_are_no_object_are_explained(changed, words):
    with pytest.raises(InputError, match=words):
        replace(shipped_object("mug"), **changed)

import dataclasses

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.grasping.object.distance_field import MARGIN, DistanceField, cache_folder, distance_field_of
from surehold.grasping.object.mesh_distance import FAR_INSIDE, FAR_OUTSIDE
from surehold.grasping.object.mesh_files import load_mesh
from surehold.grasping.object.model import GraspObject
from surehold.grasping.object.shipped import OBJECTS, shipped_object
from surehold.grasping.object.solids import signed_distance


@pytest.mark.parametrize("name", OBJECTS)
def test_field_is_as_exact_as_a_finger_needs(name):
    obj = shipped_object(name)
    field = distance_field_of(obj)
    points = obj.box_center + np.random.default_rng(0).uniform(-1.2, 1.2, (20_000, 3)) * obj.box_half_extents
    exact, gradient = signed_distance(obj.solids, points)
    error = field.distance(points) - exact
    finger = (exact > 0.0063) & (exact < 0.0070)  # the axis of a touching finger is 6.5 mm away
    assert finger.sum() > 100
    assert np.percentile(np.abs(error[finger]), 98) < 5e-6
    assert np.abs(error[finger]).max() < 3e-4, "on a ridge of the field at most about h / 4"
    found = field.gradient(points[finger])
    cosine = np.sum(found * gradient[finger], axis=1) / np.linalg.norm(found, axis=1)
    assert np.median(cosine) > 0.999999
    assert np.percentile(cosine, 3) > 0.999, "within 2.5 degrees but near ridges"


@pytest.mark.parametrize("name", OBJECTS)
def test_beyond_the_grid_the_field_is_a_lower_bound(name):
    obj = shipped_object(name)
    field = distance_field_of(obj)
    points = obj.box_center + np.random.default_rng(0).uniform(-2.0, 2.0, (5_000, 3)) * obj.box_half_extents
    away = np.abs(points - obj.box_center) - obj.box_half_extents
    points = points[np.any(away > MARGIN + 0.001, axis=1)]
    distance = field.distance(points)
    assert np.all(distance <= signed_distance(obj.solids, points)[0] + 1e-6)
    assert np.all(distance > MARGIN)


def test_a_field_of_its_own_is_continued_to_the_margin():
    """Where its grid ended near the object, fingers met the object's box in place of the object."""
    obj, cut = shipped_object("mug"), 7
    whole = distance_field_of(obj, cell=0.002)
    short = DistanceField(whole.nodes[cut:-cut, cut:-cut, cut:-cut], whole.frame.copy())
    short.frame[:3] += cut * 0.002
    field = distance_field_of(dataclasses.replace(obj, distances=short), margin=0.02)
    points = obj.box_center + np.random.default_rng(1).uniform(-1.0, 1.0, (6_000, 3)) * (obj.box_half_extents + 0.019)
    error = field.distance(points) - signed_distance(obj.solids, points)[0]
    assert np.percentile(np.abs(error), 99) < 5e-4
    assert np.abs(error).max() < 0.002, "a cell"
    assert distance_field_of(dataclasses.replace(obj, distances=field), margin=0.02) is field


def test_field_is_cached_and_a_damaged_file_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setenv("SUREHOLD_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path
    bottle = shipped_object("bottle")
    first = distance_field_of(bottle, 0.004)
    (file,) = (tmp_path / "fields").iterdir()
    stamp = file.stat().st_mtime_ns
    np.testing.assert_array_equal(distance_field_of(bottle, 0.004).nodes, first.nodes)
    assert file.stat().st_mtime_ns == stamp, "the second call reads the file"
    file.write_bytes(b"no array")
    np.testing.assert_array_equal(distance_field_of(bottle, 0.004).nodes, first.nodes)
    assert file.stat().st_size > 1000, "the damaged file is written anew"
    holes = first.nodes.copy()
    holes[3, 3, 3, 1:] = np.nan  # as they were computed before, where faces of both directions lie on each other
    np.save(file, holes)
    np.testing.assert_array_equal(distance_field_of(bottle, 0.004).nodes, first.nodes)


def test_cache_that_cannot_be_written_does_no_harm(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("SUREHOLD_CACHE", str(blocked))
    assert distance_field_of(shipped_object("bottle"), 0.004).nodes.shape[-1] == 4


def test_cache_folder_follows_xdg(tmp_path, monkeypatch):
    monkeypatch.delenv("SUREHOLD_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "surehold"


def test_mesh_without_solids_has_the_same_field(tmp_path, monkeypatch):
    pytest.importorskip("igl")
    monkeypatch.setenv("SUREHOLD_CACHE", str(tmp_path))
    bottle = shipped_object("bottle")
    bare = distance_field_of(dataclasses.replace(bottle, solids=()), 0.006)
    exact = distance_field_of(bottle, 0.006)
    error = bare.nodes[..., 0] - exact.nodes[..., 0]
    near = (exact.nodes[..., 0] > -FAR_INSIDE) & (exact.nodes[..., 0] < FAR_OUTSIDE)
    assert np.abs(error[near]).max() < 2e-5
    assert np.abs(error).max() < 0.25 * 0.006, "beyond, distances may be a bit too large"
    assert not np.array_equal(bare.nodes, exact.nodes), "the one is not read from the other's file"


def test_a_mesh_with_a_dent_has_a_field_of_its_own(tmp_path, monkeypatch):
    pytest.importorskip("igl")
    trimesh = pytest.importorskip("trimesh")
    monkeypatch.setenv("SUREHOLD_CACHE", str(tmp_path))
    ball = trimesh.creation.icosphere(2, 0.02)
    corner = int(np.argmax(ball.vertices.sum(axis=1)))
    dented = ball.vertices.copy()
    dented[corner] *= 0.85  # the box stays the same
    places = 1.1 * np.vstack([ball.vertices[corner], -ball.vertices[corner]])
    found = []
    for vertices in (ball.vertices, dented):
        obj = GraspObject("ball", np.array(vertices), np.array(ball.faces, dtype=np.int32), 0.1, np.zeros(3))
        found.append(distance_field_of(obj, 0.002).distance(places))
    assert found[0] == pytest.approx([0.002, 0.002], abs=2e-4)
    assert found[1][0] > 0.0025
    assert found[1][1] == found[0][1]


@pytest.mark.parametrize("subdivided", [False, True])
def test_nodes_on_the_faces_of_a_mesh_know_its_normal(tmp_path, monkeypatch, subdivided):
    pytest.importorskip("igl")
    trimesh = pytest.importorskip("trimesh")
    monkeypatch.setenv("SUREHOLD_CACHE", str(tmp_path))
    half = np.array([0.020, 0.030, 0.040])  # whole numbers of cells: nodes of the grid lie on all six faces
    box = trimesh.creation.box(2.0 * half)
    (box.subdivide() if subdivided else box).export(tmp_path / "box.stl")
    field = distance_field_of(load_mesh(tmp_path / "box.stl", unit="m").object, 0.002)
    length = np.linalg.norm(field.nodes[..., 1:], axis=-1)
    np.testing.assert_allclose(length[np.abs(field.nodes[..., 0]) < 0.003], 1.0, atol=1e-6)
    rng = np.random.default_rng(0)
    for axis in range(3):
        for side in (-1.0, 1.0):
            points = rng.uniform(-0.8, 0.8, (50, 3)) * half
            points[:, axis] = side * half[axis]
            normal = side * np.eye(3)[axis]
            np.testing.assert_allclose(field.gradient(points), np.tile(normal, (50, 1)), atol=1e-6)


@pytest.mark.parametrize("cell", [0.0, -1.0, float("nan"), 1e-5])
def test_bad_cell_is_explained(cell):
    with pytest.raises(InputError, match="cell"):
        distance_field_of(shipped_object("bottle"), cell)

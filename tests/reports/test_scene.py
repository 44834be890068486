import base64
from dataclasses import replace

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.reports.run_report import Candidate, ContactSet, Scene, SceneMesh
from surehold.reports.scene import scene_data


def candidate(scene, label="recommended"):
    return Candidate(label, np.zeros(2), 1.0, scene=scene)


def test_no_scene_no_data():
    assert scene_data((candidate(None),)) is None


def test_meshes_come_back_and_shared_ones_are_stored_once(cylinder_scene):
    first, second = cylinder_scene(), cylinder_scene(0.4)
    data = scene_data((candidate(first, "highest observed"), candidate(second)))
    assert [v["label"] for v in data["views"]] == ["highest observed", "recommended"]
    assert len(data["meshes"]) == 6, "five meshes a view, of which only one finger moves"
    shared = set(data["views"][0]["meshes"]) & set(data["views"][1]["meshes"])
    assert len(shared) == 4
    for view, scene in zip(data["views"], (first, second), strict=True):
        for index, mesh in zip(view["meshes"], scene.meshes, strict=True):
            stored = data["meshes"][index]
            vertices = np.frombuffer(base64.b64decode(data["buffers"][stored["vertices"]]), "<f4").reshape(-1, 3)
            faces = np.frombuffer(base64.b64decode(data["buffers"][stored["faces"]]), "<u4").reshape(-1, 3)
            np.testing.assert_allclose(vertices, mesh.vertices, atol=1e-8)
            np.testing.assert_array_equal(faces, mesh.faces)
            assert (stored["name"], stored["color"], stored["see_through"]) == (mesh.name, mesh.color, mesh.see_through)
        np.testing.assert_allclose([c["p"] for c in view["contacts"]], scene.contacts.points, atol=1e-6)
        np.testing.assert_allclose([c["n"] for c in view["contacts"]], scene.contacts.normals, atol=1e-6)
        assert view["box"]["size"] == [0.07, 0.07, 0.12]


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((3, 3)), np.array([[0, 1, 3]]), "not there"),
        (np.zeros((3, 3)), np.array([[0.0, 1.0, 2.0]]), "integers"),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "finite"),
        (np.zeros((3, 2)), np.array([[0, 1, 2]]), "shape"),
        (np.zeros((3, 3)), np.zeros((400_001, 3), dtype=np.int64), "400,001 triangles"),
    ],
)
def test_bad_meshes(vertices, faces, message):
    with pytest.raises(InputError, match=message):
        scene_data((candidate(Scene((SceneMesh("thing", vertices, faces),))),))


def test_contacts_must_fit_together(cylinder_scene):
    scene = cylinder_scene()
    broken = replace(scene, contacts=replace(scene.contacts, weights=np.ones(2)))
    with pytest.raises(InputError, match="2 weights"):
        scene_data((candidate(broken),))
    none = ContactSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0))
    assert scene_data((candidate(replace(scene, contacts=none)),))["views"][0]["contacts"] == []

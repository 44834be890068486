"""Palms that are meshes: filled with boxes, their openings free."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from surehold.grasping.hand.configuration import HandConfig
from surehold.grasping.hand.files import load_hand
from surehold.grasping.hand.filling import CELLS, MOST, filling_boxes

SIZE = (0.08, 0.1, 0.03)


def box(size, place=(0.0, 0.0, 0.0)):
    return trimesh.creation.box(size, transform=trimesh.transformations.translation_matrix(place))


def frame(opening=(0.05, 0.06)):
    return box(SIZE).difference(box((*opening, 0.05)), engine="manifold")


def fork():
    """Two prongs on a bar, and a gap between them that no single box leaves out."""
    parts = [box((0.08, 0.02, 0.03)), *(box((0.02, 0.08, 0.03), (x, 0.05, 0.0)) for x in (-0.03, 0.03))]
    return trimesh.boolean.union(parts, engine="manifold")


def inside(boxes, points, by=0.0):
    return np.any([np.all(np.abs(points - center) <= half + by, axis=1) for center, half in boxes], axis=0)


@pytest.mark.parametrize("mesh", [box(SIZE), frame(), fork(), trimesh.creation.icosphere(radius=0.04)])
def test_boxes_fill_the_mesh_and_little_more(mesh):
    boxes = filling_boxes(mesh.vertices, mesh.faces)
    assert 1 <= len(boxes) <= MOST
    points = trimesh.sample.sample_surface(mesh, 5000, seed=0)[0]
    assert inside(boxes, points, 1e-3).all(), "no part of the surface is left out"
    volume = sum(8.0 * np.prod(half) for _, half in boxes)
    assert volume <= min(1.45 * mesh.volume, np.prod(mesh.extents) * (1 + 1e-9))
    low, high = (f([c + s * h for c, h in boxes], axis=0) for f, s in ((np.min, -1), (np.max, 1)))
    np.testing.assert_allclose([low, high], mesh.bounds, atol=1e-9)


def test_a_solid_box_is_one_and_an_opening_is_open():
    (center, half), *more = filling_boxes(box(SIZE).vertices, box(SIZE).faces)
    assert not more
    np.testing.assert_allclose([center, half], [np.zeros(3), 0.5 * np.array(SIZE)], atol=1e-12)
    boxes = filling_boxes(frame().vertices, frame().faces)
    assert len(boxes) == 4
    grid = np.random.default_rng(0).uniform(-0.5, 0.5, (2000, 3)) * [0.05, 0.06, 0.03]
    assert not inside(boxes, grid, -0.1 / CELLS).any()
    prongs = filling_boxes(fork().vertices, fork().faces)
    assert len(prongs) == 3
    assert not inside(prongs, np.array([[0.0, 0.05, 0.0]])).any()


def test_a_hollow_mesh_is_filled_where_nothing_gets_in():
    hollow = box(SIZE).difference(box((0.07, 0.09, 0.02)), engine="manifold")
    assert len(filling_boxes(hollow.vertices, hollow.faces)) == 1


@pytest.mark.parametrize("euler", ["0 0 0", "30 20 10"])
def test_a_palm_with_an_opening(tmp_path, euler):
    """Turned in its file as well: the boxes follow, in the frame of the palm."""
    turn = Rotation.from_euler("XYZ", [float(angle) for angle in euler.split()], degrees=True)
    mesh = frame()
    mesh.vertices = turn.inv().apply(mesh.vertices + np.array([0.0, 0.0, 0.01]))
    mesh.export(tmp_path / "palm.stl")
    (tmp_path / "hand.xml").write_text(
        f"""<mujoco><asset><mesh name="p" file="palm.stl"/></asset><worldbody><body name="palm">
        <geom type="mesh" mesh="p" euler="{euler}"/>
        <body pos="-.05 0 0"><joint name="a" axis="0 1 0" range="0 90"/><geom type="capsule" size=".008 .03"/></body>
        <body pos=".05 0 0"><joint name="b" axis="0 -1 0" range="0 90"/><geom type="capsule" size=".008 .03"/></body>
        </body></worldbody></mujoco>"""
    )
    config = {
        "name": "frame",
        "palm": {"body": "palm", "x": [1, 0, 0], "z": [0, 0, 1], "grasp_center": [0, 0, 0.05]},
        "fingers": {"left": ["a"], "right": ["b"]},
        "preshapes": {"close": {"closed": {"a": 1.0, "b": 1.0}}},
    }
    hand = load_hand(tmp_path / "hand.xml", HandConfig.model_validate(config))
    local = [
        (pose[:, :3], pose[:, 3], half) for pose, half in zip(hand.palm_poses, hand.palm_half_extents, strict=True)
    ]

    def covered(points, by):
        return np.any([np.all(np.abs((points - p) @ r) <= half + by, axis=1) for r, p, half in local], axis=0)

    rng = np.random.default_rng(0)
    opening = rng.uniform(-0.5, 0.5, (2000, 3)) * [0.044, 0.054, 0.03] + [0.0, 0.0, 0.01]
    assert not covered(opening, 0.0).any()
    assert covered(trimesh.sample.sample_surface(frame(), 2000, seed=0)[0] + [0.0, 0.0, 0.01], 1e-3).all()

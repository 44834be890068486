"""Still pictures: both painters draw the same outline, where it must be."""

import io
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from surehold.reports import still
from surehold.reports.run_report import Scene, SceneMesh


def pixels(png):
    return imread(io.BytesIO(png))[:, :, :3]


def drawn(png):
    """Return which pixels are not background."""
    picture = pixels(png)
    return np.abs(picture - picture[0, 0]).max(axis=2) > 0.02


def without_graphics(monkeypatch):
    for name in ("mujoco.egl", "mujoco.osmesa"):
        monkeypatch.setitem(sys.modules, name, None)


def test_matplotlib_draws_where_there_is_no_graphics(cylinder_scene, monkeypatch):
    without_graphics(monkeypatch)
    png, painter = still.still_picture(cylinder_scene(), 480, 360)
    assert painter == "matplotlib"
    assert pixels(png).shape == (360, 480, 3)
    share = drawn(png).mean()
    assert 0.05 < share < 0.6
    red = pixels(png)[..., 0] - pixels(png)[..., 1:].max(axis=2) > 0.4
    assert red.sum() > 20, "the contacts"


def test_both_painters_see_the_same(cylinder_scene, monkeypatch):
    scene = replace(cylinder_scene(), contacts=None)
    png, painter = still.still_picture(scene, 480, 360)
    if painter != "mujoco":
        pytest.skip("neither EGL nor OSMesa is here")
    without_graphics(monkeypatch)
    other = drawn(still.still_picture(scene, 480, 360)[0])
    mine = drawn(png)

    def proportions(mask):
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        return np.ptp(columns) / np.ptp(rows), mask[rows[0] : rows[-1], columns[0] : columns[-1]].mean()

    np.testing.assert_allclose(proportions(mine), proportions(other), rtol=0.12)


def test_what_is_nearer_hides_what_is_behind(monkeypatch):
    without_graphics(monkeypatch)
    square = np.array([[-0.02, 0, -0.02], [0.02, 0, -0.02], [0.02, 0, 0.02], [-0.02, 0, 0.02]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    near = SceneMesh("near", square + np.array([0.0, -0.05, 0.0]), faces, "#ff0000")
    far = SceneMesh("far", 0.9 * square + np.array([0.0, 0.05, 0.0]), faces, "#0000ff")
    picture = pixels(still.still_picture(Scene((far, near), view=(0.0, -1.0, 0.0)), 200, 200)[0])
    assert picture[100, 100, 0] > 0.4
    assert picture[..., 2].max() <= picture[0, 0, 2] + 0.02
    assert picture[100, 100, 2] < 0.1, "only the near one is seen"
    poses = np.stack([np.eye(3, 4), np.column_stack([np.eye(3), [0.0, 0.2, 0.0]])])
    gone = replace(near, poses=poses)
    picture = pixels(still.still_picture(Scene((far, gone), view=(0.0, -1.0, 0.0)), 200, 200)[0])
    assert picture[100, 100, 2] > 0.4, "its last pose is behind the other"


def test_a_long_triangle_hides_nothing_that_is_nearer(monkeypatch):
    """Its middle is nearer than the small square, but where the two overlap it lies behind."""
    without_graphics(monkeypatch)
    small = np.array([[-0.01, 0.0, -0.01], [0.01, 0.0, -0.01], [0.01, 0.0, 0.01], [-0.01, 0.0, 0.01]])
    strip = np.array([[-0.02, 0.06, -0.02], [0.3, -0.4, -0.02], [0.3, -0.4, 0.02], [-0.02, 0.06, 0.02]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    scene = Scene((SceneMesh("small", small, faces, "#ff0000"), SceneMesh("strip", strip, faces, "#0000ff")))
    picture = pixels(still.still_picture(replace(scene, view=(0.0, -1.0, 0.0)), 400, 100)[0])
    red = (picture[..., 0] > 0.4) & (picture[..., 2] < 0.1)
    shape = red.any(axis=1).sum(), red.any(axis=0).sum()
    assert min(shape) > 10
    assert red.sum() > 0.9 * shape[0] * shape[1]
    assert shape[0] == pytest.approx(shape[1], rel=0.15)

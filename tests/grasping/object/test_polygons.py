"""Faces of any number of corners: triangles that fill them and nothing beside them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surehold.grasping.object.polygons import triangles_of


def cut(vertices, *polygons):
    corners = np.array([corner for polygon in polygons for corner in polygon], dtype=np.int64)
    return triangles_of(np.asarray(vertices, dtype=float), corners, np.array([len(p) for p in polygons]))


@pytest.mark.parametrize("seed", range(20))
def test_triangles_of_a_star_have_its_area_and_its_direction(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 20))
    angle = 2.0 * np.pi * (np.arange(n) + rng.uniform(0.0, 0.8, n)) / n
    radius = rng.uniform(0.2, 1.0, n)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))  # the shoelace formula
    turn = Rotation.random(random_state=seed).as_matrix()
    outline = np.column_stack([x, y, np.zeros(n)])[:: 1 if seed % 2 else -1] @ turn.T
    faces = cut(np.vstack([rng.standard_normal((3, 3)), outline]), range(3, n + 3))
    corners = np.vstack([np.zeros((3, 3)), outline])[faces]
    cross = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = cross @ turn[:, 2] * (1.0 if seed % 2 else -1.0)
    assert len(faces) == n - 2
    assert np.all(along > -1e-12)  # none is folded back over another
    assert np.linalg.norm(cross, axis=1).sum() == pytest.approx(area)


def test_convex_faces_are_fans_in_the_order_of_the_file():
    square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]]
    found = cut(square, [0, 1, 4], [0, 3, 2, 1], [1, 2, 4], [0, 1])
    assert found.tolist() == [[0, 1, 4], [0, 3, 2], [0, 2, 1], [1, 2, 4]]


def test_faces_that_have_no_triangles_of_their_own_are_fans():
    bow = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert len(cut(bow, [0, 1, 2, 3])) == 2
    assert cut(bow, [0, 1, 2, 9]).tolist() == [[0, 1, 2], [0, 2, 9]]  # refused by who reads the file
    assert cut(bow).shape == (0, 3)

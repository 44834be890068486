"""The quality of the simulator behind the thesis, against measured numbers of it and against Qhull."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from surehold.errors import InputError
from surehold.grasping.wrench.friction_cones import contact_wrenches
from surehold.grasping.wrench.simox import _hull_vertices, _planar_hull, object_wrench_space, simox_quality

# Faces of a cube with corners numbered by the bits of (x, y, z); the object's number depends on the diagonals.
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def cuboid(extents):
    faces = []
    for axis in range(3):
        for side in (0, 1):
            a, b, c, d = (i for i in range(8) if (i >> (2 - axis)) & 1 == side)
            for face in [(a, b, d), (a, c, d)] if side else [(a, b, c), (b, c, d)]:
                p, q, r = CORNERS[list(face)]
                outward = np.cross(q - p, r - p)[axis] * (2 * side - 1) > 0
                faces.append(face if outward else face[::-1])
    return CORNERS * extents, np.array(faces)


@pytest.mark.parametrize(("extents", "measured"), [((1, 1, 1), 0.7071), ((100, 60, 40), 0.4566)])
def test_object_numbers_of_boxes_as_measured(extents, measured):
    space = object_wrench_space(*cuboid(np.array(extents, float)))
    assert space.radius == pytest.approx(measured, abs=5e-5)
    assert space.torque_length == max(extents) / 2


def test_object_number_of_the_icosphere_as_measured():
    sphere = trimesh.creation.icosphere(subdivisions=2)  # 320 faces, 300 of them are taken
    assert 0.6735 <= object_wrench_space(sphere.vertices, sphere.faces).radius <= 0.6755


def test_object_number_does_not_depend_on_place_and_size():
    vertices, faces = cuboid(np.array([3.0, 2.0, 1.0]))
    radius = object_wrench_space(vertices, faces).radius
    assert object_wrench_space(0.01 * vertices + [5.0, -3.0, 2.0], faces).radius == pytest.approx(radius, rel=1e-9)


def test_torques_are_about_the_plain_mean_of_the_vertices():
    vertices, faces = cuboid(np.array([3.0, 2.0, 1.0]))
    more = np.vstack([vertices, vertices[:2]])
    assert object_wrench_space(more, faces).origin == pytest.approx(tuple(more.mean(axis=0)))


def vertex_centered_radius_by_qhull(wrenches):
    hull = ConvexHull(wrenches, qhull_options="QJ Pp")
    center = wrenches[hull.vertices].mean(axis=0)
    return -(hull.equations[:, :-1] @ center + hull.equations[:, -1]).max()


def test_quality_equals_the_full_hull():
    rng = np.random.default_rng(0)
    space = object_wrench_space(*cuboid(np.array([0.1, 0.06, 0.04])))
    for _ in range(20):
        points, normals = rng.normal(size=(2, rng.integers(3, 7), 3))
        points *= 0.05
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        down = np.array([0.0, 0.0, 1.0])
        tangents = np.array([1.0, 0.0, 0.0]) - (normals[:, :1] / (1 + normals[:, 2:])) * (normals + down)
        w = contact_wrenches(points, normals, 1.0, 8, 0.05, space.origin, tangents, "unit_magnitude")
        expected = vertex_centered_radius_by_qhull(w) / space.radius
        assert simox_quality(points, normals, space) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("turned", [0.0, 1e-8, 3e-6, 1e-5, 4e-5, 1e-3])
def test_normals_that_point_almost_straight_down(turned):
    """As rounding leaves them of a flat top: they were refused between 1e-6 and 1e-5 beside -z."""
    space = object_wrench_space(*cuboid(np.array([0.1, 0.06, 0.04])))
    points = np.array([[0.0, 0.0, 0.02], [0.05, 0.01, 0.0], [-0.05, 0.0, 0.01], [0.0, 0.03, 0.0], [0.02, -0.03, 0.0]])
    normals = np.array([[0.0, 0.0, -1.0], [-1.0, 0, 0], [1.0, 0, 0], [0, -1.0, 0], [0, 1.0, 0]])
    normals[0] = Rotation.from_rotvec([-0.6 * turned, 0.8 * turned, 0.0]).apply(normals[0])
    across = np.column_stack([-normals[:, 1], normals[:, 0]])  # axis of the smallest rotation from z
    length = np.hypot(*across.T)
    angle = np.arctan2(length, normals[:, 2])
    axes = np.where(length[:, None] > 1e-7, across / np.maximum(length, 1e-300)[:, None], [1.0, 0.0])
    tangents = Rotation.from_rotvec(np.column_stack([axes * angle[:, None], np.zeros(5)])).apply([1.0, 0.0, 0.0])
    w = contact_wrenches(points, normals, 1.0, 8, 0.05, space.origin, tangents, "unit_magnitude")
    expected = vertex_centered_radius_by_qhull(w) / space.radius
    assert simox_quality(points, normals, space) == pytest.approx(expected, abs=1e-6)
    vertices, faces = cuboid(np.array([3.0, 2.0, 1.0]))
    tilted = Rotation.from_rotvec([-0.6 * turned, 0.8 * turned, 0.0]).apply(vertices)
    assert object_wrench_space(tilted, faces).radius == pytest.approx(
        object_wrench_space(vertices, faces).radius, rel=2.0 * turned + 1e-9
    )


def test_the_object_number_is_of_forces_that_press_into_the_faces():
    hull = ConvexHull(np.random.default_rng(3).normal(size=(12, 3)))
    vertices, faces = hull.points, hull.simplices.copy()
    center = vertices.mean(axis=0)
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    inside_out = np.sum(np.cross(q - p, r - p) * (p - center), axis=1) < 0.0
    faces[inside_out] = faces[inside_out][:, ::-1]
    normals = -hull.equations[:, :3]
    tangents = np.array([1.0, 0.0, 0.0]) - (normals[:, :1] / (1.0 + normals[:, 2:])) * np.add(normals, (0.0, 0.0, 1.0))
    long = np.ptp(vertices, axis=0).max() / 2.0
    w = contact_wrenches(vertices[faces].mean(axis=1), normals, 1.0, 8, long, center, tangents, "unit_magnitude")
    expected = vertex_centered_radius_by_qhull(w)
    opposite = vertex_centered_radius_by_qhull(
        contact_wrenches(vertices[faces].mean(axis=1), -normals, 1.0, 8, long, center, convention="unit_magnitude")
    )
    assert abs(opposite - expected) > 1e-3
    assert object_wrench_space(vertices, faces).radius == pytest.approx(expected, abs=1e-7)


def test_a_point_counts_once_and_points_on_an_edge_are_no_corners():
    turn = Rotation.from_rotvec([0.0, 0.0, 0.7]).as_matrix()[:2, :2]
    side = np.linspace(-0.3, 0.4, 8)
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) @ turn.T
    assert sorted(_planar_hull(grid)) == [0, 7, 56, 63]
    assert len(_planar_hull(np.repeat(grid, 3, axis=0))) == 4
    assert len(_planar_hull(np.repeat(grid[:1], 5, axis=0))) == 1


def test_vertices_among_equal_forces():
    # 4 x 4 contacts on each face of a cube: only the outer ones can be vertices
    box = trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
    centers, normals = box.triangles_center, -box.face_normals
    w = contact_wrenches(centers, normals, 1.0, 8, 0.5, convention="unit_magnitude")
    found = np.zeros(len(w), bool)
    found[_hull_vertices(w)] = True
    for i in range(0, len(w), 97):
        same = np.flatnonzero(np.abs(w[:, :3] - w[i, :3]).max(axis=1) < 1e-9)
        others = w[same[same != i], 3:]
        flat = np.linalg.svd(others - others.mean(axis=0))[2][:2].T
        hull = ConvexHull((others - others.mean(axis=0)) @ flat)
        inside = (
            hull.equations[:, :2] @ ((w[i, 3:] - others.mean(axis=0)) @ flat) + hull.equations[:, 2]
        ).max() <= 1e-9
        assert found[i] == (not inside)


def test_slips_are_kept():
    space = object_wrench_space(*cuboid(np.array([1.0, 1.0, 1.0])))
    points = np.array([[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]])
    assert simox_quality(points, -points / 0.5, space) > 0.0  # no force closure, positive all the same
    assert simox_quality(points[:1], -points[:1] / 0.5, space) == 0.0
    assert simox_quality(points[[0, 0]], -points[[0, 0]] / 0.5, space) == 0.0


def test_bad_meshes_are_named():
    vertices, faces = cuboid(np.ones(3))
    with pytest.raises(InputError, match="faces must index"):
        object_wrench_space(vertices, faces + 5)
    with pytest.raises(InputError, match="integers of shape"):
        object_wrench_space(vertices, faces[:, :2])
    with pytest.raises(InputError, match="finite"):
        object_wrench_space(vertices * np.nan, faces)
    with pytest.raises(InputError, match="no extent"):
        object_wrench_space(vertices * 0.0, faces)
    with pytest.raises(InputError, match="no volume of wrenches"):
        object_wrench_space(vertices, faces[:2])

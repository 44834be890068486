import numpy as np
import pytest
from exact_mesh import ExactMesh, capsule_pair
from scipy.spatial.transform import Rotation

from surehold.grasping.closing.clearance import (
    _below,
    box_gap,
    capsule_gap,
    capsule_pair_gap,
    palm_gap,
    piece_memory,
    separation,
)
from surehold.grasping.object.distance_field import distance_field_of
from surehold.grasping.object.shipped import shipped_object
from surehold.grasping.object.solids import RoundedBox, signed_distance
from surehold.grasping.poses import Pose


@pytest.fixture(scope="module", params=["mug", "drill"])
def scene(request):
    obj = shipped_object(request.param)
    return obj, distance_field_of(obj)


def segments(obj, n, seed):
    rng = np.random.default_rng(seed)
    near = obj.box_center + rng.uniform(-1.2, 1.2, (n, 3)) * obj.box_half_extents
    turn = rng.standard_normal((n, 3))
    return near, near + 0.024 * turn / np.linalg.norm(turn, axis=1)[:, None]


def test_capsule_gap_equals_a_dense_search_of_the_exact_distance(scene):
    obj, field = scene
    radius, checked = 0.0065, 0
    for near, far in zip(*segments(obj, 400, 1), strict=True):
        share = np.linspace(0.0, 1.0, 2001)[:, None]
        exact = signed_distance(obj.solids, near + share * (far - near))[0].min() - radius
        gap, where = capsule_gap(field.nodes, field.frame, near, far, radius, 1e-6, 0.0, piece_memory())
        loose, _ = capsule_gap(field.nodes, field.frame, near, far, radius, 1e-6, 0.2, piece_memory())
        if exact > 0.0:
            assert max(gap, loose) <= exact + 1e-4, "never overrated, but for ridges of the field"
        if 0.0 < exact < 0.004:
            checked += 1
            assert gap == pytest.approx(exact, abs=2e-5)
            assert loose >= 0.75 * gap - 2e-6
            place = near + where * (far - near)
            assert signed_distance(obj.solids, place[None])[0][0] - radius == pytest.approx(exact, abs=2e-5)
    assert checked > 5


def test_the_distance_between_two_samples_is_never_below_its_bound():
    """Of a single point, whose distance bends as much as any set's, it is so, and hardly more."""
    rng = np.random.default_rng(0)
    for length in (0.001, 0.01, 0.1):
        for x, off in zip(rng.uniform(-0.1, 0.1, 300), rng.uniform(0.0, 0.05, 300), strict=True):
            lowest = np.hypot(x - np.clip(x, 0.0, length), off)
            assert _below(np.hypot(x, off), np.hypot(x - length, off), length) <= lowest + 1e-15
    for length in (0.001, 0.002, 0.004):
        ends = np.hypot(0.5 * length, 0.02)
        drop = ends - 0.02
        assert ends - _below(ends, ends, length) == pytest.approx(drop, rel=1.5 * length / 0.02)


def test_capsule_gap_equals_the_exact_mesh_distance(scene):
    obj, field = scene
    exact, checked = ExactMesh(obj), 0
    for near, far in zip(*segments(obj, 120, 2), strict=True):
        gap, _ = capsule_gap(field.nodes, field.frame, near, far, 0.0065, 1e-6, 0.0, piece_memory())
        if 2e-4 < gap < 0.004:
            checked += 1
            assert gap == pytest.approx(exact.capsule(near, far, 0.0065), abs=4e-5), "the mesh itself is 0.02 mm off"
    assert checked > 3


def test_palm_gap_equals_the_exact_mesh_distance(scene):
    obj, field = scene
    exact, half, rounding = ExactMesh(obj), np.array([0.040, 0.0335, 0.015]), 0.006
    rng, checked = np.random.default_rng(3), 0
    while checked < 12:
        quaternion = rng.standard_normal(4)
        center = obj.box_center + rng.uniform(-1.8, 1.8, 3) * obj.box_half_extents
        pose = Pose(tuple(center), tuple(quaternion / np.linalg.norm(quaternion))).matrix
        gap = palm_gap(field.nodes, field.frame, pose, half, rounding, 1e-5, 0.010)
        if 2e-4 < gap < 0.0055:
            checked += 1
            assert gap == pytest.approx(exact.box(pose, half, rounding), abs=6e-5)
        elif gap >= 0.010:
            assert exact.box(pose, half, rounding) > 0.0099


@pytest.mark.parametrize("radius", [0.004, 0.0015])
def test_an_object_wholly_inside_the_palm_is_a_collision(radius):
    """No face of the box comes near it: the sphere's center tells, in closed form, as it does beside the box."""
    half, rng = np.array([0.040, 0.0335, 0.015]), np.random.default_rng(6)
    axis = 0.001 * np.arange(-20, 21)
    places = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    away = np.linalg.norm(places, axis=-1, keepdims=True)
    nodes = np.concatenate([away - radius, places / np.where(away > 0.0, away, 1.0)], axis=-1).astype(np.float32)
    frame = np.concatenate([np.full(3, axis[0]), [0.001], np.full(3, -radius), np.full(3, radius)])
    inside, beside = 0, 0
    for _ in range(400):
        turn = Rotation.random(rng=rng).as_matrix()
        center = rng.uniform(-1.2, 1.2, 3) * half
        pose = np.column_stack([turn, -turn @ center])  # of the box, with the sphere at `center` in its axes
        gap = palm_gap(nodes, frame, pose, half, 0.003, 1e-5, 0.005)
        over = np.maximum(np.abs(center) - (half - 0.003), 0.0)
        exact = np.linalg.norm(over) - 0.003 - radius
        inside += bool(np.all(over == 0.0))
        assert (gap < 0.0) == (exact < 0.0)
        if np.any(over > 0.0) and -0.0018 < exact < 0.005:
            beside += 1
            assert gap == pytest.approx(exact, abs=1.2e-5)
    assert inside > 50
    assert beside > 50


def test_pair_gap_equals_an_independent_library():
    rng, across = np.random.default_rng(4), np.empty(3)
    for _ in range(300):
        a, b = rng.uniform(-0.05, 0.05, (2, 2, 3))
        gap = capsule_pair_gap(a[0], a[1], b[0], b[1], 0.013, across)
        if gap > 1e-4:
            assert gap == pytest.approx(capsule_pair(a, b, 0.0065), abs=1e-6)
        assert separation(a[0], a[1], b[0], b[1], across) == pytest.approx(gap + 0.013, abs=1e-12)
        assert np.linalg.norm(across) == pytest.approx(1.0)
        other = rng.standard_normal(3)
        other /= np.linalg.norm(other)
        assert separation(a[0], a[1], b[0], b[1], other) <= gap + 0.013 + 1e-12, "no direction parts them farther"


def test_pair_gap_of_parallel_and_touching_capsules():
    a, across = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]]), np.empty(3)
    for shift, expected in ((0.0, 0.02), (0.01, 0.02), (-0.01, 0.02), (0.05, np.hypot(0.03, 0.02)), (-0.05, None)):
        b = a + np.array([shift, 0.02, 0.0])
        gap = capsule_pair_gap(a[0], a[1], b[0], b[1], 0.0, across)
        assert gap == pytest.approx(np.hypot(0.03, 0.02) if expected is None else expected, abs=1e-12)
    capsule_pair_gap(a[0], a[1], a[0], a[1], 0.0, across)
    np.testing.assert_array_equal(across, 0.0)


def test_gap_to_the_palm_equals_a_dense_search():
    rng, half = np.random.default_rng(5), np.array([0.04, 0.03, 0.015])
    box = RoundedBox((0.0, 0.0, 0.0), tuple(half), 0.006)
    pose = np.column_stack([np.eye(3), np.zeros(3)])
    for _ in range(200):
        near, far = rng.uniform(-0.08, 0.08, (2, 3))
        points = near + np.linspace(0.0, 1.0, 2001)[:, None] * (far - near)
        exact = box.signed_distance(points)[0].min() - 0.0065
        gap = box_gap(pose, half, 0.006, near, far, 0.0065)
        if exact > 0.0:
            assert 0.98 * exact - 5e-6 <= gap <= exact + 5e-6
        else:
            assert gap < 5e-6

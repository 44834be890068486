"""Force closure by linear programs against the hull, and the task quality against hand-made cases and Qhull."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from surehold.errors import InputError
from surehold.grasping.wrench.force_closure import force_closure, gravity_wrenches, task_quality
from surehold.grasping.wrench.friction_cones import contact_wrenches
from surehold.grasping.wrench.hull.inscribed_ball import ball_radius


def random_contacts(rng, c):
    points = rng.normal(size=(c, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals = -points + rng.uniform(0.1, 1.2) * rng.normal(size=(c, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return points * rng.uniform(0.3, 1.0, 3), normals


def test_linear_program_and_hull_agree_on_closure():
    rng = np.random.default_rng(0)
    closed = 0
    for k in range(1000):
        c = int(rng.integers(2, 8))
        w = contact_wrenches(*random_contacts(rng, c), friction=rng.uniform(0.0, 0.9), edges=int(rng.integers(3, 7)))
        verdict = force_closure(w)
        assert verdict == (ball_radius(w) > 0.0), f"set {k}"
        closed += verdict
    assert 150 < closed < 850


def test_what_can_never_be_closed():
    rng = np.random.default_rng(1)
    axis = np.array([[0.0, 0, 1]])
    assert not force_closure(contact_wrenches(np.vstack((axis, -axis)), np.vstack((-axis, axis)), friction=2.0))
    for _ in range(20):  # two point contacts with friction; six or fewer without
        points, normals = random_contacts(rng, 2)
        assert not force_closure(contact_wrenches(points, normals, friction=3.0))
        points, normals = random_contacts(rng, 6)
        w = contact_wrenches(points, normals, friction=0.0)
        assert not force_closure(w)
        assert ball_radius(w) == 0.0
    angles, heights = rng.uniform(0, 2 * np.pi, 40), rng.uniform(-1, 1, 40)  # no friction on a surface of revolution
    tilt = rng.uniform(-1, 1, 40)
    radial = np.column_stack((np.cos(angles), np.sin(angles), 0 * angles))
    points = radial * (1 + 0.3 * heights[:, None]) + np.outer(heights, [0, 0, 1])
    normals = -radial * np.cos(tilt)[:, None] + np.outer(np.sin(tilt), [0, 0, 1])
    w = contact_wrenches(points, normals, friction=0.0)
    assert not force_closure(w)
    assert ball_radius(w) == 0.0
    assert not force_closure(np.zeros((0, 6)))
    assert not force_closure(np.zeros((9, 6)))


def test_task_quality_is_the_distance_along_the_ray():
    rng = np.random.default_rng(2)
    for _ in range(10):
        w = contact_wrenches(*random_contacts(rng, 5), friction=0.8)
        if ball_radius(w) == 0.0:
            continue
        equations = ConvexHull(w, qhull_options="QJ Pp").equations
        task = rng.normal(size=(3, 6))
        along = -task @ equations[:, :-1].T
        scales = np.where(along > 0, -equations[:, -1] / np.where(along > 0, along, 1.0), np.inf)
        assert task_quality(w, task) == pytest.approx(scales.min(), rel=1e-6)


def test_task_quality_of_a_shelf():
    # four unit contacts from below carry a weight of one in sum, nothing sideways, nothing upwards
    points = np.array([[1.0, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    w = contact_wrenches(points, np.tile([0.0, 0, 1], (4, 1)), friction=0.0)
    down = gravity_wrenches(0.25, (0, 0, 0.5), [[0, 0, -1]])
    assert task_quality(w, down) == pytest.approx(4.0)
    assert task_quality(w, gravity_wrenches(0.25, (2.0, 0, 0), [[0, 0, -1]])) == 0.0  # tips over the edge
    assert task_quality(w, gravity_wrenches(0.25, (0, 0, 0.5))) == 0.0
    assert task_quality(np.zeros((0, 6)), down) == 0.0
    assert task_quality(w, np.zeros((1, 6))) == np.inf


def test_gravity_wrenches_turn_about_the_origin():
    w = gravity_wrenches(2.0, (0.1, 0, 0), [[0, 0, -1]], torque_length=0.05, origin=(0, 0, 0))
    np.testing.assert_allclose(w, [[0, 0, -2, 0, 4, 0]])
    w = gravity_wrenches(2.0, (0.1, 0, 0), [[0, 0, -1]], torque_length=0.05, origin=(0.1, 0, 0))
    np.testing.assert_allclose(w, [[0, 0, -2, 0, 0, 0]], atol=1e-12)


def test_seven_wrenches_close_where_they_span_a_simplex_around_the_origin():
    simplex = np.vstack([np.eye(6), -np.ones(6)])
    assert force_closure(simplex)
    assert not force_closure(simplex + 1.5 * np.eye(6)[0])
    assert not force_closure(simplex[:6])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: force_closure(np.ones((3, 5))), "wrenches must have shape"),
        (lambda: task_quality(np.ones((3, 6)), np.ones(6)), "task must have shape"),
        (lambda: task_quality(np.ones((3, 6)), np.zeros((0, 6))), "at least one"),
        (lambda: gravity_wrenches(-1.0, (0, 0, 0)), "weight"),
        (lambda: gravity_wrenches(1.0, (0, 0, np.nan)), "finite"),
        (lambda: gravity_wrenches(1.0, (0, 0, 0), torque_length=0.0), "torque_length"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(InputError, match=words):
        call()

"""Wrench hull measures against Qhull, closed forms and invariances."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from surehold.errors import InputError
from surehold.grasping.wrench_space import (
    ball_radius,
    contact_wrenches,
    hull_volume,
    inscribed_ball,
    tangents,
    wrench_quality,
)


def random_contacts(rng, c):
    points = rng.normal(size=(c, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals = -points + 0.4 * rng.normal(size=(c, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return points * rng.uniform(0.3, 1.0, 3), normals


def clustered_contacts(rng, patches, per_patch, radius, flat):
    points, normals = [], []
    for _ in range(patches):
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        offsets = rng.normal(size=(per_patch, 3)) * radius
        offsets -= np.outer(offsets @ n, n)
        tilted = n + (0.0 if flat else 0.05) * rng.normal(size=(per_patch, 3))
        points.append(offsets - n)
        normals.append(tilted / np.linalg.norm(tilted, axis=1)[:, None])
    return np.concatenate(points), np.concatenate(normals), rng.uniform(size=patches * per_patch)


def cube_contacts(a):
    points, normals = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            for along in (-a, a):
                p, n = np.zeros(3), np.zeros(3)
                p[axis], p[(axis + 1) % 3], n[axis] = side, along, -side
                points.append(p)
                normals.append(n)
    return np.array(points), np.array(normals)


def full_hull_offset(wrenches):
    """Signed distance from the origin to the nearest facet plane of the full hull."""
    return -ConvexHull(wrenches, qhull_options="QJ Pp").equations[:, -1].max()


def test_epsilon_equals_the_full_hull_on_random_contacts():
    rng = np.random.default_rng(1)
    closed = 0
    for k in range(220):
        c = int(rng.integers(2, 9)) if k % 11 else 25
        points, normals = random_contacts(rng, c)
        convention = "unit_magnitude" if k % 3 == 0 else "normal_unit"
        q = wrench_quality(points, normals, rng.uniform(0.1, 1.0, c), 8 if k % 2 else 5, 0.7, convention=convention)
        if np.linalg.matrix_rank(q.wrenches, 1e-9) < 6:
            assert q.epsilon == 0.0
            continue
        full = full_hull_offset(q.wrenches)
        closed += full > 0
        assert q.epsilon == pytest.approx(max(full, 0.0), abs=1e-8), f"set {k}: {c} contacts"
        assert ball_radius(q.wrenches) == q.epsilon
        assert not q.fallback
    assert closed > 100


def test_epsilon_equals_the_full_hull_on_clustered_soft_contacts():
    rng = np.random.default_rng(2)
    closed = 0
    for k in range(40):
        radius = 10.0 ** rng.uniform(-4, -0.7)
        points, normals, weights = clustered_contacts(
            rng, int(rng.integers(3, 6)), int(rng.integers(4, 12)), radius, k % 2 == 0
        )
        q = wrench_quality(points, normals, weights=weights)
        full = full_hull_offset(q.wrenches)
        closed += q.force_closure
        assert q.epsilon == pytest.approx(max(full, 0.0), abs=1e-8), f"set {k}"
    assert closed > 20


@pytest.mark.parametrize("a", [0.2, 0.5, 1.0, 1.7])
def test_twelve_frictionless_contacts_on_a_cube(a):
    q = wrench_quality(*cube_contacts(a), friction=0.0)
    assert q.epsilon == pytest.approx(min(1.0, a) / np.sqrt(3.0), abs=1e-12)
    assert q.volume == pytest.approx((4 * a) ** 3 * 8 / 720, rel=1e-6)


def test_antipodal_contacts_are_never_closed():
    q = wrench_quality([[1, 0, 0], [-1, 0, 0]], [[-1, 0, 0], [1, 0, 0]], friction=0.9)
    assert (q.epsilon, q.signed_epsilon, q.volume, q.force_closure) == (0.0, 0.0, 0.0, False)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"points": np.zeros((2, 2))}, "points must have shape"),
        ({"points": np.full((2, 3), np.nan)}, "finite"),
        ({"normals": np.ones((2, 3))}, "length 1"),
        ({"normals": np.eye(3)}, "normals must have shape"),
        ({"friction": -0.1}, "friction"),
        ({"friction": [0.1]}, "friction"),
        ({"edges": 2}, "edges"),
        ({"torque_length": 0.0}, "torque_length"),
        ({"origin": (0, 0)}, "origin"),
        ({"tangents": [[0, 0, 1], [0, 0, 1]]}, "perpendicular"),
        ({"convention": "normal_unitt"}, "did you mean 'normal_unit'"),
        ({"weights": [1.0, 1.5]}, "weights"),
    ],
)
def test_bad_input_is_named(change, words):
    arguments = {"points": [[1, 0, 0], [-1, 0, 0]], "normals": [[0, 0, -1], [0, 0, 1]]} | change
    with pytest.raises(InputError, match=words):
        wrench_quality(**arguments)


def test_tangents_are_unit_perpendicular_and_continuous():
    rng = np.random.default_rng(3)
    n = rng.normal(size=(2000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    t = tangents(n)
    np.testing.assert_allclose(np.sum(t * n, axis=1), 0.0, atol=1e-14)
    np.testing.assert_allclose(np.sum(t * t, axis=1), 1.0, atol=1e-14)
    away = n[n @ [0.36, 0.48, 0.8] > -0.9]
    near = away + 1e-6 * rng.normal(size=away.shape)
    near /= np.linalg.norm(near, axis=1)[:, None]
    assert np.abs(tangents(near) - tangents(away)).max() < 1e-4
    np.testing.assert_allclose(np.linalg.norm(tangents([[-0.36, -0.48, -0.8]])), 1.0)


def test_outside_is_minus_the_distance_to_the_hull():
    from scipy.optimize import minimize

    rng = np.random.default_rng(4)
    for _ in range(10):
        w = rng.normal(size=(12, 6)) + 1.2
        signed = inscribed_ball(w).signed
        gram = w @ w.T
        best = minimize(
            lambda x, gram=gram: x @ gram @ x,
            np.full(12, 1 / 12),
            jac=lambda x, gram=gram: 2 * gram @ x,
            bounds=[(0, None)] * 12,
            constraints={"type": "eq", "fun": lambda x: x.sum() - 1, "jac": np.ones_like},
            method="SLSQP",
            options={"ftol": 1e-15, "maxiter": 500},
        )
        assert signed == pytest.approx(-np.sqrt(best.fun), abs=1e-6)


def test_few_and_no_contacts_are_merely_bad():
    assert wrench_quality(np.zeros((0, 3)), np.zeros((0, 3))).epsilon == 0.0
    assert wrench_quality([[0, 0, 0.1]], [[0, 0, -1.0]]).epsilon == 0.0
    assert hull_volume(contact_wrenches([[0, 0, 0.1]], [[0, 0, -1.0]])) == 0.0


def test_epsilon_is_continuous_as_a_weight_vanishes_and_bitwise_repeatable():
    rng = np.random.default_rng(5)
    points, normals = random_contacts(rng, 6)
    for held in (slice(0, 3), slice(0, 6)):
        p, n = points[held], normals[held]
        weights = np.ones(len(p))
        values = []
        for small in (1e-3, 1e-6, 1e-9, 1e-12, 0.0):
            weights[0] = small
            values.append(wrench_quality(p, n, weights=weights).epsilon)
            assert values[-1] == wrench_quality(p, n, weights=weights).epsilon
        for small, value in zip((1e-3, 1e-6, 1e-9, 1e-12), values, strict=False):
            assert abs(value - values[-1]) <= 3 * small + 1e-12

"""Wrench hull measures against Qhull, closed forms and invariances."""

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from surehold.errors import InputError
from surehold.grasping.wrench.force_closure import gravity_wrenches
from surehold.grasping.wrench.friction_cones import CheckedContacts, contact_wrenches, round_contacts, tangents
from surehold.grasping.wrench.hull.inscribed_ball import ball_radius, hull_volume, inscribed_ball
from surehold.grasping.wrench.wrench_space import wrench_quality


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
        assert q.fallbacks == 0
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
        ({"friction": 1e20}, "friction must be at least 0 and at most 1e\\+12"),
        ({"points": np.full((2, 3), 1e308)}, "points must be finite"),
        ({"edges": 10**9}, "edges must be an integer from 3 to 1000"),
        ({"torque_length": 1e-300}, "torque_length"),
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
    beside = [-0.36, -0.48, -0.8] + 1e-7 * rng.normal(size=(100, 3))  # the pole's other side, where digits are lost
    beside /= np.linalg.norm(beside, axis=1)[:, None]
    np.testing.assert_allclose(np.sum(tangents(beside) * beside, axis=1), 0.0, atol=1e-14)


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


def test_rigid_motion_and_scale_change_nothing():
    rng = np.random.default_rng(6)
    for _ in range(10):
        points, normals = random_contacts(rng, 6)
        rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        rotation *= np.sign(np.linalg.det(rotation))
        shift = rng.normal(size=3)
        along = tangents(normals)
        here = wrench_quality(points, normals, tangents=along)
        there = wrench_quality(
            3.0 * (points @ rotation.T + shift),
            normals @ rotation.T,
            torque_length=3.0,
            origin=3.0 * shift,
            tangents=along @ rotation.T,
        )
        assert there.signed_epsilon == pytest.approx(here.signed_epsilon, abs=1e-9)
        rounded = [
            wrench_quality(p, n, cones="round").signed_epsilon
            for p, n in ((points, normals), (points @ rotation.T, normals @ rotation.T))
        ]
        assert rounded[0] == pytest.approx(rounded[1], abs=1e-8)  # no tangents to carry along


def test_epsilon_does_not_depend_on_order_or_duplicates():
    rng = np.random.default_rng(7)
    points, normals = random_contacts(rng, 7)
    epsilon = wrench_quality(points, normals).epsilon
    assert epsilon > 0.0
    order = rng.permutation(7)
    assert wrench_quality(points[order], normals[order]).epsilon == pytest.approx(epsilon, abs=1e-12)
    twice = np.concatenate((points, points[:4])), np.concatenate((normals, normals[:4]))
    assert wrench_quality(*twice).epsilon == pytest.approx(epsilon, abs=1e-12)


def test_tetrahedral_sphere_grasp():
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
    q = wrench_quality(corners, -corners, friction=0.0)
    assert (q.epsilon, q.signed_epsilon) == (0.0, 0.0)  # no torque at all
    forces = ConvexHull(q.wrenches[::8, :3])  # the closed form of the 3-D inradius, 1/3
    assert -forces.equations[:, -1].max() == pytest.approx(1 / 3, abs=1e-12)
    # friction on the same contacts closes the grasp
    assert wrench_quality(corners, -corners, friction=0.3).epsilon > 0.05


def test_weakest_direction_attains_epsilon():
    rng = np.random.default_rng(8)
    for _ in range(20):
        q = wrench_quality(*random_contacts(rng, 6))
        assert (q.wrenches @ q.weakest).max() == pytest.approx(q.signed_epsilon, abs=1e-9)
        assert np.linalg.norm(q.weakest) == pytest.approx(1.0)
        assert q.lower <= q.epsilon <= q.upper
        assert q.upper - q.lower <= 1e-10


def test_round_cones_lie_between_inscribed_and_circumscribed_polyhedra():
    rng = np.random.default_rng(9)
    closed = 0
    for k in range(30):
        points, normals = random_contacts(rng, int(rng.integers(3, 9)))
        torsion = 0.1 if k % 3 == 0 else 0.0
        given = {"friction": 0.5, "torsion": torsion, "convention": "unit_magnitude" if k % 2 else "normal_unit"}
        q = wrench_quality(points, normals, **given, cones="round")
        inner = wrench_quality(points, normals, **given, edges=24)
        assert q.lower <= q.epsilon <= q.upper
        assert q.upper - q.lower <= 2e-4
        assert inner.epsilon <= q.upper + 1e-10
        closed += q.force_closure
        if torsion == 0.0 and k % 2 == 0:
            outer = wrench_quality(points, normals, 0.5 / np.cos(np.pi / 24), 24)
            assert q.lower <= outer.epsilon + 1e-10
            assert q.signed_epsilon <= outer.signed_epsilon + 1e-8
            assert inner.signed_epsilon <= q.signed_epsilon + 1e-8
    assert closed > 15


def test_round_support_is_the_supremum_over_the_cone():
    rng = np.random.default_rng(10)
    points, normals = random_contacts(rng, 3)
    weights = np.array([1.0, 0.3, 0.6])
    contacts = CheckedContacts.checked(points, normals, 0.6, torsion=0.2, torque_length=0.5, weights=weights)
    centers, axes = round_contacts(contacts)
    u = rng.normal(size=6)
    z = rng.normal(size=(200_000, 3))
    z /= np.linalg.norm(z, axis=1)[:, None]
    for i in range(3):
        force = normals[i] + 0.6 * (
            z[:, :1] * contacts.tangents[i] + z[:, 1:2] * np.cross(normals[i], contacts.tangents[i])
        )
        moment = (np.cross(points[i], force) + 0.2 * z[:, 2:] * normals[i]) / 0.5
        sampled = weights[i] * (np.hstack((force, moment)) @ u).max()
        exact = centers[i] @ u + np.linalg.norm(u @ axes[i])
        assert sampled <= exact + 1e-12
        assert sampled == pytest.approx(exact, rel=1e-4)


def test_two_soft_fingers_close_and_torsion_limits_them():
    points, normals = np.array([[1.0, 0, 0], [-1, 0, 0]]), np.array([[-1.0, 0, 0], [1, 0, 0]])
    for cones in ("polyhedral", "round"):
        q = wrench_quality(points, normals, torsion=0.05, cones=cones)
        # the moment about the line of contacts is the weakest wrench and takes all of the normal force
        assert q.epsilon == pytest.approx(0.05, abs=2e-3)
        assert q.epsilon <= 0.05 + 1e-9
        assert wrench_quality(points, normals, cones=cones).epsilon == 0.0


def test_round_epsilon_is_continuous_where_tangents_jump():
    rng = np.random.default_rng(11)
    pole = np.array([-0.36, -0.48, -0.8])
    points, normals = random_contacts(rng, 5)
    values = []
    for step in (-1e-6, 1e-6):
        normals[0] = np.add(pole, (step, 0.0, 0.0))
        normals[0] /= np.linalg.norm(normals[0])
        values.append(wrench_quality(-normals * 0.9 + 0.1 * points, normals, cones="round").signed_epsilon)
    assert abs(values[0] - values[1]) < 1e-5


def test_failed_expansions_fall_back_and_are_counted():
    # The compiled functions cannot be made to fail; interpreted they can.
    code = """
        import numpy as np
        from surehold.grasping.wrench.friction_cones import contact_wrenches
        from surehold.grasping.wrench.hull import expansion
        from surehold.grasping.wrench.hull.inscribed_ball import ball_radius, inscribed_ball
        rng = np.random.default_rng(12)
        points = rng.normal(size=(6, 3))
        points /= np.linalg.norm(points, axis=1)[:, None]
        w = contact_wrenches(points, -points, 1.5)
        planned = inscribed_ball(w)
        assert planned.radius > 0.0 and planned.fallbacks == 0
        original, calls = expansion.expand_nearest, []

        def fail(*arguments):
            calls.append(arguments)
            result = original(*arguments)
            return (expansion.FAILED, *result[1:]) if len(calls) <= failures else result

        expansion.expand_nearest = fail
        for failures in (1, 2):
            calls.clear()
            ball = inscribed_ball(w)
            assert ball.fallbacks == failures
            assert abs(ball.radius - planned.radius) <= 1e-8
            calls.clear()
            assert ball_radius(w) == ball.radius
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_hundreds_of_near_duplicates_are_measured():
    rng = np.random.default_rng(13)
    for k in range(40):
        points, normals = random_contacts(rng, 5)
        points, normals = np.repeat(points, 8, axis=0), np.repeat(normals, 8, axis=0)
        points = points + 10.0 ** rng.uniform(-13, -5) * rng.normal(size=points.shape)
        q = wrench_quality(points, normals)
        alone = wrench_quality(points[::8], normals[::8])
        assert q.epsilon == pytest.approx(alone.epsilon, abs=1e-3)
        assert q.epsilon >= alone.epsilon - 1e-8, f"set {k}: more contacts, smaller ball"


def test_epsilon_moves_no_more_than_the_wrenches():
    rng = np.random.default_rng(14)
    for _ in range(60):
        points, normals, weights = clustered_contacts(rng, 5, 8, 0.05, flat=False)
        step = 10.0 ** rng.uniform(-9, -2)
        moved = np.clip(weights + step * rng.normal(size=weights.shape), 0.0, 1.0)
        turned = normals + step * rng.normal(size=normals.shape)
        turned /= np.linalg.norm(turned, axis=1)[:, None]
        shifted = points + step * rng.normal(size=points.shape)
        here, there = wrench_quality(points, normals, weights=weights), wrench_quality(shifted, turned, weights=moved)
        kept = np.repeat(moved[weights > 0.0] > 0.0, 8)
        displacement = here.wrenches.copy()
        displacement[kept] -= there.wrenches[np.repeat(weights[moved > 0.0] > 0.0, 8)]
        bound = np.sqrt((displacement**2).sum(axis=1)).max()
        assert abs(here.epsilon - there.epsilon) <= bound + 1e-10


def test_volume_of_a_thin_hull():
    rng = np.random.default_rng(15)
    w = rng.normal(size=(30, 6))
    volume = ConvexHull(w, qhull_options="QJ Pp").volume
    for thickness in (1.0, 1e-3, 1e-6, 1e-9):
        thin = w * [1, 1, 1, 1, 1, thickness]
        assert hull_volume(thin) == pytest.approx(volume * thickness, rel=1e-5)
    assert hull_volume(w * [1, 1, 1, 1, 1, 0]) == 0.0


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, np.float16])
def test_scalars_of_numpy_are_numbers(kind):
    angles = 2.0 * np.pi * np.arange(3) / 3.0
    points = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    expected = wrench_quality(points, -points, friction=1.0, torque_length=2.0, torsion=1.0)
    found = wrench_quality(points, -points, friction=kind(1), torque_length=kind(2), torsion=kind(1))
    np.testing.assert_array_equal(found.wrenches, expected.wrenches)
    assert found.epsilon == expected.epsilon > 0.0
    center = (0.1, 0.0, 0.0)
    np.testing.assert_array_equal(
        gravity_wrenches(kind(3), center, torque_length=kind(2)), gravity_wrenches(3.0, center, torque_length=2.0)
    )
    with pytest.raises(InputError, match="torque_length must be a length"):
        wrench_quality(points, -points, torque_length=kind(0))


def test_too_many_wrenches_are_refused():
    with pytest.raises(InputError, match="65535 can be measured"):
        inscribed_ball(np.random.default_rng(16).normal(size=(65_536, 6)))


def test_any_layout_of_the_wrenches_is_the_same_and_compiles_once():
    from surehold.grasping.wrench.hull.expansion import expand

    w = contact_wrenches(*random_contacts(np.random.default_rng(17), 6))
    epsilon = ball_radius(w)
    compiled = len(expand.signatures)
    frozen = w.copy()
    frozen.flags.writeable = False
    for other in (np.asfortranarray(w), np.repeat(w, 2, axis=0)[::2], frozen):
        assert ball_radius(other) == epsilon
    assert len(expand.signatures) == compiled

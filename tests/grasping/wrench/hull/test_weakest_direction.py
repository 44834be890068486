"""The minimum of the support function of round contacts, against SciPy's minimizer and the expansion without it."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from surehold.grasping.wrench.friction_cones import CheckedContacts, round_contacts
from surehold.grasping.wrench.hull.expansion import FACETS, ROUND_NEAR, expand
from surehold.grasping.wrench.hull.nearest_facet import DONE, expand_nearest
from surehold.grasping.wrench.hull.support import rim_points, support
from surehold.grasping.wrench.hull.weakest_direction import solve, weakest_direction
from surehold.grasping.wrench.hull.workspace import workspace

NO_WRENCHES = np.zeros((0, 6))


def grasp(rng, c, torsion=0.0):
    """Round contacts on a lumpy ball, of graded weights: centers (c, 6) and axes (c, 6, 3)."""
    points = rng.normal(size=(c, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals = -points + 0.3 * rng.normal(size=(c, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    checked = CheckedContacts.checked(
        points * rng.uniform(0.5, 1.0, 3), normals, 0.7, weights=rng.uniform(0.3, 1.0, c), torsion=torsion
    )
    return round_contacts(checked)


def height(u, centers, axes):
    return (centers @ u + np.sqrt(np.sum(np.einsum("j,ijk->ik", u, axes) ** 2, axis=1))).max()


def least_height(centers, axes, start):
    """Minimize e so that all h_i(u) <= e and |u| = 1, over (u, e) from a start (7,)."""

    def above(x):
        return x[6] - centers @ x[:6] - np.sqrt(np.sum(np.einsum("j,ijk->ik", x[:6], axes) ** 2, axis=1))

    unit = {"type": "eq", "fun": lambda x: x[:6] @ x[:6] - 1.0}
    rules = [{"type": "ineq", "fun": above}, unit]
    return minimize(lambda x: x[6], start, constraints=rules, method="SLSQP", options={"ftol": 1e-13})


def least_of_all(centers, axes):
    starts = np.random.default_rng(0).normal(size=(3000, 6))
    starts /= np.linalg.norm(starts, axis=1)[:, None]
    heights = np.array([height(start, centers, axes) for start in starts])
    lowest = np.argsort(heights)[:6]
    found = [least_height(centers, axes, np.append(starts[i], heights[i])).x[:6] for i in lowest]
    return min(height(v / np.linalg.norm(v), centers, axes) for v in found)


@pytest.mark.parametrize(("c", "torsion"), [(5, 0.0), (9, 0.1), (40, 0.0), (120, 0.05)])
def test_newton_ends_where_the_expansion_alone_does(c, torsion):
    work, exact, balls, saved = workspace(1 << 17), 0, 0, 0
    for seed in range(30):
        centers, axes = grasp(np.random.default_rng([c, seed]), c, torsion)
        status, epsilon, lower, upper, u, expansions, *_ = expand(NO_WRENCHES, centers, axes, workspace(FACETS))
        corners = rim_points(centers, axes, 1)
        alone = expand_nearest(corners, centers, axes, 1e-11, 1e-9, 0.0, False, work)
        if status != DONE:
            assert alone[1] <= 1e-9
            continue
        balls += 1
        scale = np.linalg.norm(corners, axis=1).max()
        assert lower <= epsilon <= upper
        assert upper - lower <= ROUND_NEAR * scale
        assert height(u, centers, axes) == pytest.approx(epsilon, abs=1e-12)
        assert np.linalg.norm(u) == pytest.approx(1.0, abs=1e-12)
        assert alone[1] - 1e-9 <= epsilon <= alone[2] + ROUND_NEAR * scale
        saved += alone[4] - expansions
        exact += abs(epsilon - alone[2]) <= 2e-9 * scale
    assert balls >= 15
    assert saved > 0
    assert exact >= balls - 1, "only another minimum within the bounds may be mistaken for the lowest"


@pytest.mark.parametrize(("c", "friction", "torsion"), [(4, 2.0, 0.3), (8, 0.3, 0.3), (6, 0.5, 0.0)])
def test_symmetric_contacts_are_measured_alike_however_they_are_turned(c, friction, torsion):
    """Their weakest directions form a continuum and the bounds stay apart: the lower one was told, up to 7 % off."""
    around = 2.0 * np.pi * np.arange(c) / c
    points = np.column_stack([np.cos(around), np.sin(around), np.zeros(c)])
    for turn in (np.eye(3), Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()):
        turned = points @ turn.T
        centers, axes = round_contacts(CheckedContacts.checked(turned, -turned, friction, torsion=torsion))
        status, epsilon, _, _, u, *_ = expand(NO_WRENCHES, centers, axes, workspace(FACETS))
        assert status == DONE
        assert epsilon == pytest.approx(least_of_all(centers, axes), abs=1e-6)
        assert height(u, centers, axes) == pytest.approx(epsilon, abs=1e-12)


@pytest.mark.parametrize(("friction", "torsion", "length"), [(0.903, 1.0, 1.0), (0.6, 1.0, 2.0), (0.1, 0.3, 0.5)])
def test_two_soft_fingers_resist_least_at_a_kink(friction, torsion, length):
    """In the weakest direction one of them touches with a whole disk; lower and upper bounds were told, by chance."""
    points = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    centers, axes = round_contacts(CheckedContacts.checked(points, -points, friction, length, torsion=torsion))
    status, epsilon, _, _, u, *_ = expand(NO_WRENCHES, centers, axes, workspace(FACETS))
    assert status == DONE
    assert epsilon == pytest.approx(least_of_all(centers, axes), abs=1e-7)
    assert height(u, centers, axes) == pytest.approx(epsilon, abs=1e-12)


@pytest.mark.parametrize("shift", [1e-12, 1e-8, 1e-6])
def test_epsilon_of_almost_symmetric_contacts_is_near_that_of_symmetric_ones(shift):
    """It changes by no more than a wrench moves; it fell to the lower bound, by up to 2 % of the largest wrench."""
    rng = np.random.default_rng(0)
    for c, friction, torsion in ((5, 0.5, 1.0), (8, 2.6, 0.0), (6, 0.06, 0.1), (10, 2.4, 1.0)):
        around = 2.0 * np.pi * np.arange(c) / c
        points = np.column_stack([np.cos(around), np.sin(around), np.zeros(c)])
        moved = points + shift * rng.uniform(-1.0, 1.0, points.shape)
        found = []
        for p in (points, moved):
            n = -p / np.linalg.norm(p, axis=1)[:, None]
            contacts = round_contacts(CheckedContacts.checked(p, n, friction, torsion=torsion))
            found.append(expand(NO_WRENCHES, *contacts, workspace(FACETS))[1])
        assert found[1] == pytest.approx(found[0], abs=1e-7 + 20.0 * shift)


def test_no_direction_near_the_weakest_resists_less():
    # SLSQP on "least e with all h_i(u) <= e": a minimizer that knows nothing of hulls
    for seed in range(12):
        centers, axes = grasp(np.random.default_rng([77, seed]), 12)
        status, epsilon, _, _, u, *_ = expand(NO_WRENCHES, centers, axes, workspace(FACETS))
        if status != DONE:
            continue
        found = least_height(centers, axes, np.append(u, epsilon + 0.01))
        assert found.x[6] == pytest.approx(epsilon, abs=1e-7)


def test_wrong_contacts_are_exchanged_or_refused():
    # Four contacts decide; one too many and one too few are believed to.
    centers, axes = grasp(np.random.default_rng([5, 3]), 9)
    status, epsilon, _, _, u, *_ = expand(NO_WRENCHES, centers, axes, workspace(FACETS))
    assert status == DONE
    heights = np.array([support(u, NO_WRENCHES, 0, centers[[i]], axes[[i]], np.empty(6))[2] for i in range(9)])
    decisive = np.flatnonzero(heights > epsilon - 1e-9)
    idle = int(np.argmin(heights))
    for believed in (decisive, decisive[1:], np.append(decisive[:5], idle)):
        active, weights, near = np.zeros(6, np.int64), np.zeros(6), u + 1e-5
        active[: len(believed)], weights[: len(believed)] = believed, 1.0 / len(believed)
        if weakest_direction(centers, axes, active, weights, len(believed), near, epsilon, 0.0):
            assert height(near, centers, axes) == pytest.approx(epsilon, abs=1e-9)
    active, weights = np.full(6, idle), np.ones(6)
    assert not weakest_direction(centers, axes, active, weights, 1, -u, epsilon, 0.0)


def test_linear_systems_equal_numpy():
    rng = np.random.default_rng(6)
    for size in range(1, 14):
        system, right = rng.normal(size=(13, 14)), rng.normal(size=13)
        expected = np.linalg.solve(system[:size, :size], right[:size])
        assert solve(system, right, size)
        np.testing.assert_allclose(right[:size], expected, rtol=1e-9)
    assert not solve(np.zeros((3, 3)), np.ones(3), 3)


def test_a_workspace_used_again_changes_nothing():
    rng, used = np.random.default_rng(7), workspace(FACETS)
    for c in (30, 8, 60, 5):
        centers, axes = grasp(rng, c)
        first = expand(NO_WRENCHES, centers, axes, used)
        used.clock[0] += (1 << 30) if c == 60 else 0  # steps are counted from 0 again
        again = expand(NO_WRENCHES, centers, axes, used)
        fresh = expand(NO_WRENCHES, centers, axes, workspace(FACETS))
        for other in (again, fresh):
            assert other[:4] == first[:4]
            np.testing.assert_array_equal(other[4], first[4])

"""Min-weight and balance against closed forms, and against linear and quadratic programs written out here."""

import numpy as np
import pytest
from scipy.optimize import Bounds, LinearConstraint, linprog, minimize

from surehold.errors import InputError
from surehold.grasping.wrench.equilibrium import LOADS, balance_quality, load_residual, min_weight
from surehold.grasping.wrench.force_closure import force_closure
from surehold.grasping.wrench.friction_cones import contact_wrenches


def random_wrenches(rng, c, edges=4, spread=0.5):
    points = rng.normal(size=(c, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals = -points + spread * rng.normal(size=(c, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return contact_wrenches(points, normals, friction=0.7, edges=edges)


def test_min_weight_of_a_symmetric_simplex_is_one():
    simplex = np.linalg.qr(np.column_stack([np.ones(7), np.eye(7)[:, :6]]))[0][:, 1:]  # seven points, centroid 0
    assert min_weight(simplex) == pytest.approx(1.0)


def test_min_weight_of_a_simplex_is_its_smallest_barycentric_coordinate():
    rng = np.random.default_rng(0)
    for _ in range(20):
        weights = rng.dirichlet(np.ones(7))
        corners = rng.normal(size=(7, 6))
        corners -= weights @ corners  # the origin has these weights
        assert min_weight(corners) == pytest.approx(7.0 * weights.min(), abs=1e-9)


def test_min_weight_is_positive_exactly_in_force_closure():
    rng = np.random.default_rng(1)
    closed = 0
    for k in range(200):
        w = random_wrenches(rng, int(rng.integers(2, 7)), spread=rng.uniform(0.1, 1.0))
        verdict = force_closure(w)
        assert (min_weight(w) > 1e-9) == verdict, f"set {k}"
        closed += verdict
    assert 20 < closed < 180


def test_min_weight_by_the_dual_program():
    rng = np.random.default_rng(2)
    for _ in range(20):
        w = random_wrenches(rng, 5)
        m = len(w)
        if not force_closure(w):
            continue
        # max l s.t. W'a = 0, sum a = 1, a >= l   has the dual   min s s.t. s >= w_i.y for all i, sum (s - w_i.y) = 1
        rows = np.column_stack((w, -np.ones(m)))
        found = linprog(
            np.append(np.zeros(6), 1.0),
            A_ub=rows,
            b_ub=np.zeros(m),
            A_eq=np.append(-w.sum(axis=0), float(m))[None, :],
            b_eq=[1.0],
            bounds=(None, None),
        )
        assert min_weight(w) == pytest.approx(m * found.fun, abs=1e-8)


def by_interior_points(w, contacts, load):
    """The convex program by another road: SciPy's trust-region method for linear constraints."""
    edges = len(w) // contacts
    pressures = np.kron(np.eye(contacts), np.ones(edges))
    found = minimize(
        lambda x: float(np.sum((w.T @ x + load) ** 2)),
        np.full(len(w), 0.9 / edges),
        jac=lambda x: 2.0 * w @ (w.T @ x + load),
        hess=lambda x: 2.0 * w @ w.T,
        bounds=Bounds(np.zeros(len(w)), np.inf),
        constraints=[
            LinearConstraint(pressures, -np.inf, 1.0),
            LinearConstraint(np.ones((1, len(w))), 1.0, np.inf),
        ],
        method="trust-constr",
        options={"gtol": 1e-10, "xtol": 1e-12, "barrier_tol": 1e-10, "maxiter": 3000},
    )
    assert found.constr_violation < 1e-9
    return np.sqrt(found.fun)


@pytest.mark.parametrize("size", [0.1, 1.5])  # of the large load some contact is pressed as much as it may be
def test_the_residual_is_that_of_the_quadratic_program(size):
    rng = np.random.default_rng(3)
    left = 0
    for _ in range(6):
        c = int(rng.integers(2, 5))
        w, load = random_wrenches(rng, c), size * rng.normal(size=6)
        ours = load_residual(w, 4, load)
        assert ours == pytest.approx(by_interior_points(w, c, load), abs=2e-4)
        left += ours > 1e-3
    assert left > 1


def test_two_opposed_contacts_take_what_friction_lets_them():
    """Pressed with 1 each at most, friction 0.5: pushes across up to 1 are balanced, no torque about their line."""
    points = np.array([[-1.0, 0, 0], [1.0, 0, 0]])
    w = contact_wrenches(points, -points, friction=0.5, edges=64)
    assert load_residual(w, 64, (0, 0, 0.1, 0, 0, 0)) == pytest.approx(0.0, abs=1e-6)
    assert load_residual(w, 64, (0, 0, 1.4, 0, 0, 0)) == pytest.approx(0.4, abs=2e-3)
    assert load_residual(w, 64, (0, 0, 0, 0.1, 0, 0)) == pytest.approx(0.1, abs=1e-6)
    assert balance_quality(w, 64) == pytest.approx(1.0, abs=1e-5)
    one = contact_wrenches(points[:1], -points[:1], friction=0.5, edges=64)  # it must press with 1 and pushes away
    assert load_residual(one, 64, (-0.1, 0, 0, 0, 0, 0)) == pytest.approx(0.9, abs=1e-4)
    assert balance_quality(one, 64) == 0.0


def test_nothing_takes_over_nothing():
    assert load_residual(np.zeros((0, 6)), 8, (0, 3, 4, 0, 0, 0)) == 5.0
    assert min_weight(np.zeros((0, 6))) == 0.0
    assert min_weight(np.eye(6)) == 0.0
    assert balance_quality(np.zeros((0, 6)), 8) == 0.0
    assert LOADS.shape == (6, 6)


def test_bad_arguments_are_explained():
    with pytest.raises(InputError, match="9 wrenches cannot belong to contacts of 4"):
        load_residual(np.zeros((9, 6)), 4, np.ones(6))
    with pytest.raises(InputError, match="load must have shape"):
        load_residual(np.zeros((8, 6)), 4, np.ones(5))
    with pytest.raises(InputError, match="not zero"):
        balance_quality(np.zeros((8, 6)), 4, np.zeros((2, 6)))
    with pytest.raises(InputError, match="wrenches must be finite"):
        min_weight(np.full((8, 6), np.nan))

"""The squeeze: what its torques do on the object, by statics written out here and by MuJoCo's own Jacobians."""

import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear

from surehold.grasping import Simulator, default_pose
from surehold.grasping.physics.check import GraspChecker
from surehold.grasping.physics.squeeze import balanced_torques
from surehold.grasping.wrench.friction_cones import contact_wrenches


@pytest.fixture(scope="module")
def checker():
    return GraspChecker(Simulator(obj="bottle"))


def bottle_grasp(checker, dx=-0.032):
    simulator = checker.simulator
    pose = default_pose(simulator.hand, simulator.object, "right-front", 0.0087, (dx, *[0.0] * 5))
    return simulator.grasp(pose, -0.7)


def limits_of(checker):
    moving = np.zeros(checker.drives.limits.size)
    moving[checker._moving] = 1.0
    return checker.drives.largest * moving.reshape(checker.drives.limits.shape)


def edges_of(checker, grasp):
    """Return wrenches (m, 6) and torques of the joints (m, a) of the friction cones' edges, by MuJoCo's Jacobians."""
    import mujoco

    simulator, limits = checker.simulator, limits_of(checker)
    contacts = simulator.contacts_at(grasp.pose, grasp.joints)
    near = contacts.weights > 0.5
    points, normals, bodies = contacts.points[near], contacts.normals[near], contacts.bodies[near]
    wrenches = contact_wrenches(
        points,
        normals,
        friction=0.8 * simulator.friction,
        torque_length=simulator.object.torque_length,
        origin=simulator.object.center_of_mass,
    )
    data = mujoco.MjData(checker.model)
    mujoco.mj_setState(checker.model, data, checker._state(grasp), mujoco.mjtState.mjSTATE_FULLPHYSICS)
    mujoco.mj_forward(checker.model, data)
    palm = grasp.pose.inverse()
    joints, torques = limits.shape[1], []
    for place, force, body in zip(
        np.repeat(palm.apply(points), 8, axis=0), wrenches[:, :3] @ palm.rotation.T, np.repeat(bodies, 8), strict=True
    ):
        jacobian = np.zeros((3, checker.model.nv))
        if body < limits.size:
            number = checker.model.body(f"{body // joints} {body % joints}").id
            mujoco.mj_jac(checker.model, data, jacobian, None, place, number)
        torques.append(force @ jacobian[:, : len(checker._moving)])
    return wrenches, np.array(torques)


def test_forces_of_the_cones_explain_the_torques_and_balance(checker):
    """Of the torques found, a linear program finds forces that balance to rounding; MuJoCo gives the Jacobians."""
    grasp, limits = bottle_grasp(checker), limits_of(checker)
    shares, residual = balanced_torques(checker.simulator, grasp, limits)
    assert np.abs(shares).max() == pytest.approx(1.0)
    assert residual < 1e-3
    assert not shares[limits == 0.0].any()
    wrenches, torques = edges_of(checker, grasp)
    wanted = (shares * limits).ravel()[checker._moving]
    found = linprog(
        np.zeros(len(wrenches)),
        A_ub=np.vstack([wrenches.T, -wrenches.T, torques.T, -torques.T]),
        b_ub=np.concatenate([np.full(12, 0.05), wanted + 1e-6, 1e-6 - wanted]),
        bounds=(0.0, None),
    )
    assert found.status == 0, "forces within the cones, of a net wrench below 0.05 N, ask for these torques"
    assert found.x.sum() > 5.0, "and press with newtons"


def test_the_torques_are_those_of_the_program_that_is_stated(checker):
    """Strain and evenness under balance, by another solver, and with MuJoCo's Jacobians."""
    grasp, limits = bottle_grasp(checker), limits_of(checker)
    wrenches, torques = edges_of(checker, grasp)
    strains = torques.T / limits.ravel()[checker._moving][:, None]
    of_contact = np.kron(np.eye(len(wrenches) // 8), np.ones(8))
    rows = [strains / np.abs(strains).max(), np.sqrt(len(of_contact)) * of_contact]
    rows += [1000.0 * wrenches.T, np.full((1, len(wrenches)), 1000.0)]
    goal = np.zeros(sum(map(len, rows)))
    goal[-1] = 1000.0
    x = lsq_linear(np.vstack(rows), goal, (0.0, np.inf), method="bvls", tol=1e-12).x
    expected = strains @ x
    shares, _ = balanced_torques(checker.simulator, grasp, limits)
    np.testing.assert_allclose(shares.ravel()[checker._moving], expected / np.abs(expected).max(), atol=1e-4)
    assert (of_contact @ x > 1e-6).mean() > 0.5, "most contacts press, not the few that balance needs"


def test_torques_grow_with_the_limits_in_proportion(checker):
    grasp, limits = bottle_grasp(checker), limits_of(checker)
    once, _ = balanced_torques(checker.simulator, grasp, limits)
    twice, _ = balanced_torques(checker.simulator, grasp, 2.0 * limits)
    np.testing.assert_allclose(once, twice, atol=1e-6)


def test_what_touches_nothing_does_not_squeeze(checker):
    simulator = checker.simulator
    pose = default_pose(simulator.hand, simulator.object, "right-front", 0.4, (0.0,) * 6)
    shares, residual = balanced_torques(simulator, simulator.grasp(pose, -0.7), limits_of(checker))
    assert not shares.any()
    assert residual == 1.0


def test_contacts_on_one_side_are_not_balanced(checker):
    grasp = bottle_grasp(checker, -0.054)
    _, residual = balanced_torques(checker.simulator, grasp, limits_of(checker))
    assert grasp.status == "not closed"
    assert residual > 1e-3

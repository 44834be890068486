"""The measures by name, each against another way to compute it."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from surehold.grasping import (
    OBJECTS,
    QUALITIES,
    Simulator,
    contact_wrenches,
    default_pose,
    object_wrench_space,
    shipped_object,
    simox_quality,
    soft_finger_torsion,
    wrench_quality,
)
from surehold.grasping.wrench.friction_cones import CheckedContacts
from surehold.grasping.wrench.quality import GRAVITY_DIRECTIONS, Measure

BOTTLE = shipped_object("bottle")


def held(**options):
    simulator = Simulator(obj="bottle", contact="single", **options)
    return simulator, simulator.grasp(
        default_pose(simulator.hand, BOTTLE, "right-front", 0.0087, (-0.03, *[0.0] * 5)), -0.7
    )


def lacking(distance):
    """The printed formula for signed_epsilon outside."""
    return -0.05 * np.log(1.0 + distance / 0.05)


@pytest.mark.parametrize("name", QUALITIES)
def test_every_quality_is_reached_by_its_name(name):
    _, grasp = held(quality=name)
    assert grasp.status == "ok"
    assert grasp.quality > 0.0
    away = Simulator(obj="bottle", quality=name).grasp(default_pose(Simulator().hand, BOTTLE, "right-front", 0.5))
    assert away.status == "no contact"
    # what is missing, in torque lengths, where the quality has a sign: 0.5 m but for the fingers' lengths
    expected = lacking(0.5 / BOTTLE.torque_length) if name == "signed_epsilon" else 0.0
    assert away.quality == pytest.approx(expected, rel=0.25)


def test_values_equal_those_of_the_functions():
    simulator, grasp = held(quality="simox")
    space = object_wrench_space(BOTTLE.vertices, BOTTLE.faces)
    assert grasp.quality == simox_quality(grasp.contacts.points, grasp.contacts.normals, space)
    simulator, grasp = held(quality="volume", edges=4)
    edges = contact_wrenches(
        grasp.contacts.points,
        grasp.contacts.normals,
        simulator.friction,
        4,
        BOTTLE.torque_length,
        BOTTLE.center_of_mass,
    )
    assert grasp.quality == pytest.approx(ConvexHull(edges, qhull_options="QJ Pp").volume, rel=1e-6)
    _, closed = held(quality="closure")
    assert closed.quality == 1.0


def test_epsilon_lies_between_its_certified_bounds_and_rounds_up_the_polyhedral_one():
    _, exact = held()
    _, coarse = held(cones="polyhedral")
    _, fine = held(cones="polyhedral", edges=64)
    assert exact.wrench.lower <= exact.quality == exact.wrench.upper
    assert coarse.quality < fine.quality <= exact.wrench.upper + 1e-9
    assert fine.quality == pytest.approx(exact.quality, rel=0.005)


def test_the_unit_magnitude_is_smaller():
    assert held(convention="unit_magnitude")[1].quality < held()[1].quality


def test_the_default_task_is_gravity_however_the_hand_is_turned():
    _, grasp = held(quality="task")
    hull = ConvexHull(grasp.wrench.wrenches, qhull_options="QJ Pp").equations
    directions = np.hstack((GRAVITY_DIRECTIONS, np.zeros((14, 3))))
    along = -directions @ hull[:, :-1].T  # -s t leaves the facet n.x + d <= 0 at s = -d / (n . -t)
    reach = np.where(along > 1e-12, -hull[:, -1] / np.where(along > 1e-12, along, 1.0), np.inf).min(axis=1)
    assert grasp.quality == pytest.approx(reach.min(), rel=1e-6)
    assert grasp.quality <= 0.5 * np.sqrt(2.0)


def test_a_task_is_in_newtons_and_newton_meters():
    lift, heavy, twist = [0, 0, -1.0, 0, 0, 0], [0, 0, -2.0, 0, 0, 0], [0, 0, 0, 0, 0, 0.01]
    values = [held(quality="task", task=[t])[1].quality for t in (lift, heavy, twist)]
    assert values[0] == pytest.approx(2.0 * values[1], rel=1e-9)
    assert held(quality="task", task=[lift, twist])[1].quality == pytest.approx(min(values[0], values[2]), rel=1e-9)
    stretched = Measure("task", BOTTLE, 0.5, task=[twist])
    assert stretched._task_wrenches[0, 5] == pytest.approx(0.01 / BOTTLE.torque_length)


def test_two_soft_fingers_close_and_two_hard_ones_do_not():
    points = BOTTLE.center_of_mass + np.array([[0.026, 0, 0], [-0.026, 0, 0]])
    normals = np.array([[-1.0, 0, 0], [1.0, 0, 0]])
    hard, soft = (Measure("epsilon", BOTTLE, 0.5, torsion=t) for t in (0.0, soft_finger_torsion(0.5, 0.004)))
    assert hard.wrench(points, normals, np.ones(2)).epsilon == 0.0
    # the twist about the line of contacts is the weakest wrench: gamma by the torque length
    expected = soft_finger_torsion(0.5, 0.004) / BOTTLE.torque_length
    assert soft.wrench(points, normals, np.ones(2)).epsilon == pytest.approx(expected, rel=1e-6)
    _, without = held()
    _, with_torsion = held(torsion=0.002)
    assert with_torsion.quality > without.quality


def test_torsion_of_a_soft_finger_equals_the_integral_over_its_patch():
    """Friction under a Hertz pressure of unit normal force, integrated in polar coordinates."""
    radius, friction = 0.005, 0.7
    r = (np.arange(200_000) + 0.5) / 200_000 * radius
    pressure = np.sqrt(1.0 - (r / radius) ** 2)
    moment = friction * np.sum(pressure * r * r) / np.sum(pressure * r)
    assert soft_finger_torsion(friction, radius) == pytest.approx(moment, rel=1e-5)


def test_signed_epsilon_tells_how_far_an_open_grasp_is_from_closure():
    points = BOTTLE.center_of_mass + np.array([[0.026, 0, 0], [0.0, 0.026, 0]])
    normals = np.array([[-1.0, 0, 0], [0.0, -1.0, 0]])
    measure = Measure("signed_epsilon", BOTTLE, 0.5)
    wrench = measure.wrench(points, normals, np.ones(2))
    expected = wrench_quality(
        points, normals, 0.5, torque_length=BOTTLE.torque_length, origin=BOTTLE.center_of_mass, cones="round"
    ).signed_epsilon
    assert expected < 0.0
    assert measure.value(points, normals, wrench) == pytest.approx(lacking(-expected))


def test_without_contacts_it_is_the_mean_way_of_the_fingers():
    gaps = np.array([[0.02, 0.01], [-0.001, 0.03]])
    measure = Measure("signed_epsilon", BOTTLE, 0.5)
    assert measure.without_contacts(gaps) == pytest.approx(lacking(0.005 / BOTTLE.torque_length))


@pytest.mark.parametrize("convention", ["normal_unit", "unit_magnitude"])
def test_cones_of_compiled_trials_are_those_of_contacts(convention):
    cones = Measure("epsilon", BOTTLE, 0.5, torsion=0.002, convention=convention).round_cones()
    contacts = CheckedContacts.checked(
        [[0, 0, 0]], [[1.0, 0, 0]], 0.5, BOTTLE.torque_length, torsion=0.002, convention=convention
    )
    assert (cones.torsion, 1.0 / cones.divisor) == pytest.approx((contacts.torsion[0], contacts.scale[0]))


def test_friction_is_the_objects_own_unless_given():
    assert {name: shipped_object(name).friction for name in OBJECTS} == {
        "mug": 0.5,
        "bottle": 0.45,
        "glass": 0.4,
        "drill": 0.7,
    }
    assert Simulator(obj="glass").measure.friction == 0.4
    assert Simulator(obj="glass", friction=0.9).measure.friction == 0.9
    assert held(friction=0.9)[1].quality > held()[1].quality

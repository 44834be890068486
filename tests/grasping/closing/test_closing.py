"""Closing, checked against exact mesh distances along the whole way of every finger."""

import numpy as np
import pytest
from exact_closing import ExactClosing
from exact_mesh import ExactMesh, capsule_pair

from surehold.grasping.closing.closing import TOUCH
from surehold.grasping.hand.kinematics import link_ends
from surehold.grasping.hand.model import CLOSED
from surehold.grasping.hand.synergy import closing_motion
from surehold.grasping.poses import default_pose
from surehold.grasping.simulator import Simulator

_MESH = 4e-5  # a mesh of flat faces is up to 0.02 mm inside the round object, the field up to 0.01 mm off


def trials(simulator, mode, standoff, n, seed):
    """Random poses and postures whose closed hand touches the object."""
    rng, found = np.random.default_rng(seed), []
    half = simulator.object.box_half_extents
    while len(found) < n:
        offsets = rng.uniform(-1.0, 1.0, 6) * np.array([0.06, half[2], 0.01, 0.3, 0.3, 0.3])
        pose = default_pose(simulator.hand, simulator.object, mode, standoff, offsets)
        s1 = float(rng.uniform(-1.2, 0.9))
        grasp = simulator.grasp(pose, s1)
        if grasp.status != "initial collision" and len(grasp.touching) >= 2:
            found.append((pose, s1, grasp))
    return found


def ends_in_object_frame(simulator, pose, joints):
    return pose.apply(link_ends(simulator.hand.bases, simulator.hand.chains, joints))


@pytest.mark.parametrize("closing", ["adaptive", "synergy"])
@pytest.mark.parametrize(("name", "mode", "standoff"), [("mug", "right-front", 0.02), ("drill", "front-left", 0.03)])
def test_touching_links_touch_and_none_is_inside(name, mode, standoff, closing):
    simulator = Simulator(obj=name, closing=closing, contact="single")
    exact = ExactMesh(simulator.object)
    for pose, _, grasp in trials(simulator, mode, standoff, 6, 1):
        ends = ends_in_object_frame(simulator, pose, grasp.joints)
        bodies = set(grasp.contacts.bodies.tolist())
        for body in range(20):
            gap = simulator.gaps(pose, grasp.joints)[body]
            assert gap > -2e-5, f"{body} is inside the object"
            if body in bodies:
                assert gap < 2 * TOUCH
                assert abs(exact.capsule(ends[body, 0], ends[body, 1], simulator.hand.radii[0, 0])) < _MESH


@pytest.mark.parametrize("closing", ["adaptive", "synergy"])
def test_no_touch_is_missed_on_the_way(closing):
    """Where a link was stopped it had not been before: replay the closing in small steps with exact distances."""
    simulator = Simulator(obj="mug", closing=closing, contact="single")
    exact, radius = ExactMesh(simulator.object), simulator.hand.radii[0, 0]
    for pose, s1, grasp in trials(simulator, "right-front", 0.02, 2, 2):
        motion = closing_motion(simulator.hand, s1)
        for t in np.linspace(2.5, CLOSED, 12):
            # A joint that was stopped stays where it is, the others follow the motion.
            joints = np.minimum(motion.joints(t), grasp.joints)
            joints[:, 0] = grasp.joints[:, 0]
            ends = ends_in_object_frame(simulator, pose, joints)
            for body in range(20):
                if body % 4:
                    assert exact.capsule(ends[body, 0], ends[body, 1], radius) > -_MESH


def test_a_stopped_joint_would_run_into_something():
    """Without object every finger goes on: closing further a touching finger makes it enter the object."""
    simulator = Simulator(obj="mug", contact="single")
    for pose, _, grasp in trials(simulator, "right-front", 0.02, 10, 3):
        for body in grasp.contacts.bodies:
            finger, link = divmod(int(body), 4)
            if link == 0:
                continue
            further = grasp.joints.copy()
            further[finger, 1 : link + 1] += 0.01
            assert simulator.gaps(pose, further)[body] < -1e-5, "the link stands against the object"


def test_closing_follows_the_synergy_until_the_touch():
    simulator = Simulator(obj="mug", contact="single", closing="synergy")
    for _, s1, grasp in trials(simulator, "right-front", 0.02, 10, 4):
        motion = closing_motion(simulator.hand, s1)
        for f in range(5):
            t = np.linspace(0.0, CLOSED, 20_001)
            way = np.clip(
                motion.start[f] + motion.rate[f] * t[:, None], motion.lower[f], motion.upper[f]
            )  # all joints of a finger stop at one time
            assert np.abs(way - grasp.joints[f]).max(axis=1).min() < 1e-3


def test_adaptive_closing_goes_on_beyond_a_touch():
    free, whole = (Simulator(obj="mug", contact="single", closing=c) for c in ("adaptive", "synergy"))
    further = 0
    for pose, s1, grasp in trials(free, "right-front", 0.02, 15, 5):
        other = whole.grasp(pose, s1)
        assert np.all(grasp.joints[:, 1:] >= other.joints[:, 1:] - 0.2)
        further += int(np.any(grasp.joints[:, 3] > other.joints[:, 3] + 0.05))
    assert further > 0


def test_fingers_do_not_enter_each_other_or_the_palm():
    simulator = Simulator(obj="mug", contact="single")
    far = default_pose(simulator.hand, simulator.object, "right-front", 0.5)
    for s1 in (-1.2, -0.6, 0.0, 0.6):
        grasp = simulator.grasp(far, s1)
        assert grasp.status == "no contact"
        ends = link_ends(simulator.hand.bases, simulator.hand.chains, grasp.joints)
        opened = link_ends(simulator.hand.bases, simulator.hand.chains, grasp.open_joints)
        for a in range(20):
            for b in range(4 * (a // 4) + 4, 20):
                if capsule_pair(opened[a], opened[b], simulator.hand.radii[0, 0]) > 0.0:
                    assert capsule_pair(ends[a], ends[b], simulator.hand.radii[0, 0]) > -1e-5, (s1, a, b)
        assert ends[[b for b in range(20) if b % 4 > 1], 1, 2].min() > -0.02


def test_repetition_is_bit_identical():
    simulator = Simulator(obj="mug")
    for pose, s1, grasp in trials(simulator, "right-front", 0.02, 5, 6):
        again = simulator.grasp(pose, s1)
        assert again.quality == grasp.quality
        np.testing.assert_array_equal(again.joints, grasp.joints)
        np.testing.assert_array_equal(again.contacts.points, grasp.contacts.points)


@pytest.mark.parametrize("name", ["mug", "drill"])
def test_closing_angles_equal_those_of_an_exact_distance_library(name):
    """The whole closing repeated with coal's distances to the mesh: the angles agree but for hits that are misses."""
    simulator = Simulator(obj=name, contact="single")
    mode, standoff = ("right-front", 0.02) if name == "mug" else ("front-left", 0.03)
    exact = ExactClosing(simulator)
    found = [
        np.abs(grasp.joints - exact.joints(pose, s1)).max()
        for pose, s1, grasp in trials(simulator, mode, standoff, 6, 8)
    ]
    assert np.median(found) < 0.003
    assert np.sort(found)[-2] < 0.01
